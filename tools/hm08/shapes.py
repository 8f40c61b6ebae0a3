"""The 52 ARKit shapes of the template from hm08's face units: symmetric, masked, free of quantisation noise.

Clean raw material: amplitudes and characters are the artist's own, except that a blink just closes, eyeballs turn
about their centres, and lower teeth and tongue ride a rigid jaw.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from facewright.conventions import ARKIT_SHAPES, mirrored_name
from facewright.mesh.laplacian import lumped_mass
from facewright.solve.quadratic import Factorization
from hm08.carry import carry_nostrils
from hm08.eyeball import at_height, height_above
from hm08.neutral import LID_GAP_MM
from hm08.regions import geodesic
from hm08.spread import bilaplacian, spread

EYE_TURNS_DEG = {"Out": 30.0, "In": 30.0, "Down": 30.0, "Up": 25.0}
FAIR_MM = 2.5  # features of a delta shorter than about this are taken for noise
EYE_SUPPORT_MM = (30.0, 55.0)
BROW_SUPPORT_MM = (60.0, 95.0)


@dataclass(frozen=True)
class Masks:
    """(n,) weights in 0..1 of where each family of shapes may move the skin (left side for sided ones)."""

    eye_left: np.ndarray
    brow: np.ndarray
    mouth: np.ndarray


def symmetrised(raw, mirror):
    """(s, c, 3) raw deltas made exact mirror images: Left of Right, central ones of themselves."""
    out = np.empty_like(raw)
    for i, name in enumerate(ARKIT_SHAPES):
        other = raw[ARKIT_SHAPES.index(mirrored_name(name))]
        out[i] = 0.5 * (raw[i] + other[mirror] * [-1, 1, 1])
    return out


def falloff(distance, support):
    """1 up to support[0], 0 from support[1] on, smooth between."""
    t = np.clip((distance - support[0]) / (support[1] - support[0]), 0.0, 1.0)
    return 1.0 - t * t * (3 - 2 * t)


def build_masks(head, regions):
    V, F = head.V, head.F
    inside = regions["mouth_interior"]
    sockets = regions["socket_left"] | regions["socket_right"]
    skull = geodesic(V, F, np.flatnonzero(regions["skull"]))
    off_skull = 1.0 - falloff(skull, (0.0, 25.0))
    margin = np.concatenate([head.lines["lid_upper_left"], head.lines["lid_lower_left"]])
    from_margin = geodesic(V, F, margin)
    from_margins = np.minimum(from_margin, from_margin[head.mirror])
    # Behind the margin the socket follows for a few millimetres, then it rests on the orbit.
    socket = np.where(sockets, falloff(from_margins, (4.0, 14.0)), 1.0)
    near_eye = falloff(from_margin, EYE_SUPPORT_MM) * ~regions["socket_right"] * ~inside * off_skull * socket
    brow = falloff(from_margins, BROW_SUPPORT_MM) * ~inside * off_skull * socket
    return Masks(near_eye, brow, off_skull * socket)


def family(name):
    """Which Masks field a shape takes: "eye_left" for lids, "brow", or "mouth" for all the rest."""
    if name.startswith("eye"):
        return "eye_left"
    return "brow" if name.startswith("brow") else "mouth"


class Fairing:
    """Takes the short waves out of delta fields: (M + FAIR^4 K) u = M d, seam and lid lines keeping their own."""

    def __init__(self, head):
        self.mass = sp.diags(lumped_mass(head.V, head.F))
        self.system = Factorization((self.mass + FAIR_MM**4 / 16 * head.K).tocsr())

    def __call__(self, delta):
        return self.system.solve(self.mass @ delta)


def build_shapes(raw, control, head, regions):
    """(52, n, 3) deltas of the skin from raw (52, c_skin, 3) control deltas."""
    masks = build_masks(head, regions)
    fair = Fairing(head)
    nostrils = carry_nostrils(control)
    out = np.zeros((len(ARKIT_SHAPES), len(head.V), 3))
    for i, (name, delta) in enumerate(zip(ARKIT_SHAPES, symmetrised(raw, control.mirror[: control.n_skin]))):
        if name.endswith("Right"):
            continue
        mask = getattr(masks, family(name))
        fine = fair(head.S @ (nostrils @ delta)) * mask[:, None]
        if name == "eyeBlinkLeft":
            fine = just_closing(head, fine)
        out[i] = fine
    out[np.abs(out).max(axis=2) < 0.005] = 0.0
    for i, name in enumerate(ARKIT_SHAPES):
        j = ARKIT_SHAPES.index(mirrored_name(name))
        if i == j:
            out[i] = 0.5 * (out[i] + out[i][head.mirror] * [-1, 1, 1])
        elif name.endswith("Right"):
            out[i] = out[j][head.mirror] * [-1, 1, 1]
    return out


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


def rigid_motion(points, moved):
    """R (3, 3), t (3,) with moved ~ points @ R.T + t, least squares (Kabsch)."""
    a, b = points.mean(axis=0), moved.mean(axis=0)
    U, _, Vt = np.linalg.svd((points - a).T @ (moved - b))
    D = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    R = Vt.T @ D @ U.T
    return R, b - R @ a
