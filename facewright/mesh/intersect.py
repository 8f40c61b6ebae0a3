"""Triangles of a mesh that pass through each other."""

import igl.predicates
import numpy as np

from facewright.mesh.normals import face_corners

_CLUSTER_MM = 8.0  # faces asked about are looked for together with those this near


def self_intersections(vertices, faces, mask=None):
    """(k, 2) pairs of faces that cross and share no vertex, lower index first.

    vertices (n, 3), faces (m, 3); mask (m,) bool limits both faces of a pair. Exact predicates; touching in a common
    plane is not crossing.
    """
    chosen = np.arange(len(faces)) if mask is None else np.flatnonzero(mask)
    subset = np.ascontiguousarray(faces[chosen], dtype=np.int64)
    if not len(subset):
        return np.empty((0, 2), np.int64)
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    _, pairs, coplanar = igl.predicates.find_self_intersections(vertices, subset)
    pairs = np.asarray(pairs).reshape(-1, 2)[np.asarray(coplanar).reshape(-1) == 0]
    one, other = subset.T[:, pairs[:, 0]], subset.T[:, pairs[:, 1]]
    apart = np.logical_and.reduce([a != b for a in one for b in other])
    return np.unique(np.sort(chosen[pairs[apart]], axis=1), axis=0)


def intersections_of(vertices, faces, asked):
    """As self_intersections, the pairs of which at least one face is asked (m,) bool: quick where these are few."""
    low, high = _face_boxes(vertices, faces)
    cells = np.floor(0.5 * (low + high)[:, asked] / _CLUSTER_MM)
    _, cluster = np.unique(cells, axis=1, return_inverse=True)
    near, mine = asked.copy(), np.flatnonzero(asked)
    for number in range(cluster.max(initial=-1) + 1):
        own = mine[cluster == number]
        near |= _overlapping(low, high, low[:, own].min(axis=1), high[:, own].max(axis=1))
    pairs = self_intersections(vertices, faces, near)
    return pairs[asked[pairs].any(axis=1)]


def _face_boxes(vertices, faces):
    """Lower and upper corners (3, m) of the boxes around faces."""
    a, b, c = (corner.T for corner in face_corners(vertices, faces))
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _overlapping(low, high, least, most):
    """(m,) bool: boxes (3, m) that meet the box from least (3,) to most (3,)."""
    result = low[0] <= most[0]
    for axis in range(3):
        result &= low[axis] <= most[axis]
        result &= high[axis] >= least[axis]
    return result
