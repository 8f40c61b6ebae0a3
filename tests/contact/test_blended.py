"""Shapes that fold a face only together do so no more; what is sound stays as it is."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.contact import Targets, lay_blends_flat
from facewright.contact.blend_poses import sample_poses
from facewright.contact.blended import _Skin
from facewright.mesh.folds import expected_normals, folded_by_shape
from facewright.mesh.normals import face_cross


@pytest.fixture(scope="module")
def face(hm08, hm08_person):
    return replace(hm08_person(0), vertices=hm08.vertices)


@pytest.fixture(scope="module")
def pressed(hm08, face):
    """Targets in which a vertex of the cheek is moved across half a face by each of two shapes, and its faces."""
    skin = hm08.skin.vertex_slice
    V, faces = face.vertices[skin], hm08.faces[hm08.skin.face_slice]
    names = ("cheekPuff", "mouthSmileLeft")
    k = [hm08.shape_names.index(name) for name in names]
    deltas = np.zeros_like(hm08.deltas)
    cheek = int(np.abs(hm08.deltas[k[0], skin]).max(axis=1).argmax())
    mine = faces[(faces == cheek).any(axis=1)][0]
    other = V[mine[mine != cheek]]
    along = other[1] - other[0]
    foot = other[0] + along * ((V[cheek] - other[0]) @ along) / (along @ along)
    deltas[k, cheek] = 0.62 * (foot - V[cheek])
    pair = "+".join(names)
    return Targets(hm08.shape_names, deltas, {pair: np.zeros_like(deltas[0])}, {}, {pair: names}), faces, names


def test_two_shapes_that_fold_a_face_together_no_longer_do(face, pressed):
    targets, faces, names = pressed
    at = face.template.skin.vertex_slice
    V, pose = face.vertices[at], dict.fromkeys(names, 1.0)
    assert not any(len(folded_by_shape(V, V + targets.motion({name: 1.0})[at], faces)) for name in names)
    assert len(folded_by_shape(V, V + targets.motion(pose)[at], faces))
    opened = lay_blends_flat(face, targets)
    assert not len(folded_by_shape(V, V + opened.motion(pose)[at], faces))
    moved = np.abs(opened.deltas - targets.deltas).max(axis=(0, 2)) > 0.0
    moves = np.abs(targets.deltas).max(axis=(0, 2)) > 0.0
    assert moved.any() and not moved[~(moves | moves[face.template.mirror])].any()
    assert np.abs(opened.deltas - targets.deltas).max() < np.abs(targets.deltas).max()


def test_sound_shapes_are_left_alone(hm08, face):
    targets = Targets(hm08.shape_names, 0.02 * hm08.deltas)
    opened = lay_blends_flat(face, targets)
    assert np.array_equal(opened.deltas, targets.deltas)


def test_the_sample_is_the_same_each_time_and_knows_only_shapes_that_are_there(hm08):
    targets = Targets(hm08.shape_names, hm08.deltas)
    poses = sample_poses(targets)
    assert poses == sample_poses(targets)
    assert all(0.0 <= weight <= 1.0 for pose in poses for weight in pose.values())
    few = replace(targets, names=hm08.shape_names[:5], deltas=hm08.deltas[:5])
    assert all(set(pose) <= set(few.names) for pose in sample_poses(few))


def test_faces_are_seen_in_a_blend_as_the_whole_mesh_shows_them(face, pressed):
    targets, faces, names = pressed
    skin, pose = _Skin(face, targets), dict.fromkeys(names, 0.9)
    asked = skin.suspects()
    patch = skin.faces_of(asked)
    along, turn, _ = patch.look(skin.weights([pose])[:, patch.played])
    moved = skin.V + targets.motion(pose)[face.template.skin.vertex_slice]
    close = turn[0] < 0.3
    assert close.any()
    mine = skin.faces[asked[close]]
    at = [int(np.flatnonzero((faces == one).all(axis=1))[0]) for one in mine]
    normals = expected_normals(skin.V, moved, faces, np.array(at))
    assert along[0][close] == pytest.approx((face_cross(moved, mine) * normals).sum(axis=1), abs=1e-9)
