"""Spread a few prescribed displacements smoothly over a triangle mesh."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import unique_edges
from facewright.mesh.laplacian import lumped_mass
from facewright.solve.quadratic import Factorization


def smooth_laplacian(V, F):
    """(n, n) positive semidefinite Laplacian with positive weights: cotangents, floored at 0.05."""
    n = len(V)
    i, j, k = F[:, [0, 1, 2]].ravel(), F[:, [1, 2, 0]].ravel(), F[:, [2, 0, 1]].ravel()
    a, b = V[i] - V[k], V[j] - V[k]
    cot = (a * b).sum(1) / np.maximum(np.linalg.norm(np.cross(a, b), axis=1), 1e-9)
    W = sp.csr_matrix((0.5 * cot, (i, j)), shape=(n, n))
    W = W + W.T
    edges = unique_edges(F)
    w = np.clip(np.asarray(W[edges[:, 0], edges[:, 1]]).ravel(), 0.05, 10.0)
    W = sp.csr_matrix((w, (edges[:, 0], edges[:, 1])), shape=(n, n))
    W = W + W.T
    return (sp.diags(np.asarray(W.sum(axis=1)).ravel()) - W).tocsr()


def bilaplacian(V, F):
    """(n, n) positive semidefinite L M^-1 L."""
    L = smooth_laplacian(V, F)
    mass = np.maximum(lumped_mass(V, F), 0.02)
    return (L @ sp.diags(1 / mass) @ L).tocsr()


def spread(K, handles, values, fixed):
    """The field u with least u^T K u, u = values (h, d) at handles (h,) and 0 where fixed (n,) bool.

    returns (n, d)
    """
    n = K.shape[0]
    u = np.zeros((n, values.shape[1]))
    u[handles] = values
    known = fixed.copy()
    known[handles] = True
    free = np.nonzero(~known)[0]
    rhs = -(K[free] @ u)
    A = K[free][:, free] + 1e-9 * sp.identity(len(free))
    u[free] = Factorization(A).solve(rhs)
    return u
