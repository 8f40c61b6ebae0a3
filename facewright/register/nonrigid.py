"""Non-rigid fit of the outer skin: point-to-plane both ways against bending and stretching of the displacement.

Minimises over the displacement d of the model's vertices x

    sum_i w_i (n_i . (x_i + d_i - p_i))^2            template to scan, point to plane
  + sum_j w_j (n_j . (B_j (x + d) - q_j))^2          scan to template, so that no hollow is skipped
  + sum_l w_l |C_l (x + d) - c_l|^2                  feature lines (lip seam, lid lines)
  + w_bend |M^-1/2 L d|^2 + w_stretch d' L d + sum_i h_i |d_i|^2

with L the cotangent Laplacian of the model fit, M its lumped mass, and h the hold times the mass. d is measured from
the model fit at every level, so that stiffness falls without the mesh forgetting the model. The data terms couple x, y
and z, so the system is solved by conjugate gradients, preconditioned with a Cholesky factor of the n x n part that the
axes share: a factor of the full 3n system costs eight times as much and its solution is the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from facewright.mesh.laplacian import clamped_laplacian, lumped_mass
from facewright.solve.quadratic import Factorization

# A symmetric 3 x 3 block is kept as xx, xy, xz, yy, yz, zz.
_FIRST, _SECOND = [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]
_SIX, _DIAGONAL = [0, 1, 2, 1, 3, 4, 2, 4, 5], [0, 3, 5]
_POINT = np.array([1.0, 0, 0, 1.0, 0, 1.0])


@dataclass(frozen=True)
class Rows:
    """Point-to-plane or -point rows: weights (r,), matrix csr (r, n), targets (r, 3), normals (r, 3) or None."""

    matrix: sp.csr_matrix
    targets: np.ndarray
    weights: np.ndarray
    normals: np.ndarray | None = None


class ElasticSkin:
    """The regulariser of one mesh: L (n, n) cotangent Laplacian and mass (n,) in mm2, clamped to be safe on slivers."""

    def __init__(self, vertices, faces, stiffness=None):
        self.vertices = vertices
        self.faces = faces
        n = len(vertices)
        L = clamped_laplacian(vertices, faces)
        mass = np.maximum(lumped_mass(vertices, faces), 0.02)
        local = np.ones(n) if stiffness is None else stiffness
        self.L = L
        self.bending = (L.T @ sp.diags(local / mass) @ L).tocsr()
        edge = sp.diags(np.sqrt(local))
        self.stretching = (edge @ L @ edge).tocsr()
        row_sum = np.asarray(self.stretching.sum(axis=1)).ravel()
        self.stretching = self.stretching - sp.diags(row_sum)
        self.mass = mass

    def solve(self, rows, w_bend, w_stretch, w_hold, start=None, tolerance=1e-3, max_iterations=40):
        """The displacement (n, 3) for a tuple of Rows; w_hold: a number or (n,)."""
        n = len(self.vertices)
        shared = w_bend * self.bending + w_stretch * self.stretching + sp.diags(w_hold * self.mass)
        A, b, diagonal = _data_terms(rows, self.vertices)
        preconditioner = Factorization(shared + diagonal + 1e-9 * sp.eye(n))
        x = np.zeros((n, 3)) if start is None else start.copy()
        return _conjugate_gradients(shared.tocsr(), A, b, preconditioner, x, tolerance, max_iterations)


def _data_terms(rows, vertices):
    """The data terms as a (3n, 3n) matrix of 3 x 3 blocks, right-hand side (n, 3), what the axes share (n, n)."""
    n = len(vertices)
    b = np.zeros((n, 3))
    keys, blocks = [], []
    for term in rows:
        residual = term.targets - term.matrix @ vertices
        if term.normals is None:
            b += term.matrix.T @ (term.weights[:, None] * residual)
            per_row = term.weights[:, None] * _POINT
        else:
            height = np.einsum("rc,rc->r", term.normals, residual)
            b += term.matrix.T @ ((term.weights * height)[:, None] * term.normals)
            per_row = term.weights[:, None] * term.normals[:, _FIRST] * term.normals[:, _SECOND]
        row, one, other, value = _products(term.matrix)
        keys.append(one * n + other)
        blocks.append(value[:, None] * per_row[row])
    places, inverse = np.unique(np.concatenate(keys), return_inverse=True)
    blocks = np.concatenate(blocks)
    six = np.stack([np.bincount(inverse, blocks[:, i], len(places)) for i in range(6)], axis=1)
    columns, starts = places % n, np.searchsorted(places, np.arange(n + 1) * n)
    A = sp.bsr_matrix((six[:, _SIX].reshape(-1, 3, 3), columns, starts), shape=(3 * n, 3 * n))
    shared = sp.csr_matrix((six[:, _DIAGONAL].mean(axis=1), columns, starts), shape=(n, n))
    return A, b, shared


def _products(matrix):
    """Pairs of entries in the same row of a csr matrix: row, column, other column and product, each (p,)."""
    counts = np.diff(matrix.indptr)
    row_of = np.repeat(np.arange(len(counts)), counts)
    partners = counts[row_of]
    first = np.repeat(np.arange(matrix.nnz), partners)
    row = row_of[first]
    place = np.arange(len(first)) - np.repeat(np.cumsum(partners) - partners, partners)
    second = matrix.indptr[row] + place
    indices = matrix.indices.astype(np.int64)
    return row, indices[first], indices[second], matrix.data[first] * matrix.data[second]


def _conjugate_gradients(shared, data, b, preconditioner, x, tolerance, max_iterations):
    def apply(v):
        return shared @ v + (data @ v.ravel()).reshape(-1, 3)

    residual = b - apply(x)
    z = preconditioner.solve(residual)
    p = z.copy()
    rz = float((residual * z).sum())
    first = max(rz, float((b * preconditioner.solve(b)).sum()) * 1e-12)
    for _ in range(max_iterations):
        Ap = apply(p)
        step = rz / max(float((p * Ap).sum()), 1e-30)
        x = x + step * p
        residual = residual - step * Ap
        z = preconditioner.solve(residual)
        rz_next = float((residual * z).sum())
        if rz_next < tolerance**2 * first:
            break
        p = z + (rz_next / rz) * p
        rz = rz_next
    return x
