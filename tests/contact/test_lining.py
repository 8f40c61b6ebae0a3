"""The lining of the lips is made anew between what is known, and in the neutral neither lips nor lids cross."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from facewright.contact import clear_lids, clear_lips, even_lining
from facewright.evaluate.synthetic import random_identity
from facewright.mesh.intersect import self_intersections
from facewright.rigging import unscanned_face


@pytest.fixture(scope="module")
def own(hm08):
    return unscanned_face(hm08, hm08.vertices)


@pytest.fixture(scope="module")
def person(hm08):
    return unscanned_face(hm08, random_identity(hm08, 9))


def from_seam(face):
    """(n,) mm of the template's skin from the lips' line."""
    seam = np.concatenate([face.lines["lip_seam_upper"], face.lines["lip_seam_lower"]])
    rest = face.template.vertices[face.template.skin.vertex_slice]
    return cKDTree(rest[seam]).query(rest)[0]


def new_crossings(face):
    skin = face.template.skin
    faces = face.template.faces[skin.face_slice]
    near = (from_seam(face) < 15.0)[faces].all(axis=1)
    pairs = [
        self_intersections(head[skin.vertex_slice], faces, near) for head in (face.template.vertices, face.vertices)
    ]
    before, after = ({tuple(pair) for pair in found} for found in pairs)
    return len(after - before)


def test_the_templates_own_lining_stays(own):
    assert np.array_equal(even_lining(own).vertices, own.vertices)
    assert np.array_equal(clear_lips(own).vertices, own.vertices)


def test_a_flap_is_made_flesh_again(hm08, own):
    at = hm08.skin.vertex_slice
    away = from_seam(own)
    lining = own.regions["mouth_interior"][at] & ~own.regions["outer"][at]
    flap = np.array(own.vertices)
    bump = np.exp(-(((away - 3.0) / 1.5) ** 2)) * lining * (away < 8.0) * (away > 0.1)
    flap[at] += 2.0 * bump[:, None] * [0.0, 1.0, 0.5]
    assert np.abs(flap - own.vertices).max() > 1.0
    assert np.abs(even_lining(replace(own, vertices=flap)).vertices - own.vertices).max() < 1e-6


def test_what_is_seen_and_what_lies_deep_stay(hm08, person):
    at = hm08.skin.vertex_slice
    moved = np.abs(even_lining(person).vertices - person.vertices).max(axis=1) > 0.0
    assert moved[at].any()
    assert not moved[at][person.regions["outer"][at]].any()
    assert from_seam(person)[moved[at]].max() < 10.0
    assert not np.delete(moved, np.arange(at.start, at.stop)).any()


def test_lips_of_the_neutral_do_not_cross(hm08, person):
    at = hm08.skin.vertex_slice
    even = even_lining(person)
    assert new_crossings(even) > 10
    clear = clear_lips(even)
    assert new_crossings(clear) == 0
    change = np.linalg.norm(clear.vertices - even.vertices, axis=1)
    assert change[at][person.regions["outer"][at]].max() < 0.1 + 1e-9
    assert not change[at][from_seam(person) > 15.0].any()


def test_lining_pushed_through_the_skin_at_the_corner_of_an_eye_goes_in_again(hm08, own):
    at, faces = hm08.skin.vertex_slice, hm08.faces[hm08.skin.face_slice]
    upper, lower = own.lines["lid_upper_left"], own.lines["lid_lower_left"]
    canthi = own.vertices[np.intersect1d(upper, lower)]
    away = cKDTree(canthi).query(own.vertices)[0]
    lining = own.regions["socket_left"] & (away < 1.5)
    lining[np.concatenate([upper, lower])] = False
    pushed = np.array(own.vertices)
    pushed[lining] += [0.0, 0.0, 0.8]
    face = replace(own, vertices=pushed)

    def crossing(head):
        return len(self_intersections(head.vertices[at], faces, (away[at] < 6.0)[faces].all(axis=1)))

    cleared = clear_lids(face)
    assert crossing(face) > 0 and crossing(cleared) == 0
    moved = np.abs(cleared.vertices - face.vertices)[at]
    assert moved[own.regions["outer"][at]].max() <= 0.1 + 1e-9
    assert not moved[away[at] > 15.0].any()


def test_lids_that_do_not_cross_stay(own):
    assert np.allclose(clear_lids(own).vertices, own.vertices, atol=1e-9)
