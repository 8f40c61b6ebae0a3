"""Close-ups show every shape once, both sides together, and the pairs; only what can be seen is drawn."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.conventions import ARKIT_SHAPES
from facewright.evaluate.play import Player
from facewright.parts import build_rig
from facewright.write.close_ups import close_up_cameras, close_up_poses, close_up_sections, posed_rig
from facewright.write.sheet import Cell


@pytest.fixture(scope="module")
def rig(hm08, hm08_person):
    return build_rig(replace(hm08_person(0), vertices=hm08.vertices), hm08.deltas)


def test_every_shape_is_in_one_picture(rig):
    poses = close_up_poses(rig)
    shown = [name for found in poses for label, weights in found.items() if "+" not in label for name in weights]
    assert set(shown) == set(ARKIT_SHAPES)
    assert "eyeBlink" in poses[0] and "noseSneer" in poses[1] and "jawLeft" in poses[2] and "mouthSmile" in poses[2]
    assert poses[2]["mouthSmile + jawOpen"] == {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0, "jawOpen": 1.0}
    assert poses[2]["mouthClose"] == {"mouthClose": 1.0, "jawOpen": 1.0}


def test_sections_hold_half_and_whole(rig):
    sections = close_up_sections(rig, lambda posed: [], lambda scene, camera: None, captions_only)
    captions = [cell.caption for section in sections for row in section.rows for cell in row]
    assert len(sections) == 3 and "jawOpen, 0.5" in captions and "jawOpen" in captions
    assert len(captions) == 2 * sum(len(found) for found in close_up_poses(rig))


def captions_only(cell, jobs):
    """A map that draws nothing."""
    pixel = np.zeros((4, 4, 3), np.uint8)
    return [Cell(pixel, label if share == 1.0 else f"{label}, {share:g}") for label, _, share in jobs]


def test_only_what_comes_into_the_picture_is_kept(rig):
    camera = close_up_cameras(rig)[0]
    posed = posed_rig(rig, Player(rig, True), {"eyeBlinkLeft": 1.0}, camera)
    assert len(posed.meshes[0].faces) < 0.6 * len(rig.meshes[0].faces)
    lid = rig.lines["lid_upper_left"]
    moved = np.linalg.norm(posed.meshes[0].vertices[lid] - rig.meshes[0].vertices[lid], axis=1)
    assert moved.max() > 5.0 and all(mesh.deltas is None for mesh in posed.meshes)
