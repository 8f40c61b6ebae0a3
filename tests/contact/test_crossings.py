"""Targets come out without crossings, halves too; sound shapes are left alone."""

import numpy as np
import pytest

from facewright.contact import Targets, part_crossings
from facewright.evaluate.synthetic import random_identity
from facewright.mesh.intersect import self_intersections
from facewright.rigging import unscanned_face
from facewright.transfer.halves import left_share

NAMES = ("mouthPressLeft", "mouthRollLower", "mouthSmileLeft")


@pytest.fixture(scope="module")
def face(hm08):
    return unscanned_face(hm08, random_identity(hm08, 3))


@pytest.fixture(scope="module")
def targets(hm08, face):
    """Shapes in which a strip of the lower lip is raised a little into the upper one."""
    deltas = np.zeros((len(NAMES), *face.vertices.shape))
    line = face.vertices[face.lines["lip_seam_lower"]]
    middle = line[len(line) // 2]
    near = np.exp(-(np.linalg.norm(face.vertices - middle, axis=1) ** 2) / 20.0)
    lower = np.zeros(len(face.vertices), bool)
    lower[: len(face.regions["lip_lower"])] = face.regions["lip_lower"]
    deltas[1, :, 1] = 0.25 * near * lower
    deltas[2, :, 2] = 3.0 * near
    half = {"mouthRollLower@0.5": 0.5 * deltas[1]}
    return Targets(NAMES, deltas, half, {"mouthRollLower": {0.5: "mouthRollLower@0.5"}})


def new_crossings(face, delta):
    skin = face.template.skin
    V, F = face.vertices[skin.vertex_slice], face.template.faces[skin.face_slice]
    asked = face.regions["face"][skin.vertex_slice][F].all(axis=1)
    pairs = [self_intersections(V + motion, F) for motion in (0.0, delta[skin.vertex_slice])]
    before, after = ({tuple(pair) for pair in found[asked[found].any(axis=1)]} for found in pairs)
    return len(after - before)


def test_crossings_go_and_the_in_between_follows(face, targets):
    assert new_crossings(face, targets.deltas[1]) > 10
    parted = part_crossings(face, targets)
    left = left_share(face.template)[:, None]
    assert [new_crossings(face, share * parted.deltas[1]) for share in (1.0, left, 1.0 - left)] == [0, 0, 0]
    change = parted.deltas[1] - targets.deltas[1]
    assert np.abs(change).max() < 0.5
    half = parted.extras["mouthRollLower@0.5"] - targets.extras["mouthRollLower@0.5"]
    assert np.allclose(half, 0.5 * change)


def test_shapes_that_do_not_cross_are_left_alone(face, targets):
    parted = part_crossings(face, targets)
    assert np.array_equal(parted.deltas[0], targets.deltas[0])
    assert np.array_equal(parted.deltas[2], targets.deltas[2])


def test_pairs_are_made_of_sound_shapes(face, targets):
    seen = []
    part_crossings(face, targets, pairs=lambda sound: seen.append(sound) or sound)
    assert [new_crossings(face, delta) for delta in seen[0].deltas] == [0, 0, 0]


def test_both_sides_together_have_none(face):
    """Each side by itself leaves the lips apart in the middle, and the two add up to more."""
    lower = np.zeros(len(face.vertices), bool)
    lower[: len(face.regions["lip_lower"])] = face.regions["lip_lower"]
    line = face.vertices[face.lines["lip_seam_lower"]]
    near = np.exp(-(np.linalg.norm(face.vertices - line[len(line) // 2], axis=1) ** 2) / 20.0) * lower
    left = left_share(face.template)
    deltas = np.zeros((2, *face.vertices.shape))
    deltas[:, :, 1] = 0.25 * near * np.stack([left, 1.0 - left])
    targets = Targets(("mouthPressLeft", "mouthPressRight"), deltas)
    assert new_crossings(face, deltas.sum(axis=0)) > 10
    parted = part_crossings(face, targets)
    assert [new_crossings(face, delta) for delta in (*parted.deltas, parted.deltas.sum(axis=0))] == [0, 0, 0]
    change = np.abs(parted.deltas - deltas).max(axis=2)
    skin = face.template.vertices[:, 0]
    assert change[0, skin < -25.0].max() < 0.01 and change[1, skin > 25.0].max() < 0.01


def test_what_lies_on_another_shape_follows_its_correction(face, targets):
    """mouthClose undoes jawOpen: where this is corrected the two together go on as they were."""
    opened = targets.deltas[1]
    names, deltas = ("jawOpen", "mouthClose"), np.array([opened, -opened])
    parted = part_crossings(face, Targets(names, deltas))
    assert np.abs(parted.deltas[0] - opened).max() > 0.01
    assert np.abs(parted.deltas.sum(axis=0)).max() < 1e-12
