"""A shape is as strong on a person as the mouth's lines say."""

import numpy as np
import pytest

from facewright.solve.procrustes import best_rotation
from facewright.transfer.strength import line_strengths

LINES = {"lip_seam_upper": np.arange(5), "lip_seam_lower": np.arange(5, 10)}


@pytest.fixture
def mouth():
    """A mouth of ten points 40 mm wide, a shape that widens it and one that leaves it alone."""
    x = np.linspace(-20, 20, 5)
    V = np.concatenate([np.stack([x, y + 0 * x, 0 * x], axis=1) for y in (0.5, -0.5)] + [np.ones((3, 3))])
    wide = np.zeros_like(V)
    wide[:10, 0] = 0.3 * V[:10, 0]
    still = np.zeros_like(V)
    still[10:] = 5.0
    return V, np.stack([wide, still])


def test_on_itself_nothing_changes(mouth):
    V, deltas = mouth
    assert np.abs(line_strengths(V, V, deltas, deltas, LINES, np.eye(3)) - 1).max() < 1e-12


def test_a_shape_carried_too_weakly_is_made_up_for(mouth):
    V, deltas = mouth
    points = np.random.default_rng(0).normal(size=(2, 5, 3))
    R = best_rotation(*points)
    target = 1.5 * V @ R.T
    factors = line_strengths(V, target, deltas, 1.5 * 0.9 * deltas @ R.T, LINES, R)
    assert factors == pytest.approx([1 / 0.9, 1.0])


def test_factors_stay_within_reason(mouth):
    V, deltas = mouth
    assert line_strengths(V, V, deltas, 0.1 * deltas, LINES, np.eye(3))[0] == 1.25
    assert (line_strengths(V, V, deltas, deltas, {}, np.eye(3)) == 1).all()
