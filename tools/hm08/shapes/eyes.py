"""The eyes in the template's own shapes: a blink that just closes, balls that turn about their centres.

On each head lids are made anew by rule (facewright.contact); these are what that rule starts from.
"""

from __future__ import annotations

import numpy as np

from hm08.eyeball import at_height, height_above
from hm08.neutral import LID_GAP_MM
from hm08.spread import bilaplacian, spread

EYE_TURNS_DEG = {"Out": 30.0, "In": 30.0, "Down": 30.0, "Up": 25.0}


def just_closing(head, delta):
    """The blink scaled so that the upper margin meets the lower one, and kept outside the ball along its way."""
    V, upper, lower = head.V, head.lines["lid_upper_left"], head.lines["lid_lower_left"]
    low, high = 0.4, 1.2
    for _ in range(30):
        scale = 0.5 * (low + high)
        low, high = (scale, high) if lid_opening(V + scale * delta, upper, lower) > 0.0 else (low, scale)
    delta = delta * scale
    return delta + outside_ball(head, V + delta)


def lid_opening(V, upper, lower):
    """mm by which the upper margin stands above the lower one where it stands highest, corners left out."""
    x = np.linspace(*np.quantile(V[upper, 0], [0.12, 0.88]), 40)
    order_u, order_l = np.argsort(V[upper, 0]), np.argsort(V[lower, 0])
    top = np.interp(x, V[upper, 0][order_u], V[upper, 1][order_u])
    bottom = np.interp(x, V[lower, 0][order_l], V[lower, 1][order_l])
    return (top - bottom).max()


def outside_ball(head, V):
    """(n, 3) what lifts the lids of V off the left ball, spread over their neighbourhood."""
    near = np.linalg.norm(head.V - head.eye_center, axis=1) < 30
    deep = near & (height_above(V, head.eye_center) < LID_GAP_MM) & (V[:, 2] > head.eye_center[2])
    if not deep.any():
        return np.zeros_like(V)
    handles = np.flatnonzero(deep)
    values = at_height(V[handles], head.eye_center, LID_GAP_MM) - V[handles]
    return spread(bilaplacian(head.V, head.F), handles, values, ~near)


def eye_turn(name, vertices, center):
    """(k, 3) displacement of a ball's vertices when it looks where an eyeLook shape says, at weight 1."""
    direction = name.removeprefix("eyeLook").removesuffix("Left").removesuffix("Right")
    angle = np.radians(EYE_TURNS_DEG[direction])
    side = 1.0 if name.endswith("Left") else -1.0
    c, s = np.cos(angle), np.sin(angle)
    if direction in ("Up", "Down"):
        s = s if direction == "Down" else -s
        R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    else:
        s = s * side if direction == "Out" else -s * side
        R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    local = vertices - center
    return local @ R.T - local
