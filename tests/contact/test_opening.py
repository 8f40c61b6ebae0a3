"""Faces that are opened let nothing cross around them: planes part what would, and what crosses is noticed."""

import numpy as np
import pytest

from facewright.contact import opening
from facewright.contact.opening import Faces, Surroundings, _between
from facewright.mesh.folds import folded_by_shape
from facewright.mesh.intersect import self_intersections

GAP, PULL = 0.4, 3.0  # mm between two sheets; by which a shape pulls a vertex of the lower one to the side


@pytest.fixture
def sheets(sheet):
    """Two sheets that lie over each other: vertices (2n, 3), faces (2m, 3), and the middle of the lower one."""
    vertices, faces = sheet()
    n, middle = len(vertices), 7 * 15 + 7
    return np.concatenate([vertices, vertices + [0.0, 0.0, GAP]]), np.concatenate([faces, faces + n]), middle


def patch_of(vertices, faces, middle, deltas):
    """The Faces around a vertex and their neighbours, which move by deltas (t, n, 3)."""
    ring = np.isin(faces, faces[(faces == middle).any(axis=1)]).any(axis=1)
    asked = np.flatnonzero(ring)
    near = faces[np.isin(faces, faces[ring]).any(axis=1)]
    used, local = np.unique(near, return_inverse=True)
    mine = np.searchsorted(used, faces[asked])
    return Faces(asked, used, np.arange(len(deltas)), vertices[used], deltas[:, used], mine, local.reshape(-1, 3))


def test_what_a_change_lets_cross_is_noticed_and_walled_off(sheets):
    vertices, faces, middle = sheets
    deltas = np.zeros((1, len(vertices), 3))
    deltas[0, :, 2] = 0.01
    patch = patch_of(vertices, faces, middle, deltas)
    free = np.isin(patch.used, faces[patch.asked])
    around = Surroundings(patch, free, vertices, faces, list(deltas), np.ones((1, 1)))
    change = np.zeros_like(patch.deltas)
    assert not around.unsound(change) and not around.walls(np.ones((1, len(patch.used), 1)))[0].shape[0]
    change[0, patch.used == middle, 2] = 2.0 * GAP
    assert around.unsound(change)
    walls, past = around.walls(np.ones((1, len(patch.used), 1)))
    assert (past <= 0.0).all() and (past + walls @ change.ravel()).max() > 0.25 * GAP
    change[0, patch.used == middle, 2] = 0.2 * GAP
    assert (past + walls @ change.ravel()).max() <= 0.0 and not around.unsound(change)


def test_what_lies_far_at_rest_is_noticed_where_a_pose_brings_it_near(sheet):
    """As lids of wide eyes, which a blink brings together."""
    vertices, faces = sheet()
    n, middle, far = len(vertices), 7 * 15 + 7, 15.0
    vertices = np.concatenate([vertices, vertices + [0.0, 0.0, far]])
    faces = np.concatenate([faces, faces + n])
    deltas = np.zeros((1, 2 * n, 3))
    deltas[0, :n, 2] = far - GAP
    patch = patch_of(vertices, faces, middle, deltas)
    free = np.isin(patch.used, faces[patch.asked])
    around = Surroundings(patch, free, vertices, faces, list(deltas), np.ones((1, 1)))
    change = np.zeros_like(patch.deltas)
    change[0, patch.used == middle, 2] = 2.0 * GAP
    assert around.unsound(change)


def test_faces_are_opened_beside_a_sheet_that_nothing_may_cross(sheets):
    vertices, faces, middle = sheets
    deltas = np.zeros((1, len(vertices), 3))
    deltas[0, middle] = [PULL, 0.0, 0.2 * GAP]
    patch = patch_of(vertices, faces, middle, deltas)
    weights = np.linspace(0.1, 1.0, 10)[:, None]
    free = np.isin(patch.used, faces[patch.asked])
    around = Surroundings(patch, free, vertices, faces, list(deltas), np.ones((1, 1)))
    assert len(folded_by_shape(vertices, vertices + deltas[0], faces))
    change = patch.opened(weights, np.ones(len(patch.asked), bool), free.astype(float), around)
    after = vertices + deltas[0]
    after[patch.used] += change[0]
    assert not len(folded_by_shape(vertices, after, faces)) and not len(self_intersections(after, faces))


@pytest.mark.parametrize("limit, stays", [(0.12, True), (np.inf, False)])
def test_what_is_stiff_stays_where_it_is(sheets, monkeypatch, limit, stays):
    vertices, faces, middle = sheets
    deltas = np.zeros((1, len(vertices), 3))
    deltas[0, middle] = [PULL, 0.0, 0.0]
    patch = patch_of(vertices, faces, middle, deltas)
    ease = np.where(patch.used == middle, 0.03, 0.0)
    around = Surroundings(patch, ease > 0.0, vertices, faces, list(deltas), np.ones((1, 1)))
    monkeypatch.setattr(opening, "_STIFF_MM", limit)
    weights = np.linspace(0.1, 1.0, 10)[:, None]
    change = patch.opened(weights, np.ones(len(patch.asked), bool), ease, around)
    assert (np.linalg.norm(change, axis=2).max() <= 0.12) == stays


def test_a_plane_lies_between_triangles_that_are_apart():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 200, 3, 3))
    other[:100] += [6.0, 0.0, 0.0]
    way, middle, gap = _between(one, other)
    assert (gap[:100] > 0.0).all() and (gap[100:] < 0.0).any()
    apart = gap > 0.0
    for triangle, sign in ((one, 1.0), (other, -1.0)):
        height = sign * (np.einsum("qic,qc->qi", triangle, way) - middle[:, None])
        assert (height[apart].min(axis=1) >= 0.5 * gap[apart] - 1e-9).all()
    pairs = np.arange(6).reshape(2, 3)
    crossing = [len(self_intersections(np.concatenate(both), pairs)) > 0 for both in zip(one, other)]
    assert np.array_equal(crossing, ~apart)
