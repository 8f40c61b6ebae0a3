"""Rims of shut lids lie on each other; lids that are open stay."""

import numpy as np
import pytest

from facewright.contact.rims import LidRims


@pytest.fixture(scope="module")
def lids():
    """Two round rims in an eye's own coordinates: (along (n,), radius (n,), angle (n,)), faces, margins."""
    along, arc = np.meshgrid(np.linspace(-8, 8, 17), np.linspace(0, np.pi / 2, 9))
    index = np.arange(along.size).reshape(along.shape)
    a, b, c, d = (index[i : 8 + i, j : 16 + j].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    open_by = 0.15 * np.maximum(np.cos(np.pi * along / 17.0), 0.02)
    bulge, radius = 0.1 * np.sin(2 * arc), 12.5 + 1.5 * arc / (np.pi / 2)
    angle = np.concatenate([(open_by - bulge + 0.05 * arc).ravel(), (-open_by + bulge - 0.05 * arc).ravel()])
    return (
        (np.tile(along.ravel(), 2), np.tile(radius.ravel(), 2), angle),
        np.concatenate([faces, faces[:, ::-1] + along.size]),
        (index[0], index[0] + along.size),
    )


@pytest.fixture(scope="module")
def rims(lids):
    (along, radius, angle), faces, margins = lids
    V = np.stack([along, radius * np.sin(angle), radius * np.cos(angle)], axis=1)
    return LidRims(V, faces, *margins)


def overlap(angle, n):
    """mm by which the upper rim lies under the lower one, vertex by vertex: they are paired here."""
    return (angle[n:] - angle[:n]) * 12.5


def test_open_lids_stay(lids, rims):
    (along, radius, angle), _, margins = lids
    apart = angle + np.where(np.arange(len(angle)) < len(angle) // 2, 1.0, -1.0)
    turns = rims.turns(along, radius, apart)
    turns[np.concatenate(margins)] = 0.0
    assert not turns.any()


def test_shut_rims_meet_half_way(lids, rims):
    (along, radius, angle), _, _ = lids
    n = len(angle) // 2
    shut = angle.copy()
    opening = 0.15 * np.maximum(np.cos(np.pi * along / 17.0), 0.02)
    shut -= np.where(np.arange(2 * n) < n, opening, -opening)
    turns = rims.turns(along, radius, shut)
    inner = np.abs(along[:n]) < 6.5
    assert overlap(shut, n)[inner].max() > 1.0
    assert overlap(shut + turns, n)[inner].max() < 0.05
    assert (turns[:n] >= 0.0).all() and (turns[n:] <= 0.0).all()  # each gives way to its own side
