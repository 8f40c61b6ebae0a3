import numpy as np
import pytest
import scipy.sparse as sp

from facewright.errors import StageError
from facewright.solve.quadratic import Factorization


def spd(n, seed=0):
    A = sp.random(n, n, density=0.05, random_state=seed)
    return (A @ A.T + sp.eye(n)).tocsr()


def test_agrees_with_a_dense_solve():
    A = spd(80)
    b = np.random.default_rng(0).normal(size=(80, 5))
    assert np.allclose(Factorization(A).solve(b), np.linalg.solve(A.toarray(), b), atol=1e-10)
    assert np.allclose(Factorization(A).solve(b[:, 0]), np.linalg.solve(A.toarray(), b[:, 0]), atol=1e-10)


def test_the_right_hand_side_is_not_changed():
    b = np.ones((80, 2))
    Factorization(spd(80)).solve(b)
    assert (b == 1).all()


def test_a_non_finite_matrix_is_refused():
    A = spd(10)
    A.data[0] = np.nan
    with pytest.raises(StageError, match="non-finite"):
        Factorization(A)
