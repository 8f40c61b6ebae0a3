"""What stays of hm08's own face units: made symmetric, masked to the muscles that make them, free of their noise."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from facewright.conventions import ARKIT_SHAPES, mirrored_name
from facewright.mesh.laplacian import lumped_mass
from facewright.solve.quadratic import Factorization
from hm08.regions import geodesic

# Full up to the first distance from lids or seam, none from the second on.
EYE_SUPPORT_MM = (30.0, 55.0)
BROW_SUPPORT_MM = (50.0, 72.0)
CHEEK_SUPPORT_MM = (52.0, 61.0)
MOUTH_SUPPORT_MM = (66.0, 92.0)
JAW_SUPPORT_MM = (100.0, 150.0)


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


class Masks:
    """(n,) weights in 0..1 of where each family of shapes may move the skin."""

    def __init__(self, head, regions):
        V, F = head.V, head.F
        inside = regions["mouth_interior"]
        margin = np.concatenate([head.lines["lid_upper_left"], head.lines["lid_lower_left"]])
        margins = np.concatenate([margin, head.mirror[margin]])
        seam = np.concatenate([head.lines["lip_seam_upper"], head.lines["lip_seam_lower"]])
        sockets = regions["socket_left"] | regions["socket_right"]
        still = np.append(np.flatnonzero(regions["skull"]), head.lines["neck_ring"])
        from_margin = geodesic(V, F, margin)
        # Behind the margin the socket follows for a few millimetres, then it rests on the orbit.
        socket = np.where(sockets, falloff(np.minimum(from_margin, from_margin[head.mirror]), (4.0, 14.0)), 1.0)
        rest = (1.0 - falloff(geodesic(V, F, still), (0.0, 25.0))) * socket
        from_lids, from_seam = (cKDTree(V[line]).query(V)[0] for line in (margins, seam))
        below_eyes = falloff(V[:, 1], (V[margin, 1].min() - 6.0, V[margin, 1].max()))
        self._families = {
            "eye": falloff(from_margin, EYE_SUPPORT_MM) * ~regions["socket_right"] * ~inside * rest,
            "brow": falloff(from_lids, BROW_SUPPORT_MM) * ~inside * rest,
            "cheekS": falloff(np.minimum(from_lids, from_seam), CHEEK_SUPPORT_MM) * rest,
            "mouth": falloff(from_seam, MOUTH_SUPPORT_MM) * below_eyes * rest,
            "jaw": falloff(from_seam, JAW_SUPPORT_MM) * below_eyes * rest,
        }
        self._families |= {"nose": self._families["cheekS"], "cheekP": self._families["mouth"]}
        self._families["tongue"] = self._families["jaw"]

    def of(self, name):
        """The mask of a shape; that of the eyes is for the left one."""
        return next(mask for start, mask in self._families.items() if name.startswith(start))


class Fairing:
    """Takes the short waves out of delta fields: least |u - d|^2 + |h^2 L u|^2 with a length h in mm."""

    def __init__(self, head, length_mm):
        self.mass = sp.diags(lumped_mass(head.V, head.F))
        self.system = Factorization((self.mass + length_mm**4 / 16 * head.K).tocsr())

    def __call__(self, delta):
        return self.system.solve(self.mass @ delta)
