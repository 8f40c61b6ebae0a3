"""Lids close on the ball, stay out of it along the way, and are mirror images."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.contact import EyeShapes, Targets, solve_eyes
from facewright.contact.gaze import gaze_rotation
from facewright.evaluate.eyes import margin_gap_mm, pressing_poses
from facewright.expand import expand_weights
from facewright.parts import fit_parts
from facewright.transfer import transfer_shapes
from facewright.transfer.eyeball import carried_eyeball


@pytest.fixture(scope="module")
def solved(hm08, hm08_person):
    """The template itself and a person, each with their eye shapes."""
    own = replace(hm08_person(0), vertices=hm08.vertices)
    person = fit_parts(hm08_person(4))
    return [(own, solve_eyes(own, hm08.deltas)), (person, solve_eyes(person, transfer_shapes(person)))]


def posed(face, eyes, weights):
    """(n, 3) the head under pose weights, played with in-betweens and correctives."""
    targets = dict(zip(face.template.shape_names, eyes.deltas)) | eyes.extras
    played = expand_weights(weights, eyes.in_betweens, eyes.correctives)
    return face.vertices + sum(weight * targets[name] for name, weight in played.items())


def outer_lid(face, side):
    near = np.linalg.norm(face.vertices - carried_eyeball(face.template, face.vertices, side).center, axis=1) < 20
    return np.flatnonzero(face.regions["eyes"] & near & ~face.regions[f"socket_{side}"])


@pytest.mark.parametrize("weight", [0.25, 0.5, 0.75, 1.0])
def test_a_blink_stays_out_of_the_ball(solved, weight):
    for face, eyes in solved:
        ball = carried_eyeball(face.template, face.vertices, "left")
        points = posed(face, eyes, {"eyeBlinkLeft": weight})[outer_lid(face, "left")]
        assert ball.gap(points).min() > -0.2


def test_a_blink_closes(solved):
    for face, eyes in solved:
        pose = posed(face, eyes, {"eyeBlinkLeft": 1.0})
        upper, lower = (pose[face.lines[f"lid_{lid}_left"]] for lid in ("upper", "lower"))
        assert margin_gap_mm(upper, lower) < 0.4


def test_eyeballs_turn_rigidly_by_the_stated_angles(solved):
    for face, eyes in solved:
        part = face.template.part("eye_left").vertex_slice
        center = carried_eyeball(face.template, face.vertices, "left").center
        for direction in ("In", "Out", "Down", "Up"):
            moved = posed(face, eyes, {f"eyeLook{direction}Left": 1.0})[part] - center
            turned = (face.vertices[part] - center) @ gaze_rotation(direction, "left").T
            assert np.abs(moved - turned).max() < 1e-9
            half = posed(face, eyes, {f"eyeLook{direction}Left": 0.25})[part] - center
            shrunk = np.linalg.norm(half, axis=1) / np.linalg.norm(moved, axis=1)
            assert shrunk.min() > 0.99


def test_lids_that_follow_the_gaze_leave_the_corners_where_they_are(solved):
    for face, eyes in solved:
        pose = posed(face, eyes, {"eyeLookDownLeft": 1.0})
        upper, lower = (face.lines[f"lid_{lid}_left"] for lid in ("upper", "lower"))
        near = np.linalg.norm(face.vertices - face.vertices[upper[-1]], axis=1) < 2.0
        moved = np.linalg.norm(pose - face.vertices, axis=1)
        assert moved[upper].max() > 2.0 and moved[near & np.isin(np.arange(len(near)), [*upper, *lower])].max() < 0.6
        at = face.vertices[upper[-1], 0] - np.linspace(2.0, 12.0, 20)
        heights = [np.interp(at, *pose[line][np.argsort(pose[line][:, 0]), :2].T) for line in (upper, lower)]
        assert (heights[0] > heights[1]).all()


def test_left_is_the_mirror_of_right(hm08, solved):
    _, eyes = solved[0]
    targets = dict(zip(hm08.shape_names, eyes.deltas)) | eyes.extras
    for name, delta in targets.items():
        if name.startswith("eye") and "Left" in name:
            other = targets[name.replace("Left", "Right")]
            assert np.abs(delta - other[hm08.mirror] * [-1, 1, 1]).max() < 0.01, name


def test_only_the_lids_move_and_the_ball_draws_back_as_one(hm08, solved):
    face, eyes = solved[0]
    blink, ball = eyes.deltas[hm08.shape_names.index("eyeBlinkLeft")], hm08.part("eye_left").vertex_slice
    assert (blink[ball] == blink[ball][0]).all() and not blink[ball][:, :2].any() and -1.0 < blink[ball][0, 2] <= 0.0
    moved = np.abs(blink).max(axis=1) > 1e-4
    moved[ball] = False
    margin = face.vertices[np.concatenate([face.lines["lid_upper_left"], face.lines["lid_lower_left"]])]
    distance = np.linalg.norm(face.vertices[moved][:, None] - margin[None], axis=2).min(axis=1)
    assert distance.max() < 30


def test_pairs_carry_shut_lids_as_one(solved):
    """Whatever else the eye does: near the closing line both lids go together, and do not come apart."""
    for face, eyes in solved:
        skin = face.template.skin.vertex_slice
        lines = [face.lines[f"lid_{lid}_left"] for lid in ("upper", "lower")]
        blink = posed(face, eyes, {"eyeBlinkLeft": 1.0})[skin]
        apart = margin_gap_mm(*(blink[line] for line in lines))
        for other in ("eyeSquintLeft", "cheekSquintLeft", "eyeWideLeft", "eyeLookDownLeft", "eyeLookUpLeft"):
            pose = posed(face, eyes, {"eyeBlinkLeft": 1.0, other: 1.0})[skin]
            assert margin_gap_mm(*(pose[line] for line in lines)) < apart + 0.1


def test_pairs_are_made_of_the_shapes_as_they_are(solved):
    """A blink that was mended since leaves its mark in the pair, though nothing else has changed."""
    face, eyes = solved[1]
    names = list(face.template.shape_names)
    mended = np.array(eyes.deltas)
    mended[names.index("eyeBlinkLeft"), face.lines["lid_upper_left"]] += [0.0, 0.0, 0.02]
    before, after = (
        EyeShapes(face).with_pairs(Targets(eyes.names, deltas, {}, {}, {})) for deltas in (eyes.deltas, mended)
    )
    pair = {"eyeBlinkLeft": 1.0, "eyeSquintLeft": 1.0}
    change = (after.motion(pair) - before.motion(pair))[face.lines["lid_upper_left"]]
    assert np.abs(np.median(change, axis=0) - [0.0, 0.0, 0.02]).max() < 0.01


@pytest.mark.parametrize("names", list(pressing_poses()))
def test_shapes_that_press_the_lid_to_the_ball_add_up_before_it(solved, names):
    for face, eyes in solved:
        rest = carried_eyeball(face.template, face.vertices, "left")
        down = "eyeLookDown" in pressing_poses()[names]
        ball = rest.turned(gaze_rotation("Down", "left")) if down else rest
        plain = dict(zip(face.template.shape_names, eyes.deltas))
        for weight in (0.5, 1.0):
            pose = face.vertices + sum(weight * plain[f"{name}Left"] for name in pressing_poses()[names])
            if weight == 1.0 or not down:
                assert ball.gap(pose[outer_lid(face, "left")]).min() > -0.05
