"""What rides on the lids stays on its root, turns with the lid and keeps to the eyeball."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.contact.gaze import gaze_rotation
from facewright.parts import fit_parts
from facewright.transfer.eyeball import carried_eyeball, eye_parts, measure_eyeball
from facewright.transfer.riders import LidRiders, lid_parts, ride_on_lids


@pytest.fixture(scope="module")
def riders(hm08):
    return LidRiders(hm08, "left")


@pytest.fixture(scope="module")
def itself(hm08, hm08_person):
    return replace(hm08_person(1), vertices=hm08.vertices)


def turned(hm08, degrees):
    """The whole head turned about the left eye's centre."""
    center = measure_eyeball(hm08, "left").center
    angle = np.radians(degrees)
    R = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    return (hm08.vertices - center) @ R.T + center, R


def test_at_rest_they_are_where_the_template_has_them(hm08, riders):
    placed = riders.placed(hm08.vertices, measure_eyeball(hm08, "left"))
    np.testing.assert_allclose(placed, hm08.vertices[riders.index], atol=1e-9)


def test_they_turn_with_the_lids(hm08, riders):
    ball = measure_eyeball(hm08, "left")
    vertices, R = turned(hm08, 25.0)
    placed = riders.placed(vertices, ball.turned(R))
    np.testing.assert_allclose(placed, vertices[riders.index], atol=1e-6)


def test_left_mirrors_right(hm08, itself):
    k = hm08.shape_names.index("eyeWideLeft")
    twin = hm08.shape_names.index("eyeWideRight")
    deltas = ride_on_lids(itself, hm08.deltas[[k, twin]], ("eyeWideLeft", "eyeWideRight"))
    left, right = (hm08.part(f"lashes_{side}").vertex_slice for side in ("left", "right"))
    np.testing.assert_allclose(deltas[0, left] * [-1, 1, 1], deltas[1, right], atol=2e-3)


def test_strips_keep_off_a_cornea_that_turns(hm08, itself):
    ball = measure_eyeball(hm08, "left")
    R = gaze_rotation("Up", "left")
    deltas = np.zeros((1, *hm08.vertices.shape))
    eye = np.concatenate([np.arange(*part.vertices) for part in eye_parts(hm08, "left")])
    deltas[0, eye] = (hm08.vertices[eye] - ball.center) @ (R - np.eye(3)).T
    moved = hm08.vertices + ride_on_lids(itself, deltas, ("eyeLookUpLeft",))[0]
    strip = hm08.part("occlusion_left").vertex_slice
    assert ball.turned(R).gap(moved[strip]).min() > 0.04


def test_a_corrective_takes_what_its_drivers_left(hm08, itself):
    names = ("eyeBlinkLeft", "eyeSquintLeft", "both")
    pair = hm08.deltas[[hm08.shape_names.index(name) for name in names[:2]]]
    deltas = np.concatenate([pair, np.zeros((1, *hm08.vertices.shape))])
    found = ride_on_lids(itself, deltas, names, {"both": names[:2]})
    index = LidRiders(hm08, "left").index
    together = ride_on_lids(itself, deltas[:1] + deltas[1:2], ("sum",))[0, index]
    np.testing.assert_allclose(found[:, index].sum(axis=0), together, atol=1e-9)


def test_on_a_person_lashes_stand_on_the_skin(hm08, hm08_person):
    face = fit_parts(hm08_person(3))
    riders = LidRiders(hm08, "left")
    ball = carried_eyeball(hm08, face.vertices, "left")
    np.testing.assert_allclose(face.vertices[riders.index], riders.placed(face.vertices, ball), atol=1e-9)
    lids = [part.name for part in lid_parts(hm08, "left")]
    assert {"lashes_left", "caruncle_left", "lacrimal_left", "occlusion_left", "blend_left"} == set(lids)


def test_what_lies_between_lids_and_eyeball_goes_back_with_it(hm08, riders):
    ball = measure_eyeball(hm08, "left")
    back = replace(ball, center=ball.center - [0.0, 0.0, 3.0])
    before, after = (riders.placed(hm08.vertices, each) for each in (ball, back))
    lashes = np.isin(riders.index, np.concatenate([np.arange(*p.vertices) for p in hm08.parts if "lashes" in p.name]))
    between = ~lashes & (np.linalg.norm(after - before, axis=1) > 1.0)
    assert between.sum() > 10
    assert (back.gap(after) <= ball.gap(before) + 1e-6)[between].all()
    assert (back.gap(after) > ball.gap(before) + 1.0)[lashes].all()
