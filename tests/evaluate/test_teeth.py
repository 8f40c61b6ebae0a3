"""The mouth of the template itself, and the same with teeth and tongue put where they must not be."""

from dataclasses import replace

import pytest

from facewright.evaluate.teeth import SMILE, TONGUE, _Mouth, shut_poses
from facewright.parts import build_rig


@pytest.fixture(scope="module")
def rig(hm08, hm08_person):
    return build_rig(replace(hm08_person(1), vertices=hm08.vertices), hm08.deltas)


def test_a_smile_shows_six_teeth_and_closed_lips_none(rig):
    assert _Mouth(rig, SMILE, True).teeth_shown() >= 6
    assert _Mouth(rig, {}, True).teeth_shown() == 0


def test_shapes_that_keep_lips_shut_are_asked_for_a_slit_alone_and_in_pairs(rig):
    poses = shut_poses(rig)
    assert poses["mouthRollUpper + mouthRollLower"] == {"mouthRollUpper": 1.0, "mouthRollLower": 1.0}
    assert {"mouthPucker", "mouthFrown + mouthPress", "mouthShrugUpper + mouthShrugLower"} <= set(poses)
    assert not any("jawOpen" in weights or "mouthFunnel" in weights for weights in poses.values())


def test_nothing_is_seen_but_between_the_lips(rig):
    for weights in ({}, {"jawOpen": 1.0}, {"mouthLeft": 1.0}):
        assert _Mouth(rig, weights, True).through_skin_mm2() < 1.0


def test_the_tongue_comes_out_between_the_lips(rig):
    mouth = _Mouth(rig, TONGUE, True)
    assert mouth.tongue_out_mm() > 5.0 and mouth.tongue_in_flesh_mm() <= 0.5


def test_a_tooth_before_the_lips_is_seen_through_the_skin(rig):
    meshes = tuple(
        replace(mesh, vertices=mesh.vertices + [0.0, 6.0, 24.0]) if mesh.name == "teeth_upper" else mesh
        for mesh in rig.meshes
    )
    assert _Mouth(replace(rig, meshes=meshes), {}, True).through_skin_mm2() > 50.0


def test_a_tongue_in_the_chin_is_deep_in_flesh(rig):
    meshes = tuple(
        replace(mesh, vertices=mesh.vertices + [0.0, -14.0, 4.0]) if mesh.name == "tongue" else mesh
        for mesh in rig.meshes
    )
    assert _Mouth(replace(rig, meshes=meshes), {}, True).tongue_in_flesh_mm() > 2.0
