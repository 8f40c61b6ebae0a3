"""Rims of shut lids keep their form."""

import numpy as np
from scipy.spatial.transform import Rotation

from facewright.contact.rims import FirmRims


def shelves(lean_deg):
    """Two rims 1 mm deep that lean over their margins by so much: vertices (n, 3), masks of both, margins, centre."""
    x = np.linspace(-8.0, 8.0, 17)
    rows = []
    for sign in (1.0, -1.0):
        margin = np.stack([x, sign * 3.0 * np.cos(np.pi * x / 17.0), np.full(17, 12.0)], axis=1)
        way = np.gradient(margin, axis=0)
        away = margin / np.linalg.norm(margin, axis=1, keepdims=True)
        across = np.cross(away, way)
        across *= (-sign * np.sign(across[8, 1]) / np.linalg.norm(across, axis=1))[:, None]
        lean = np.radians(lean_deg)
        rows += [margin + depth * (np.cos(lean) * away + np.sin(lean) * across) for depth in (0.0, 0.3, 0.6, 0.9)]
    V = np.concatenate(rows)
    index = np.arange(len(V)).reshape(2, 4, 17)
    sides = [np.isin(np.arange(len(V)), lid[1:]) for lid in index]
    return V, sides, (index[0, 0], index[1, 0]), index


def test_crushed_rims_get_their_form_back_wherever_the_margins_are():
    V, sides, margins, _ = shelves(20.0)
    R = Rotation.from_euler("xyz", [40.0, 5.0, -8.0], degrees=True).as_matrix()
    crushed = V @ R.T
    for side, line in zip(sides, margins):
        crushed[side] = 0.3 * crushed[side] + 0.7 * np.tile(crushed[line], (3, 1))
    assert np.abs(crushed - V @ R.T).max() > 0.5
    assert np.allclose(FirmRims(V, sides, margins, np.zeros(3))(crushed), V @ R.T, atol=1e-9)


def test_rims_that_lean_over_far_are_laid_down():
    V, sides, margins, index = shelves(75.0)
    laid = FirmRims(V, sides, margins, np.zeros(3))(V)
    for lid, toward in zip(index, (-1.0, 1.0)):
        offset = laid[lid[1:]] - laid[lid[0]]
        assert np.allclose(np.linalg.norm(offset, axis=2), np.linalg.norm(V[lid[1:]] - V[lid[0]], axis=2), atol=0.05)
        middle = offset[:, 8]
        away = V[lid[0, 8]] / np.linalg.norm(V[lid[0, 8]])
        out = middle @ away
        assert np.allclose(np.degrees(np.arccos(out / np.linalg.norm(middle, axis=1))), 30.0, atol=0.5)
        assert (toward * (middle - out[:, None] * away)[:, 1] > 0.0).all()


def test_rims_may_leave_the_corners_alone():
    V, sides, margins, index = shelves(20.0)
    pushed = V.copy()
    for side in sides:
        pushed[side] += [0.0, 0.2, 0.1]
    whole, inner = (FirmRims(V, sides, margins, np.zeros(3))(pushed, corners) for corners in (True, False))
    ends, middle = index[:, 1:, [0, -1]].ravel(), index[:, 1:, 5:12].ravel()
    assert np.allclose(whole, V, atol=1e-9)
    assert np.allclose(inner[ends], pushed[ends], atol=0.02) and np.allclose(inner[middle], V[middle], atol=1e-9)
