"""Close-ups show every shape once, both sides together, and the pairs; only what can be seen is drawn."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.conventions import ARKIT_SHAPES
from facewright.parts import build_rig
from facewright.write.close_ups import close_up_poses, close_up_sections


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


class Blank:
    """A puppet that draws nothing."""

    def picture(self, weights, camera):
        return np.zeros((4, 4, 3), np.uint8)


def test_sections_hold_half_and_whole(rig):
    sections = close_up_sections(rig, Blank())
    captions = [cell.caption for section in sections for row in section.rows for cell in row]
    assert len(sections) == 3 and "jawOpen, 0.5" in captions and "jawOpen" in captions
    assert len(captions) == 2 * sum(len(found) for found in close_up_poses(rig))
    assert not any("in-between" in section.note for section in sections)


def test_what_the_plain_shapes_lack_is_said(rig):
    played = replace(rig, in_betweens={"jawOpen": {0.5: "jawLeft"}})
    assert all("in-between" in section.note for section in close_up_sections(played, Blank()))
