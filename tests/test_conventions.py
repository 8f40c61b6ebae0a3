"""Names of shapes and their sides."""

from facewright.conventions import ARKIT_SHAPES, mirrored_name, mouth_sides


def test_sides_of_the_mouth_are_found_where_both_are_there():
    sides = mouth_sides(ARKIT_SHAPES)
    assert ("mouthSmileLeft", "mouthSmileRight") in sides and len(sides) == 7
    assert all(mirrored_name(left) == right for left, right in sides)
    assert not mouth_sides(("mouthLeft", "mouthRight", "eyeBlinkLeft", "eyeBlinkRight", "mouthFrownLeft"))
