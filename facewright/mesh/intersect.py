"""Triangles of a mesh that pass through each other."""

import igl.predicates
import numpy as np


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
    shared = (subset[pairs[:, 0]][:, :, None] == subset[pairs[:, 1]][:, None, :]).any(axis=(1, 2))
    return np.unique(np.sort(chosen[pairs[~shared]], axis=1), axis=0)
