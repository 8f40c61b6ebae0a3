"""Landmarks of lids on borders that colours show."""

import numpy as np
import pytest
import scipy.sparse as sp

from facewright.register.lids import Border
from facewright.register.pairs import LIDS, Pairs, eyes_closed, lid_gaps, lid_names, on_lid_borders


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


def eyes(left=1.0, right=1.0, placed=()):
    """Pairs of two eyes whose lids are so far apart for the rest face's 8 mm."""
    rest, here, names = [], [], []
    for side, gap, center in (("left", left, 30.0), ("right", right, -30.0)):
        for lid, sign in zip(LIDS[side], (1.0, -1.0)):
            for number, x in zip(lid, np.linspace(-14.0, 14.0, len(lid))):
                if f"mp{number}" not in names:
                    names.append(f"mp{number}")
                    rest.append([center + x, sign * 4.0 * (1.0 - (x / 14.0) ** 2), 0.0])
                    here.append(rest[-1] * np.array([1.0, gap, 1.0]))
    by_hand = np.isin(names, placed)
    return Pairs(
        tuple(names),
        np.array(here),
        sp.identity(len(names), format="csr"),
        np.ones(len(names)),
        np.array(rest),
        by_hand,
    )


def test_gaps_are_shares_of_the_rest_face_s_whatever_the_scale():
    pairs = eyes(0.5, 0.8)
    assert lid_gaps(pairs) == pytest.approx({"left": 0.5, "right": 0.8})


def test_with_colours_each_eye_is_judged_alone():
    assert eyes_closed(eyes(0.2, 0.8)) == {"left": True, "right": False}


@pytest.mark.parametrize(
    ("gaps", "openness", "shut"),
    [
        ((0.35, 0.35), (0.2, 0.2), (False, False)),  # lids that the landmarker took for shut
        ((0.35, 0.35), (-0.1, -0.1), (True, True)),
        ((0.55, 0.33), (0.0, -0.1), (False, False)),  # no face winks by half
        ((0.9, 0.1), (0.4, -0.3), (False, True)),  # but one that winks plainly does
    ],
)
def test_in_clay_the_relief_decides_with_the_gaps_for_both_eyes_together(gaps, openness, shut):
    closed = eyes_closed(eyes(*gaps), dict(zip(("left", "right"), openness)))
    assert (closed["left"], closed["right"]) == shut


def test_what_is_left_out_does_not_hold_what_a_person_placed():
    upper = lid_names("left")[0]
    pairs = eyes(placed=("mp386",)).without(upper)
    assert set(pairs.names) & upper == {"mp386"}
    assert pairs.points.shape[0] == pairs.rows.shape[0] == len(pairs.names) == len(eyes().names) - len(upper) + 1


def test_a_lid_without_border_stays_and_landmarks_may_be_missing():
    pairs = eyes().without({"mp386"})
    x = np.linspace(20.0, 40.0, 30)
    border = Border(np.stack([x, np.full(30, 6.0), np.zeros(30)], axis=1), None)
    moved = on_lid_borders(pairs, {"left": (border, None)}).points
    lower = np.isin(pairs.names, list(lid_names("left")[1]))
    assert np.array_equal(moved[lower], pairs.points[lower])
    assert (moved[np.isin(pairs.names, ["mp385", "mp387"]), 1] == 6.0).all()
