"""Small knots of crossing faces, and faces that look the wrong way, smoothed away."""

import numpy as np

from facewright.mesh.adjacency import dilate, vertex_adjacency
from facewright.mesh.intersect import intersections_of, self_intersections
from facewright.mesh.laplacian import uniform_laplacian
from facewright.mesh.normals import face_cross, normalized
from facewright.solve.procrustes import best_similarity
from facewright.solve.quadratic import Factorization


def untangled(vertices, faces, keep, *, rounds=60):
    """Vertices (n, 3) in which the few faces that cross are smoothed with their neighbours until none does.

    keep (n,) bool: vertices that stay; for the knots that are left where both lips run into the corner, and where
    shut lids roll their rims into each other
    """
    moved = vertices.copy()
    A = vertex_adjacency(faces, len(vertices))
    degree = np.maximum(np.asarray(A.sum(axis=1)), 1)
    near = faces[dilate(~keep, faces, 3)[faces].all(axis=1)]
    pairs = self_intersections(moved, near)
    for _ in range(rounds):
        knot = np.zeros(len(vertices), bool)
        knot[near[np.unique(pairs)].ravel()] = True
        knot = dilate(knot, faces) & ~keep
        if not knot.any():
            break
        moved[knot] = 0.5 * moved[knot] + 0.5 * (A[knot] @ moved) / degree[knot]
        # Faces that did not move cross as before.
        touched = knot[near].any(axis=1)
        pairs = np.concatenate([pairs[~touched[pairs].any(axis=1)], intersections_of(moved, near, touched)])
    return moved


def unfolded(vertices, faces, expected, keep, *, limit=0.2, rounds=40):
    """Vertices (n, 3) with the few faces that look away from where they should smoothed with their neighbours.

    expected (m, 3) unit normals, zero where nothing is known; keep (n,) bool: vertices that stay
    limit    least cosine of a face's normal with what is expected
    """
    moved = vertices.copy()
    A = vertex_adjacency(faces, len(vertices))
    degree = np.maximum(np.asarray(A.sum(axis=1)), 1)
    known = expected.any(axis=1)
    faces, expected = faces[known], expected[known]
    for _ in range(rounds):
        away = np.einsum("mc,mc->m", normalized(face_cross(moved, faces)), expected) < limit
        loose = np.zeros(len(vertices), bool)
        loose[faces[away].ravel()] = True
        loose &= ~keep
        if not loose.any():
            break
        moved[loose] = 0.5 * moved[loose] + 0.5 * (A[loose] @ moved) / degree[loose]
    return moved


def reshaped(vertices, reference, faces, free):
    """Vertices (n, 3) of which the free (n,) bool take the shape that a reference (n, 3) has there.

    The reference is laid on the free vertices by a similarity; what it is off at their rim is spread over them as
    evenly as second differences allow.
    """
    around = dilate(free, faces, 2)
    R, scale, t = best_similarity(reference[around], vertices[around], np.ones(around.sum()))
    laid = scale * reference @ R.T + t
    offset = np.where(free[:, None], 0.0, vertices - laid)
    L = uniform_laplacian(faces[around[faces].any(axis=1)], len(vertices)).tocsr()
    bending = (L.T @ L).tocsr()[free]
    offset[free] = Factorization(bending[:, free]).solve(-(bending[:, ~free] @ offset[~free]))
    return np.where(free[:, None], laid + offset, vertices)
