"""The two sides of a seam."""

import numpy as np
import pytest

from facewright.mesh.seam import seam_sides


@pytest.fixture
def slit():
    """A sheet of 1 mm squares with a slit along y = 0 from x = -4 to 4: vertices, faces, upper and lower line."""
    x, y = np.meshgrid(np.arange(-10, 11.0), np.arange(-10, 11.0))
    V = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    grid = np.arange(21 * 21).reshape(21, 21)
    upper = grid[10, 6:15]
    lower = upper.copy()
    lower[1:-1] = 441 + np.arange(7)
    V = np.vstack([V, V[upper[1:-1]]])
    below = grid.copy()
    below[10, 7:14] = lower[1:-1]
    quads = []
    for j in range(20):
        g = below if j < 10 else grid
        for i in range(20):
            quads.append([g[j, i], g[j, i + 1], g[j + 1, i + 1], g[j + 1, i]])
    quads = np.array(quads)
    return V, np.vstack([quads[:, :3], quads[:, [0, 2, 3]]]), upper, lower


def test_sides_are_apart_and_within_reach(slit):
    V, F, upper, lower = slit
    above, below = seam_sides(V, F, upper, lower, 4.0)
    assert not (above & below).any()
    assert (V[above, 1] >= 0).all() and (V[below, 1] <= 0).all()
    assert set(upper[1:-1]) <= set(np.flatnonzero(above)) and set(lower[1:-1]) <= set(np.flatnonzero(below))
    assert np.abs(V[above | below, 1]).max() < 4.0


def test_what_is_nearest_to_an_end_can_belong_to_neither(slit):
    V, F, upper, lower = slit
    above, below = seam_sides(V, F, upper, lower, 4.0, split_ends=False)
    assert np.abs(V[above | below, 0]).max() <= 4.0
