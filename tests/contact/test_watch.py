"""A watch asks again for just those points that may have reached the surface."""

import numpy as np
import pytest

from facewright.contact.watch import Watch


@pytest.fixture
def scene():
    rng = np.random.default_rng(0)
    points = rng.uniform(-10, 10, (300, 3))
    surface = rng.uniform(-10, 10, (50, 3)) * [1.0, 0.0, 1.0]
    clearance = np.abs(points[:, 1])  # the surface lies in the plane y = 0
    watch = Watch(points, surface).answered(np.arange(300), clearance)
    return watch, points, surface, clearance


def test_at_first_all_are_due(scene):
    _, points, surface, _ = scene
    assert len(Watch(points, surface).due()) == len(points)


def test_what_has_crossed_is_due(scene):
    watch, points, surface, _ = scene
    for shift in (0.5, 3.0):
        moved = points - [0.0, shift, 0.0]
        crossed = np.flatnonzero(np.sign(moved[:, 1]) != np.sign(points[:, 1]))
        due = watch.at(moved, surface).due()
        assert np.isin(crossed, due).all() and len(due) < len(points)


def test_moving_together_costs_nothing(scene):
    watch, points, surface, _ = scene
    shift = np.array([5.0, -20.0, 1.0])
    assert not len(watch.at(points + shift, surface + shift).due())


def test_clearance_is_used_up_step_by_step(scene):
    watch, points, surface, clearance = scene
    for _ in range(10):
        points = points + [0.0, 0.0, 0.3]
        watch = watch.at(points, surface)
    assert (watch.due() == np.flatnonzero(clearance <= 3.0 + 1e-9)).all()
