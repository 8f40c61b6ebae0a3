"""Finer triangles without another form."""

from __future__ import annotations

import numpy as np

from facewright.mesh.adjacency import half_edges


def split_in_four(faces, n):
    """Every triangle of faces (m, 3) over n vertices in four: edges (e, 2) that get a new vertex each, numbered from n
    on, and the new faces (4m, 3). The order of faces and corners does not depend on how vertices are shared.
    """
    edges, index = np.unique(np.sort(half_edges(faces), axis=1), axis=0, return_inverse=True)
    a, b, c = faces.T
    ab, bc, ca = n + index.reshape(-1, 3).T
    return edges, np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)


def with_midpoints(values, edges):
    """Values (n, ...) at the vertices, then at the middles of edges (e, 2): (n + e, ...)."""
    return np.concatenate([values, values[edges].mean(axis=1)])
