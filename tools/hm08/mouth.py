"""The fold between lower lip and gum, deepened: hm08's mouth bag cuts through where the lower teeth stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

DROP_MM = 9.0
FROM_SEAM_MM = (4.0, 13.0)  # nothing moves near the lips' contact
BACK_Z = (-30.0, -8.0)
FLESH_MM = 4.5  # left between the fold and the chin's skin


def deepen_fold(head, regions):
    """Head with the lower half of its mouth bag lowered behind the lower lip, 4.5 mm off the outer skin."""
    V = head.V.copy()
    seam = V[np.concatenate([head.lines["lip_seam_upper"], head.lines["lip_seam_lower"]])]
    level = seam[:, 1].mean()
    below = regions["mouth_interior"] & (V[:, 1] < level + 1.0)
    distance = cKDTree(seam).query(V)[0]
    share = _step(distance, *FROM_SEAM_MM) * _step(V[:, 2], *BACK_Z) * _step(level - V[:, 1], -1.0, 3.0) * below
    outer = cKDTree(V[regions["outer"]])
    for _ in range(20):
        wanted = V - np.stack([0 * share, DROP_MM * share, 0 * share], axis=1)
        thin = (outer.query(wanted)[0] < np.minimum(FLESH_MM, outer.query(V)[0] - 0.5)) & (share > 0)
        if not thin.any():
            break
        share[thin] *= 0.8
    share = 0.5 * (share + share[head.mirror])
    drop = np.stack([0 * share, DROP_MM * share, 0 * share], axis=1)
    return replace(head, V=V - drop, V_open=head.V_open - drop)


def _step(value, low, high):
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)
