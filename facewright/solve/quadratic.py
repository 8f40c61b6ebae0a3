"""Sparse symmetric positive definite systems: factor once, solve for many right-hand sides."""

from __future__ import annotations

import cholespy
import numpy as np

from facewright.errors import StageError


class Factorization:
    """Sparse Cholesky factor of A (n, n), symmetric positive definite (scipy sparse); solve() per right-hand side."""

    def __init__(self, A):
        A = A.tocsc()
        A.sum_duplicates()
        A.sort_indices()
        self.n = A.shape[0]
        if not np.isfinite(A.data).all():
            raise StageError("solve", "not_finite", "the system matrix holds a non-finite number")
        try:
            self._solver = cholespy.CholeskySolverD(
                self.n,
                A.indptr.astype(np.int32),
                A.indices.astype(np.int32),
                A.data.astype(np.float64),
                cholespy.MatrixType.CSC,
            )
        except ValueError as error:
            raise StageError("solve", "not_positive_definite", f"Cholesky failed: {error}") from error

    def solve(self, b):
        """x with A x = b; b is (n,) or (n, k)."""
        b = np.ascontiguousarray(b, dtype=np.float64)
        x = np.zeros_like(b)
        self._solver.solve(b, x)
        if not np.isfinite(x).all():
            raise StageError("solve", "not_finite", "the solution is not finite: the system is singular")
        return x
