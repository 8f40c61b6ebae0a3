"""What the check of every shape says of the template's own, of a folded one, and of two that are no mirror images."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.blending import possible, random_blends
from facewright.evaluate.blends import SEED, random_mixes
from facewright.evaluate.eyes import margin_gap_mm
from facewright.evaluate.play import Player, both_sides
from facewright.evaluate.rows import Row, worst_rows
from facewright.evaluate.shapes import (
    EYE_OPENING_MM,
    amplitudes,
    crossings,
    measure_shapes,
    mirror_mm,
    shape_rows,
    stray_mm,
)
from facewright.parts import build_rig
from facewright.working_set import read_working_set


@pytest.fixture(scope="module")
def rig(hm08, hm08_person):
    """The template itself as a rig of five shapes that other tests do not change."""
    face = replace(hm08_person(0), vertices=hm08.vertices)
    return build_rig(face, hm08.deltas)


def with_delta(rig, name, delta):
    """The rig with another delta of one shape, and only that shape and jawOpen."""
    keep = [rig.target_names.index(one) for one in (name, "jawOpen")]
    deltas = rig.meshes[0].deltas[keep].copy()
    deltas[0] = delta
    skin = replace(rig.meshes[0], deltas=deltas)
    return replace(rig, meshes=(skin,), target_names=(name, "jawOpen"), halves={})


def test_a_face_turned_over_is_found(rig):
    skin = rig.meshes[0]
    nose = int(np.argmax(skin.vertices[:, 2] * rig.regions["face"]))
    delta = np.zeros_like(skin.vertices)
    delta[nose] = [8.0, 0.0, 0.0]
    figures = measure_shapes(with_delta(rig, "mouthPucker", delta))
    assert figures["mouthPucker"]["folded"] > 0 and figures["mouthPucker"]["torn"] > 0
    assert figures["mouthPucker"]["max_mm"] == pytest.approx(8.0)


def test_still_shapes_are_sound(rig):
    figures = measure_shapes(with_delta(rig, "mouthPucker", np.zeros_like(rig.meshes[0].vertices)))
    assert figures["mouthPucker"] == {"max_mm": 0.0, "folded": 0, "torn": 0, "self_intersections": 0}


def test_crossings_beyond_the_templates_own_are_missed(rig):
    skin = rig.meshes[0]
    delta = np.zeros_like(skin.vertices)
    upper = rig.regions["lip_upper"]
    delta[upper] = [0.0, -6.0, 0.0]  # through the lower lip
    crossed = with_delta(rig, "mouthPucker", delta)
    found = crossings(crossed)
    assert found["mouthPucker"] > 0 and found["jawOpen"] == 0

    def row(own):
        rows = shape_rows(crossed, own)
        return next(r for r in rows if (r.pose, r.figure) == ("mouthPucker", "new self-intersections"))

    assert row(found).met and not row({}).met and not row(None).has_bar


def test_motion_beyond_the_region_is_stray(rig):
    skin = rig.meshes[0]
    delta = np.zeros_like(skin.vertices)
    delta[skin.vertices[:, 1].argmax()] = [0.0, 2.0, 0.0]  # the crown of the head
    found = stray_mm(with_delta(rig, "browInnerUp", delta))
    assert found["browInnerUp"] == pytest.approx(2.0, rel=0.05)
    lid = np.zeros_like(skin.vertices)
    upper, lower = (skin.vertices[rig.lines[f"lid_{lid}_left"]] for lid in ("upper", "lower"))
    lid[rig.lines["lid_upper_left"]] = [0.0, -margin_gap_mm(upper, lower), 0.0]
    moved = with_delta(rig, "eyeBlinkLeft", lid)
    assert stray_mm(moved)["eyeBlinkLeft"] == 0.0
    assert amplitudes(moved)["eyeBlinkLeft"] == pytest.approx(EYE_OPENING_MM)  # all the way that the eye is open


def test_left_on_the_right_side_is_no_mirror_image(rig, hm08):
    mirror = hm08.mirror[: len(rig.meshes[0].vertices)]
    assert max(mirror_mm(rig, mirror).values()) < 0.01
    deltas = rig.meshes[0].deltas.copy()
    deltas[rig.target_names.index("mouthSmileLeft")] *= 1.5
    broken = replace(rig, meshes=(replace(rig.meshes[0], deltas=deltas), *rig.meshes[1:]))
    found = mirror_mm(broken, mirror)
    assert found["mouthSmileLeft"] > 1.0 and found["mouthSmileRight"] > 1.0 and found["eyeBlinkLeft"] < 0.01


def test_a_player_plays_halves_for_their_sum(rig):
    skin, full = rig.meshes[0], rig.full()
    pose = {"cheekPuff": 0.7, "jawOpen": 0.3}
    assert np.abs(Player(rig, True)(skin, pose) - Player(full, False)(full.meshes[0], pose)).max() < 1e-9
    assert both_sides({"mouthSmile": 0.5, "jawOpen": 1.0}, Player(full, True).names) == {
        "mouthSmileLeft": 0.5,
        "mouthSmileRight": 0.5,
        "jawOpen": 1.0,
    }


def test_random_poses_are_possible_and_repeat():
    words = read_working_set()
    poses = random_blends(words.expressions, words.visemes, 300, SEED)
    poses += random_mixes(list(words.words), 300)
    assert poses == random_blends(words.expressions, words.visemes, 300, SEED) + random_mixes(list(words.words), 300)
    for pose in poses:
        assert set(pose) <= set(words.words) and all(0.0 <= weight <= 1.0 for weight in pose.values())
        assert pose.get("mouthClose", 0.0) <= pose.get("jawOpen", 0.0)
        assert not {"eyeLookUpLeft", "eyeLookDownLeft"} <= set(pose)
    assert possible({"jawLeft": 0.4, "jawRight": 0.6}) == {"jawRight": 0.6}


def test_bars_and_the_worst_of_several_heads():
    good, bad = (Row("eyes", "blink", "gap", value, bar=(None, 0.3)) for value in (0.2, 0.5))
    missing = Row("eyes", "blink", "gap", None, bar=(None, 0.3))
    assert good.met and not bad.met and not missing.met and Row("eyes", "blink", "gap", 9.0).met
    low = Row("shapes", "smile", "mm", 10.0, bar=(13.0, 18.0))
    found = worst_rows({"a": [good, low], "b": [bad]})
    assert found == [(bad, "b", 1, 2), (low, "a", 0, 1)]
