"""Sheets that cross are moved apart by little, and what does not cross stays."""

import numpy as np
import pytest

from facewright.contact.parting import Parting, PartingOptions
from facewright.mesh.folds import folded_by_shape
from facewright.mesh.intersect import self_intersections


@pytest.fixture(scope="module")
def pads():
    """Two closed pads, one above the other with air between; (vertices, faces, upper (n,) bool)."""
    n = 13
    x, y = np.meshgrid(np.linspace(-6, 6, n), np.linspace(-6, 6, n))
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    top = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    ring = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    after, m = np.roll(ring, -1), n * n
    sides = np.concatenate([np.stack([ring, ring + m, after], 1), np.stack([after, ring + m, after + m], 1)])
    pad = np.concatenate([top, top[:, ::-1] + m, sides])
    flat = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    lower = np.concatenate([flat + [0, 0, -1.0], flat + [0, 0, -4.0]])
    # Vertices of the two do not lie above each other.
    upper = np.concatenate([flat + [0.4, 0.3, 4.0], flat + [0.4, 0.3, 1.0]])
    return np.concatenate([lower, upper]), np.concatenate([pad, pad + 2 * m]), np.arange(4 * m) >= 2 * m


@pytest.fixture(scope="module")
def parting(pads):
    V, F, _ = pads
    every = np.ones(len(F), bool)
    return Parting(V, F, every, every, np.full(len(V), 0.5))


def pressed(pads, by):
    """The upper pad lowered until its rounded underside lies so deep in the lower one."""
    V, _, upper = pads
    pose = V.copy()
    pose[upper, 2] -= 2.0 + by
    round_off = 0.02 * (V[:, 0] ** 2 + V[:, 1] ** 2)
    pose[upper, 2] += round_off[upper]
    return pose


def test_what_does_not_cross_stays(pads, parting):
    V, _, _ = pads
    assert not parting([V], [1.0], [np.zeros_like]).any()
    assert not parting([pressed(pads, -0.1)], [1.0], [np.zeros_like]).any()


def test_pads_in_each_other_come_apart_by_little(pads, parting):
    V, F, upper = pads
    pose = pressed(pads, 0.1)
    assert len(self_intersections(pose, F))
    field = parting([pose], [1.0], [np.zeros_like])
    assert not len(self_intersections(pose + field, F))
    assert not len(folded_by_shape(V, pose + field, F))
    assert 0.02 < np.abs(field).max() < 0.15
    assert field[upper, 2].max() > 0.02 and field[~upper, 2].min() < -0.02  # both give way, each to its own side


def test_a_shape_and_its_half_are_parted_together(pads, parting):
    V, F, _ = pads
    share = np.clip(0.5 + V[:, :1] / 8.0, 0.0, 1.0)
    motion = pressed(pads, 0.08) - V
    poses, acts = [V + motion, V + share * motion], [1.0, share]
    field = parting(poses, acts, [np.zeros_like] * len(poses))
    left = [len(self_intersections(pose + act * field, F)) for pose, act in zip(poses, acts)]
    assert left == [0, 0]


def test_no_vertex_goes_farther_than_it_may(pads):
    V, F, upper = pads
    every = np.ones(len(F), bool)
    parting = Parting(V, F, every, every, np.where(upper, 0.5, 0.01))
    field = parting([pressed(pads, 0.1)], [1.0], [np.zeros_like])
    assert np.linalg.norm(field[~upper], axis=1).max() < 0.01 + 1e-9


def test_what_is_left_is_tried_with_skin_that_may_go_farther(pads):
    V, F, _ = pads
    every, short, long = np.ones(len(F), bool), np.full(len(V), 0.02), np.full(len(V), 0.5)
    pose, shallow = pressed(pads, 0.1), pressed(pads, 0.02)
    once, twice = Parting(V, F, every, every, short), Parting(V, F, every, every, short, farther=long)
    assert len(self_intersections(pose + once([pose], [1.0], [np.zeros_like]), F))
    assert not len(self_intersections(pose + twice([pose], [1.0], [np.zeros_like]), F))
    np.testing.assert_array_equal(*(each([shallow], [1.0], [np.zeros_like]) for each in (once, twice)))


def test_nothing_is_parted_into_what_is_solid(pads, parting):
    _, F, upper = pads
    pose = pressed(pads, 0.1)
    top = pose[upper, 2].max() + 0.02
    field = parting([pose], [1.0], [ceiling(top)])
    assert (pose + field)[:, 2].max() <= top + 1e-6
    assert not len(self_intersections(pose + field, F))


def test_a_thin_lip_goes_back_where_it_came_from(pads):
    """Deeper in the other than it is thick: its far side is the nearer way out, and flesh says nothing of it."""
    V, F, upper = pads
    thin = V.copy()
    thin[V[:, 2] == -4.0, 2] = -1.15
    pose = pressed((thin, F, upper), 0.3)
    assert len(self_intersections(pose, F))
    every, farthest = np.ones(len(F), bool), np.full(len(V), 0.5)
    parting = Parting(thin, F, every, every, farthest, (upper, ~upper))
    parted = pose + parting([pose], [1.0], [np.zeros_like])
    assert not len(self_intersections(parted, F))
    middle = np.abs(V[:, :2]).max(axis=1) < 2.0
    assert parted[upper & middle, 2].min() > parted[~upper & middle, 2].max() - 0.05
    assert (parted[V[:, 2] == -1.0, 2] > parted[V[:, 2] == -4.0, 2]).all()  # not turned inside out


def test_crumpled_skins_are_eased(pads):
    """Both skins that meet are crumpled: what parts one pair crosses another, and a smooth motion crosses nothing."""
    V, F, _ = pads
    every = np.ones(len(F), bool)
    pose = pressed(pads, -0.2)
    rough = np.random.default_rng(1).normal(size=V.shape) * 0.8
    pose += rough * (np.linalg.norm(V[:, :2], axis=1) < 3.0)[:, None] * np.isin(V[:, 2], (-1.0, 1.0))[:, None]
    left = {}
    for widths in ((), PartingOptions.eased_mm):
        options = PartingOptions(eased_mm=widths)
        parting = Parting(V, F, every, every, np.full(len(V), 3.0), options=options)
        left[widths] = len(self_intersections(pose + parting([pose], [1.0], [np.zeros_like]), F))
    assert left[()] > 0
    assert left[PartingOptions.eased_mm] == 0


def test_poses_that_are_clean_stay_clean(pads, parting):
    V, F, _ = pads
    motion = pressed(pads, 0.08) - V
    near, share = pressed(pads, -0.01), np.clip(0.5 + V[:, :1] / 8.0, 0.0, 1.0)
    field = parting([V + motion, near], [1.0, share], [np.zeros_like] * 2, clean=1)
    left = [len(self_intersections(pose + act * field, F)) for pose, act in ((V + motion, 1.0), (near, share))]
    assert left == [0, 0]


def ceiling(top):
    """A function of points: their ways back below z = top."""
    return lambda points: np.minimum(top - points[:, 2], 0.0)[:, None] * [0.0, 0.0, 1.0]


def test_on_the_way_too_nothing_is_parted_into_what_is_solid(pads, parting):
    V, F, upper = pads
    pose = pressed(pads, 0.1)
    half = 0.5 * (V + pose)
    lowest = np.flatnonzero(upper)[half[upper, 2].argmin()]
    solid = ceiling(half[lowest, 2])  # what lies in it already may stay as deep

    free = parting([pose], [1.0], [np.zeros_like])
    held = parting([pose, half], [1.0, 0.5], [np.zeros_like, solid], on_way=1)
    assert free[lowest, 2] > 0.01
    assert np.abs(held[upper, 2]).max() < 1e-6
    assert not len(self_intersections(pose + held, F))


def test_what_corrections_have_brought_into_a_solid_together_goes_back(pads, parting):
    left, pose = pads[0], pads[0].copy()
    highest = left[:, 2].argmax()
    pose[highest, 2] += 0.4
    solid = ceiling(left[highest, 2] + 0.1)
    assert not parting([pose], [1.0], [solid]).any()  # contact has left it there
    field = parting([pose], [1.0], [solid], left=[left])
    assert np.isclose((pose + field)[highest, 2], left[highest, 2] + 0.1)
    assert np.flatnonzero(field.any(axis=1)).tolist() == [highest]
