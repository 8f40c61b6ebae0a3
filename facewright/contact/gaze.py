"""Where eyes look: the eyeball's turn of each look shape, for any template."""

from __future__ import annotations

import numpy as np

GAZE_DEG = {"In": 30.0, "Out": 30.0, "Down": 30.0, "Up": 25.0}
"""Turn of the eyeball at weight 1 of eyeLookIn, Out, Down and Up."""


def look_shapes(side):
    """name -> direction of one side's look shapes; side "left" or "right"."""
    return {f"eyeLook{direction}{side.capitalize()}": direction for direction in GAZE_DEG}


def gaze_rotation(direction, side, weight=1.0):
    """(3, 3) turn of the eyeball of a side when it looks In, Out, Down or Up at a weight."""
    angle = np.radians(GAZE_DEG[direction]) * weight
    c, s = np.cos(angle), np.sin(angle)
    if direction in ("Up", "Down"):
        s = s if direction == "Down" else -s
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    outward = 1.0 if side == "left" else -1.0
    s = s * (outward if direction == "Out" else -outward)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
