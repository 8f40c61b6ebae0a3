"""Spreading a few displacements over a mesh."""

import numpy as np
import pytest

from facewright.mesh.spread import SoftSpread, spread_smoothly


@pytest.fixture
def grid():
    x, y = np.meshgrid(np.linspace(0, 20, 21), np.linspace(0, 20, 21))
    index = np.arange(441).reshape(21, 21)
    a, b, c, d = (index[i : i + 20, j : j + 20].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    F = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), F


def test_handles_are_met_and_the_rest_stays_zero(grid):
    V, F = grid
    free = np.linalg.norm(V - [10, 10, 0], axis=1) < 7
    field = spread_smoothly(V, F, np.array([220, 0]), np.array([[1.0], [2.0]]), free)
    assert field[220, 0] == 1.0 and field[0, 0] == 2.0
    rest = ~free
    rest[0] = False
    assert not field[rest].any() and (field[free] != 0).all()


def test_the_field_is_smooth_and_falls_off(grid):
    V, F = grid
    free = np.linalg.norm(V - [10, 10, 0], axis=1) < 8
    field = spread_smoothly(V, F, np.array([220]), np.array([[1.0]]), free)[:, 0]
    middle = field.reshape(21, 21)[10, 10:]
    assert (np.diff(middle) < 1e-9).all() and middle[7] < 0.1
    assert np.abs(np.diff(middle)).max() < 0.25


def test_a_linear_field_needs_no_bending_unless_it_must_fade(grid):
    V, F = grid
    handles = np.flatnonzero((V[:, 0] < 2) | (V[:, 0] > 18) | (V[:, 1] < 2) | (V[:, 1] > 18))
    everywhere = np.ones(len(V), bool)
    linear = V @ [[0.1], [0.2], [0.0]]
    assert np.allclose(spread_smoothly(V, F, handles, linear[handles], everywhere), linear, atol=1e-8)
    faded = spread_smoothly(V, F, handles, linear[handles], everywhere, reach_mm=2.0)
    assert np.abs(faded[220]) < 0.5 * np.abs(linear[220])


def test_wishes_are_met_softly_and_fade(grid):
    V, F = grid
    free = np.linalg.norm(V - [10, 10, 0], axis=1) < 9
    wishes, weights = np.zeros((441, 3)), np.zeros(441)
    wishes[220], weights[220] = [0, 0, 1], 100.0
    soft = SoftSpread(V, F, free, reach_mm=4.0)
    narrow, wide = soft(wishes, weights, 0.5)[:, 2], soft(wishes, weights, 2.0)[:, 2]
    assert narrow[220] > 0.95 and wide[220] < narrow[220]
    assert not narrow[~free].any() and not soft(0 * wishes, weights).any()
