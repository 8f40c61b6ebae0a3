"""Shut lids lie on each other without crossing."""

from itertools import pairwise

import numpy as np
import pytest

from facewright.contact.axes import EyeAxes
from facewright.contact.meeting import Meeting
from facewright.mesh.folds import folded_by_shape
from facewright.mesh.intersect import self_intersections

GAP_MM = 0.015
FAR = 12.5


def eye(open_deg, bulge_mm):
    """Two lids over a ball, each a rim that bulges towards the other one and skin above it, open by so much: vertices
    (n, 3), faces, margins."""
    along, arc = np.meshgrid(np.linspace(-8.0, 8.0, 25), np.linspace(0.0, 1.0, 13))
    index = np.arange(along.size).reshape(along.shape)
    a, b, c, d = (index[i : 12 + i, j : 24 + j].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    gap = np.radians(open_deg) * np.cos(np.pi * along / 17.0)
    radius = FAR + np.minimum(3.0 * arc, 1.5)
    rise = np.maximum(arc - 0.5, 0.0) * 0.6 - bulge_mm / FAR * np.sin(np.pi * np.minimum(2.0 * arc, 1.0))
    lids = []
    for sign in (1.0, -1.0):
        angle = sign * (0.5 * gap + rise)
        lids.append(np.stack([along, radius * np.sin(angle), radius * np.cos(angle)], axis=-1).reshape(-1, 3))
    n = along.size
    return np.concatenate(lids), np.concatenate([faces, faces[:, ::-1] + n]), (index[0], index[0] + n)


def turned(vertices, sign, radians, axes):
    """The upper lid down and the lower one up, each by radians (n,)."""
    return axes.turned(vertices, -sign * radians)


@pytest.fixture(scope="module")
def shut():
    """An eye, its Meeting and its pose with both margins on one line, where rims lie in each other."""
    V, faces, margins = eye(40.0, 0.4)
    axes = EyeAxes.of(V[margins[0]], V[margins[1]], np.zeros(3))
    meeting = Meeting(V, faces, np.ones(len(V), bool), *margins, axes)
    sign = np.where(np.arange(len(V)) < len(V) // 2, 1.0, -1.0)
    half = 0.5 * np.radians(40.0) * np.cos(np.pi * V[:, 0] / 17.0)
    return V, faces, margins, meeting, turned(V, sign, half, axes), axes


def test_shut_lids_do_not_cross(shut):
    V, faces, _, meeting, pose, _ = shut
    assert len(self_intersections(pose, faces)) > 50
    met = meeting(pose, GAP_MM)
    assert len(self_intersections(met, faces)) == 0
    assert not len(folded_by_shape(V, met, faces))


def test_margins_hardly_move(shut):
    _, _, margins, meeting, pose, _ = shut
    way = np.linalg.norm(meeting(pose, GAP_MM) - pose, axis=1)
    assert way[np.concatenate(margins)].max() < 0.05 < 0.3 < way.max()


def test_both_lids_give_way_alike(shut):
    _, _, _, meeting, pose, axes = shut
    turn = axes.angles(meeting(pose, GAP_MM)) - axes.angles(pose)
    n = len(pose) // 2
    assert np.allclose(turn[:n], -turn[n:], atol=0.02 / FAR)


def test_distances_along_and_from_the_axis_stay(shut):
    _, _, _, meeting, pose, axes = shut
    before, after = axes.cylindrical(pose), axes.cylindrical(meeting(pose, GAP_MM))
    assert np.allclose(before[0], after[0], atol=1e-9) and np.allclose(before[1], after[1], atol=1e-9)


def test_lids_that_meet_already_stay(shut):
    *_, meeting, pose, _ = shut
    met = meeting(pose, GAP_MM)
    assert np.linalg.norm(meeting(met, GAP_MM) - met, axis=1).max() < 0.02


def test_lids_keep_what_is_asked_between_them(shut):
    _, _, _, meeting, pose, axes = shut
    n = len(pose) // 2
    tight, loose = (axes.angles(meeting(pose, gap)) for gap in (0.015, 0.03))
    wider = FAR * ((loose - tight)[:n] - (loose - tight)[n:])
    assert wider.min() > -0.01 and 0.01 < wider.max() < 0.05


def test_faults_are_new_crossings_and_folds(shut):
    V, faces, _, meeting, pose, _ = shut
    assert meeting.faults(V) == meeting.faults(meeting(pose, GAP_MM)) == 0
    assert meeting.faults(pose) >= len(self_intersections(pose, faces)) > 50


def test_a_sill_is_made_of_the_lower_lining_alone_and_shuts_out_who_looks_between_the_margins():
    V, faces, (upper, lower) = eye(1.0, 0.0)
    margins = np.arctan2(V[np.stack([upper, lower]), 1], V[np.stack([upper, lower]), 2])
    depth, n = np.array([0.4, 0.8, 1.6, 3.2, 6.4]), len(V)
    rows = [np.stack([upper, lower])]
    for d in depth:  # away from each other by half of what they go in
        angle = margins + np.array([1.0, -1.0])[:, None] * 0.5 * d / FAR
        points = [np.full((2, len(upper)), V[upper, 0]), (FAR - d) * np.sin(angle), (FAR - d) * np.cos(angle)]
        V = np.concatenate([V, np.stack(np.broadcast_arrays(*points), axis=-1).reshape(-1, 3)])
        rows.append(np.arange(len(V) - 2 * len(upper), len(V)).reshape(2, -1))
    for one, other in pairwise(rows):
        for lid, turn in ((0, 1), (1, -1)):
            a, b, c, d = one[lid, :-1], one[lid, 1:], other[lid, 1:], other[lid, :-1]
            faces = np.concatenate([faces, np.stack([b, a, d], 1)[:, ::turn], np.stack([b, d, c], 1)[:, ::turn]])
    axes = EyeAxes.of(V[upper], V[lower], np.zeros(3))
    meeting = Meeting(V, faces, np.arange(len(V)) < n, upper, lower, axes)
    sealed = meeting.sealed(V)
    moved = np.flatnonzero(np.linalg.norm(sealed - V, axis=1) > 1e-6)
    below = np.concatenate([row[1] for row in rows[1:]])
    assert len(moved) and np.isin(moved, below).all()
    assert len(self_intersections(sealed, faces)) <= len(self_intersections(V, faces))
    assert not len(folded_by_shape(V, sealed, faces))
    middle = len(upper) // 2
    assert V[rows[2][1, middle], 1] < -0.3 and sealed[rows[2][1, middle], 1] > 0.1
