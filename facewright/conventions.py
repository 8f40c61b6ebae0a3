"""Axes, units, colour and names: the one place where Facewright's conventions are written as code.

Millimetres, right-handed, +Y up, +Z out of the face, +X the person's left, origin midway between the eyes. Float64.
UV: u to the right, v up (OBJ); row 0 of an image is v = 1. Albedo arrays are uint8 sRGB, data maps are linear,
normal maps are +Y (OpenGL).
"""

ARKIT_SHAPES = tuple(
    """eyeBlinkLeft eyeLookDownLeft eyeLookInLeft eyeLookOutLeft eyeLookUpLeft eyeSquintLeft eyeWideLeft
    eyeBlinkRight eyeLookDownRight eyeLookInRight eyeLookOutRight eyeLookUpRight eyeSquintRight eyeWideRight
    jawForward jawLeft jawRight jawOpen mouthClose mouthFunnel mouthPucker mouthLeft mouthRight
    mouthSmileLeft mouthSmileRight mouthFrownLeft mouthFrownRight mouthDimpleLeft mouthDimpleRight
    mouthStretchLeft mouthStretchRight mouthRollLower mouthRollUpper mouthShrugLower mouthShrugUpper
    mouthPressLeft mouthPressRight mouthLowerDownLeft mouthLowerDownRight mouthUpperUpLeft mouthUpperUpRight
    browDownLeft browDownRight browInnerUp browOuterUpLeft browOuterUpRight
    cheekPuff cheekSquintLeft cheekSquintRight noseSneerLeft noseSneerRight tongueOut""".split()
)

EYE_PAIRS = (("eyeBlink", "eyeLookDown"), ("eyeBlink", "eyeSquint"), ("eyeLookIn", "eyeLookUp"))
SMILING_EYES = ("eyeSquint", "cheekSquint")
MOUTH_PAIRS = (
    ("mouthSmile", "jawOpen"),
    ("mouthSmile", "mouthFunnel"),
    ("mouthFunnel", "mouthPucker"),
    ("mouthFrown", "mouthPress"),
    ("mouthRollUpper", "mouthRollLower"),
    ("mouthShrugUpper", "mouthShrugLower"),
)
"""Pairs of shapes that lids and lips must survive together; a name without its side stands for both sides."""

TONGUE_PAIR = ("tongueOut", "jawOpen")
"""A tongue that comes out of an open mouth; by itself it opens the mouth as far as it needs."""

SHUT_SHAPES = tuple(
    """jawForward jawLeft jawRight mouthPucker mouthLeft mouthRight mouthSmile mouthFrown mouthDimple mouthStretch
    mouthRollLower mouthRollUpper mouthShrugLower mouthPress cheekPuff""".split()
)
"""Shapes, without their sides, under which lips that are shut stay shut, alone and two together."""

SHUT_PAIRS = (("mouthShrugUpper", "mouthShrugLower"),)
"""Pairs under which they do so too, though one of the two opens them."""

INTERPUPILLARY_MM = 63.0
"""Mean adult distance between the pupils: the scale of a scan that states none, and of every benchmark figure."""

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1000.0, "inch": 25.4}


def mirrored_name(shape):
    """The shape's name on the other side of the face: mouthSmileLeft -> mouthSmileRight, jawOpen -> jawOpen."""
    if shape.endswith("Left"):
        return shape[:-4] + "Right"
    if shape.endswith("Right"):
        return shape[:-5] + "Left"
    return shape


def mouth_sides(names):
    """(left, right) names of the shapes that move one side of the mouth each, of those in names; no mouthLeft, which
    moves all of it."""
    lefts = [name for name in names if name.startswith("mouth") and name.endswith("Left") and name != "mouthLeft"]
    return [(name, mirrored_name(name)) for name in lefts if mirrored_name(name) in names]


CORRECTIVE_JOIN = "+"


def in_between_name(name, weight):
    """Name of the target that a shape passes at a weight between 0 and 1: "eyeBlinkLeft@0.5"."""
    return f"{name}@{weight:g}"


def corrective_name(drivers):
    """Name of the target that is added where all drivers act: "eyeBlinkLeft+eyeSquintLeft"."""
    return CORRECTIVE_JOIN.join(drivers)
