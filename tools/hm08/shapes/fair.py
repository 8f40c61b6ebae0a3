"""What stays of hm08's own face units: made symmetric, masked to the muscles that make them, free of their noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from facewright.conventions import ARKIT_SHAPES, mirrored_name
from facewright.mesh.laplacian import lumped_mass
from facewright.solve.quadratic import Factorization
from hm08.regions import geodesic

FAIR_MM = 5.0  # waves of a delta shorter than about this are taken for noise
FAIR_NEAR_MM = 2.5  # the same at lids and seam, over so many times its length from them
EYE_SUPPORT_MM = (30.0, 55.0)
BROW_SUPPORT_MM = (60.0, 95.0)


@dataclass(frozen=True)
class Masks:
    """(n,) weights in 0..1 of where each family of shapes may move the skin (left side for sided ones)."""

    eye_left: np.ndarray
    brow: np.ndarray
    mouth: np.ndarray

    def of(self, name):
        """eye_left for lids, brow for brows, mouth for all the rest."""
        if name.startswith("eye"):
            return self.eye_left
        return self.brow if name.startswith("brow") else self.mouth


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


class Fairing:
    """Takes the short waves out of delta fields: least |u - d|^2 + |h^2 L u|^2.

    The length h shrinks towards lids and seam, whose own lines are meant.
    """

    def __init__(self, head):
        V, F = head.V, head.F
        lines = [line for name, line in head.lines.items() if name.startswith(("lid_", "lip_seam"))]
        near = geodesic(V, F, np.concatenate(lines))
        length = FAIR_NEAR_MM + (FAIR_MM - FAIR_NEAR_MM) * np.clip(near / (3 * FAIR_MM), 0.0, 1.0)
        scale = sp.diags(length**2 / 4)
        self.mass = sp.diags(lumped_mass(V, F))
        self.system = Factorization((self.mass + scale @ head.K @ scale).tocsr())

    def __call__(self, delta):
        return self.system.solve(self.mass @ delta)
