"""Turns about the axis of an eye."""

import numpy as np

from facewright.contact.axes import EyeAxes

X = np.linspace(-1.0, 1.0, 9)
UPPER = np.stack([14.0 * X, 5.0 * (1.0 - X**2), 12.0 - 3.0 * X**2], axis=1)
LOWER = UPPER * [1.0, -0.8, 1.0]
AXES = EyeAxes.of(UPPER, LOWER, np.array([0.5, 0.2, -1.0]))


def test_axes_are_a_frame_from_canthus_to_canthus_whichever_comes_first():
    frame = np.stack([AXES.axis, AXES.forward, AXES.up])
    assert np.allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert AXES.axis[0] > 0.9 and AXES.forward[2] > 0.9 and AXES.up[1] > 0.9
    back = EyeAxes.of(UPPER[::-1], LOWER[::-1], AXES.center)
    assert np.allclose(np.stack([back.axis, back.forward, back.up]), frame, atol=1e-12)


def test_turns_raise_by_their_angle_and_keep_the_rest():
    points = np.random.default_rng(3).uniform([-10.0, -5.0, 8.0], [10.0, 5.0, 14.0], (30, 3))
    field = np.random.default_rng(4).uniform(-0.3, 0.3, 30)
    moved = AXES.turned(points, field)
    before, after = AXES.cylindrical(points), AXES.cylindrical(moved)
    assert np.allclose(before[:2], after[:2], atol=1e-12)
    assert np.allclose(after[2] - before[2], field, atol=1e-12)


def test_tangents_are_the_slope_of_a_turn():
    points, step = UPPER + [0.0, 0.0, 1.0], 1e-6
    slope = (AXES.turned(points, np.full(9, step)) - AXES.turned(points, np.full(9, -step))) / (2.0 * step)
    assert np.allclose(AXES.tangents(points), slope, atol=1e-6)
