"""Small knots of crossing faces, smoothed away."""

import numpy as np

from facewright.mesh.adjacency import dilate, vertex_adjacency
from facewright.mesh.intersect import self_intersections


def untangled(vertices, faces, keep, *, rounds=60):
    """Vertices (n, 3) in which the few faces that cross are smoothed with their neighbours until none does.

    keep (n,) bool: vertices that stay; for the knots that are left where both lips run into the corner, and where
    shut lids roll their rims into each other
    """
    moved = vertices.copy()
    A = vertex_adjacency(faces, len(vertices))
    degree = np.maximum(np.asarray(A.sum(axis=1)), 1)
    near = faces[dilate(~keep, faces, 3)[faces].all(axis=1)]
    for _ in range(rounds):
        knot = np.zeros(len(vertices), bool)
        knot[near[np.unique(self_intersections(moved, near))].ravel()] = True
        knot = dilate(knot, faces) & ~keep
        if not knot.any():
            break
        moved[knot] = 0.5 * moved[knot] + 0.5 * ((A @ moved) / degree)[knot]
    return moved
