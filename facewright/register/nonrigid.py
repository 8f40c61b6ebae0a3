"""Non-rigid fit of the outer skin: point-to-plane both ways against bending and stretching of the displacement.

Minimises over the displacement d of the model's vertices x

    sum_i w_i (n_i . (x_i + d_i - p_i))^2            template to scan, point to plane
  + sum_j w_j (n_j . (B_j (x + d) - q_j))^2          scan to template, so that no hollow is skipped
  + sum_l w_l |C_l (x + d) - c_l|^2                  feature lines (lip seam, lid lines)
  + w_bend |M^-1/2 L d|^2 + w_stretch d' L d + w_hold |d|^2

with L the cotangent Laplacian of the model fit and M its lumped mass. d is measured from the model fit at every level,
so that stiffness falls without the mesh forgetting the model. The data terms couple x, y and z, so the system is
solved by conjugate gradients, preconditioned with a Cholesky factor of the n x n part that the axes share: a factor of
the full 3n system costs eight times as much and its solution is the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from facewright.solve.quadratic import Factorization


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
        L = safe_laplacian(vertices, faces)
        mass = np.maximum(vertex_mass(vertices, faces), 0.02)
        local = np.ones(n) if stiffness is None else stiffness
        self.L = L
        self.bending = (L.T @ sp.diags(local / mass) @ L).tocsr()
        edge = sp.diags(np.sqrt(local))
        self.stretching = (edge @ L @ edge).tocsr()
        row_sum = np.asarray(self.stretching.sum(axis=1)).ravel()
        self.stretching = self.stretching - sp.diags(row_sum)
        self.mass = mass

    def solve(self, rows, w_bend, w_stretch, w_hold, start=None, tolerance=1e-3, max_iterations=40):
        """The displacement (n, 3) for a tuple of Rows."""
        n = len(self.vertices)
        shared = w_bend * self.bending + w_stretch * self.stretching + w_hold * sp.diags(self.mass)
        A, b, diagonal = _data_terms(rows, self.vertices)
        preconditioner = Factorization(shared + diagonal + 1e-9 * sp.eye(n))
        x = np.zeros((n, 3)) if start is None else start.copy()
        return _conjugate_gradients(shared.tocsr(), A, b, preconditioner, x, tolerance, max_iterations)


def safe_laplacian(vertices, faces):
    """Cotangent Laplacian with every edge weight clamped to 0.05..5: slivers of real templates stay harmless."""
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


def vertex_mass(vertices, faces):
    """(n,) a third of the areas around each vertex."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    return np.bincount(faces.ravel(), weights=np.repeat(areas, 3), minlength=len(vertices))


def _data_terms(rows, vertices):
    """The 3x3 blocks of the data terms as nine (n, n) matrices (six kept), right-hand side (n, 3), shared diagonal."""
    n = len(vertices)
    blocks = {}
    b = np.zeros((n, 3))
    diagonal = sp.csr_matrix((n, n))
    for term in rows:
        residual = term.targets - term.matrix @ vertices
        matrix, transposed = term.matrix, term.matrix.T.tocsr()
        if term.normals is None:
            shared = transposed @ sp.diags(term.weights) @ matrix
            for axis in range(3):
                blocks[axis, axis] = blocks.get((axis, axis), 0) + shared
                b[:, axis] += transposed @ (term.weights * residual[:, axis])
            diagonal = diagonal + shared
            continue
        height = np.einsum("rc,rc->r", term.normals, residual)
        for axis in range(3):
            b[:, axis] += transposed @ (term.weights * term.normals[:, axis] * height)
            for other in range(axis, 3):
                weights = term.weights * term.normals[:, axis] * term.normals[:, other]
                block = transposed @ sp.diags(weights) @ matrix
                blocks[axis, other] = blocks.get((axis, other), 0) + block
        diagonal = diagonal + transposed @ sp.diags(term.weights / 3.0) @ matrix
    return blocks, b, diagonal


def _conjugate_gradients(shared, blocks, b, preconditioner, x, tolerance, max_iterations):
    def apply(v):
        result = shared @ v
        for (axis, other), block in blocks.items():
            result[:, axis] += block @ v[:, other]
            if other != axis:
                result[:, other] += block @ v[:, axis]
        return result

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
