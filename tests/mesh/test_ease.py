"""What crosses under a rough motion no longer does under the eased one, and what moves smoothly stays as it is."""

import numpy as np
import pytest

from facewright.mesh.ease import eased


@pytest.fixture(scope="module")
def sheets():
    """Points of two sheets, 0.3 mm apart: (points (n, 3), upper (n,) bool, how far from the middle (n,))."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-8, 8, 33), np.linspace(-8, 8, 33)))
    lower = np.stack([x, y, np.zeros_like(x)], axis=1)
    points = np.concatenate([lower, lower + [0.0, 0.0, 0.3]])
    return points, np.arange(len(points)) >= len(lower), np.linalg.norm(points[:, :2], axis=1)


def test_sheets_that_change_places_are_put_right(sheets):
    points, upper, radius = sheets
    motion = np.zeros_like(points)
    motion[upper, 2] = -0.8 * np.exp(-((radius[upper] / 1.5) ** 2))
    moved = points + motion
    assert (moved[upper, 2] < moved[~upper, 2]).any()
    change = eased(points, np.ones(len(points)), motion, radius < 3.0, 2.0)
    moved = moved + change
    assert (moved[upper, 2] > moved[~upper, 2] + 0.2).all()
    assert not change[radius > 7.1].any()


def test_a_motion_that_is_one_stays(sheets):
    points, _, radius = sheets
    motion = np.tile([1.0, -2.0, 0.5], (len(points), 1))
    assert np.abs(eased(points, np.ones(len(points)), motion, radius < 3.0, 1.0)).max() < 1e-12
    assert not eased(points, np.ones(len(points)), motion + points, radius < 0.0, 1.0).any()


def test_what_is_not_asked_for_neither_moves_nor_counts(sheets):
    points, upper, radius = sheets
    motion = np.zeros_like(points)
    motion[upper, 2] = -0.8
    change = eased(points, np.ones(len(points)), motion, radius < 3.0, 1.0, upper)
    assert np.abs(change).max() < 1e-12


def test_the_fading_is_smooth(sheets):
    points, _, radius = sheets
    rng = np.random.default_rng(0)
    motion = rng.normal(size=points.shape)
    change = eased(points, np.ones(len(points)), motion, radius < 1.0, 2.0)
    left = np.linalg.norm(motion + change, axis=1)
    assert left[radius < 1.0].max() < 0.3  # noise is gone at the place
    assert np.linalg.norm(change[(radius > 4.4) & (radius < 5.0)], axis=1).max() < 0.4
