"""The least motion under inequalities, beside what is known of it."""

import numpy as np
import pytest
import scipy.sparse as sp

from facewright.solve.least_motion import least_motion


def test_one_wish_is_met_by_the_shortest_way():
    A = sp.csr_matrix([[3.0, 4.0]])
    assert least_motion(A, np.array([5.0]), np.ones(2)) == pytest.approx([-0.6, -0.8], abs=1e-6)


def test_what_gives_way_readily_moves_more():
    motion = least_motion(sp.csr_matrix([[1.0, 1.0]]), np.array([1.0]), np.array([3.0, 1.0]))
    assert motion == pytest.approx([-0.75, -0.25], abs=1e-6)


def test_what_is_met_already_moves_nothing():
    assert not least_motion(sp.csr_matrix([[1.0, 2.0]]), np.array([-1.0]), np.ones(2)).any()


def test_wishes_that_cannot_all_be_met_are_met_in_part():
    A = sp.csr_matrix([[1.0], [-1.0]])
    motion = least_motion(A, np.array([1.0, 1.0]), np.ones(1), slack=0.1)
    assert motion == pytest.approx([0.0], abs=1e-9)
