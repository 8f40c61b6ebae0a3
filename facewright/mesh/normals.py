"""Normals and areas of a triangle mesh (V (n, 3), F (m, 3))."""

import numpy as np


def face_cross(V, F):
    """(m, 3) cross products of two edges: normal times twice the area."""
    a = V[F[:, 0]]
    return cross(V[F[:, 1]] - a, V[F[:, 2]] - a)


def cross(a, b):
    """(k, 3) cross products of rows; numpy's own takes several times as long for few rows."""
    result = np.empty_like(a)
    for i in range(3):
        j, k = i - 2, i - 1
        result[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return result


def normalized(vectors):
    """Rows scaled to unit length; a zero row stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def face_normals(V, F):
    """(m, 3) unit normals."""
    return normalized(face_cross(V, F))


def face_areas(V, F):
    """(m,) areas."""
    return 0.5 * np.linalg.norm(face_cross(V, F), axis=1)


def vertex_normals(V, F):
    """(n, 3) unit normals, area-weighted; a vertex without faces gets zero."""
    cross = face_cross(V, F)
    sums = np.empty((len(V), 3))
    corners = F.ravel()
    for axis in range(3):
        sums[:, axis] = np.bincount(corners, weights=np.repeat(cross[:, axis], 3), minlength=len(V))
    return normalized(sums)
