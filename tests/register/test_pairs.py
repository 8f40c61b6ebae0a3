"""Landmarks of lids on borders that colours show."""

import numpy as np
import scipy.sparse as sp

from facewright.register.lids import Border
from facewright.register.pairs import LIDS, Pairs, on_lid_borders


def test_lids_move_onto_their_borders_and_nothing_else_moves():
    names = tuple(dict.fromkeys(f"mp{number}" for lid in LIDS["left"] for number in lid)) + ("mp1",)
    x = {number: 18.0 + 3.5 * place for lid in LIDS["left"] for place, number in enumerate(lid)}
    points = np.array([[x.get(int(name[2:]), 0.0), 0.0, 5.0] for name in names])
    count = len(names)
    pairs = Pairs(names, points, sp.identity(count), np.ones(count), points, np.zeros(count, bool))
    along = np.linspace(22.0, 42.0, 60)
    borders = [Border(np.stack([along, height + 0 * along, 6.0 + 0 * along], axis=1), None) for height in (4.0, -3.0)]
    moved = on_lid_borders(pairs, {"left": borders}).points
    for lid, height in zip(LIDS["left"], (4.0, -3.0)):
        for number in lid:
            here, before = moved[names.index(f"mp{number}")], points[names.index(f"mp{number}")]
            expected = [before[0], height, 6.0] if 22.0 < before[0] < 42.0 else before
            assert np.allclose(here, expected)
    assert np.array_equal(moved[-1], points[-1])
