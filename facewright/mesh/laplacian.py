"""Laplacians of a triangle mesh, positive semidefinite."""

import igl
import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import vertex_adjacency


def cotangent_laplacian(V, F):
    """(n, n) csr, positive semidefinite; row sums 0. Negative weights are possible at obtuse triangles."""
    return (-igl.cotmatrix(np.ascontiguousarray(V), np.ascontiguousarray(F))).tocsr()


def clamped_laplacian(vertices, faces):
    """(n, n) csr cotangent Laplacian with edge weights clamped to 0.05..5: slivers of real templates stay harmless."""
    n = len(vertices)
    rows, cols, values = [], [], []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        a, b, c = vertices[faces[:, i]], vertices[faces[:, j]], vertices[faces[:, k]]
        u, v = a - c, b - c
        cotangent = (u * v).sum(1) / np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-9)
        rows.append(faces[:, i])
        cols.append(faces[:, j])
        values.append(0.5 * cotangent)
    W = sp.coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), shape=(n, n)).tocsr()
    W = W + W.T
    W.data = np.clip(W.data, 0.05, 5.0)
    return (sp.diags(np.asarray(W.sum(axis=1)).ravel()) - W).tocsr()


def uniform_laplacian(F, n):
    """(n, n) csr graph Laplacian D - A."""
    A = vertex_adjacency(F, n)
    return sp.diags(np.asarray(A.sum(axis=1)).ravel()) - A


def lumped_mass(V, F):
    """(n,) barycentric vertex areas, mm2."""
    areas = 0.5 * igl.doublearea(np.ascontiguousarray(V), np.ascontiguousarray(F)) / 3.0
    return np.bincount(F.ravel(), weights=np.repeat(areas, 3), minlength=len(V))
