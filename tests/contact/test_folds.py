"""Targets come out without folded faces, and what had none is left as it is."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.contact import Targets, lay_flat
from facewright.mesh.folds import folded_by_shape


@pytest.fixture(scope="module")
def face(hm08, hm08_person):
    return replace(hm08_person(0), vertices=hm08.vertices)


def test_a_fold_on_the_cheek_is_turned_back(hm08, face):
    skin = hm08.skin.vertex_slice
    k = hm08.shape_names.index("cheekPuff")
    cheek = int(np.abs(hm08.deltas[k, skin]).max(axis=1).argmax())
    deltas = hm08.deltas.copy()
    deltas[k, cheek] += [3.0, 0.0, 0.0]
    pair = {"cheekPuff+jawOpen": np.zeros_like(deltas[0])}
    targets = Targets(hm08.shape_names, deltas, pair, {}, {"cheekPuff+jawOpen": ("cheekPuff", "jawOpen")})
    flat = lay_flat(face, targets)
    faces = hm08.faces[hm08.skin.face_slice]
    outside = ~hm08.regions["mouth_interior"][skin][faces].any(axis=1)
    V = face.vertices[skin]
    assert len(folded_by_shape(V, V + deltas[k, skin], faces, outside))
    assert not len(folded_by_shape(V, V + flat.deltas[k, skin], faces, outside))
    changed = np.abs(flat.deltas[k] - deltas[k]).max(axis=1) > 0
    assert changed.any() and np.linalg.norm(hm08.vertices[changed] - hm08.vertices[cheek], axis=1).max() < 15.0


def test_sound_shapes_are_left_alone(hm08, face):
    targets = Targets(hm08.shape_names, hm08.deltas)
    same = [np.array_equal(a, b) for a, b in zip(lay_flat(face, targets).deltas, hm08.deltas)]
    assert sum(same) >= 45
