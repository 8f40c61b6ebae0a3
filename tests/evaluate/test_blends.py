"""Random poses of a rig: its figures, the quick depth of lids, and how much the shapes of an expression overlap."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.contact import solve_eyes
from facewright.evaluate.blends import blend_rows, measure_blends
from facewright.evaluate.expressions import expression_rows, overlaps
from facewright.evaluate.eyes import LidDepth
from facewright.evaluate.play import Player
from facewright.parts import build_rig


@pytest.fixture(scope="module")
def rig(hm08, hm08_person):
    face = replace(hm08_person(0), vertices=hm08.vertices)
    eyes = solve_eyes(face, hm08.deltas)
    return build_rig(face, eyes.deltas, eyes=eyes)


def test_lids_pushed_into_the_ball_are_as_deep_as_they_were_pushed(rig):
    depth, play, skin = LidDepth(rig, "left"), Player(rig, True), rig.meshes[0]
    assert depth(play, skin.vertices, {}) < 0.05
    inwards = depth.center - skin.vertices[depth.lid]
    inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
    pushed = np.array(skin.vertices)
    pushed[depth.lid] += 1.5 * inwards
    assert 1.0 < depth(play, pushed, {}) < 1.6


def test_figures_of_known_poses(rig):
    poses = [{}, {"eyeBlinkLeft": 0.5, "eyeBlinkRight": 0.5}]
    found = measure_blends(rig, poses, lips=lambda skin: 0.25)
    assert found["lids_mm"].shape == found["folded"].shape == (2, 2)
    assert found["lids_mm"][1, 0] < 0.2 < found["lids_mm"][1, 1]  # the in-between keeps lids out of the ball
    assert (found["lips_mm"] == 0.25).all() and (found["folded"][0] == 0).all()


def test_rows_of_blends_have_bars_and_those_of_mixes_none(rig):
    rows = blend_rows(rig, 6, lips=lambda skin: 0.0)
    assert {row.pose for row in rows} == {"6 blends of expressions", "1 mixes of 8 shapes"}
    assert all(not row.has_bar for row in rows if "mixes" in row.pose)
    assert sum(row.has_bar for row in rows) == 3


def test_overlap_is_0_for_eyes_and_mouth_and_1_for_a_shape_with_itself(rig):
    skin = rig.meshes[0]
    named = {"apart": {"eyeBlinkLeft": 1.0, "mouthPucker": 1.0}, "alone": {"jawOpen": 1.0}}
    found = overlaps(replace(rig, expressions=named))
    assert found["apart"][0] < 0.05 and found["alone"] == (0.0, "", "")
    at = [rig.target_names.index(name) for name in ("jawOpen", "mouthPucker")]
    deltas = skin.deltas.copy()
    deltas[at[1]] = 0.5 * deltas[at[0]]
    twin = replace(rig, meshes=(replace(skin, deltas=deltas),), expressions={"same": {"jawOpen": 1, "mouthPucker": 1}})
    assert overlaps(twin)["same"][0] == pytest.approx(1.0)
    assert expression_rows(rig)[0].full == 0 and expression_rows(twin)[0].full == 50
