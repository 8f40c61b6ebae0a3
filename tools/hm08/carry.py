"""What every identity delta must respect, as linear maps of control deltas: eyes, lids, lips, origin, parts.

The control points of the template are hm08's own of skin, teeth and tongue, and one more for each eye (its centre).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.solve.quadratic import Factorization
from hm08.density import SEAM_RING
from hm08.neutral import EYE_RADIUS_MM, LID_GAP_MM
from hm08.spread import bilaplacian, spread

SEAM_WEIGHT = 1e4
NEAR_BALL_MM = 1.0  # margin points that stand off further than this follow the lids' own corner


class Carrier:
    """Makes raw control deltas of an identity fit the template: applied to many fields at once.

    control  Control; head  Head
    """

    def __init__(self, control, head):
        n = self.n_skin = control.n_skin
        self.control = control
        self.mirror = control.mirror[:n]
        V = control.vertices[:n]
        F = np.concatenate([control.quads[:, [0, 1, 2]], control.quads[:, [0, 2, 3]]])
        self.K = bilaplacian(V, F)
        self.center = head.eye_center
        self.margin = np.array(control.eye_left.rings[0])
        offset = head.V[[head.grid["eye_left"][(0, 4 * i)] for i in range(len(self.margin))]] - self.center
        distance = np.linalg.norm(offset, axis=1)
        self.normal = offset / distance[:, None]
        stands_off = distance - EYE_RADIUS_MM - LID_GAP_MM
        self.on_ball = np.exp(-((np.maximum(stands_off, 0.0) / NEAR_BALL_MM) ** 2))
        self.around_eye = np.linalg.norm(V - self.center, axis=1) < 26.0
        mouth = V[control.mouth.rings[SEAM_RING]].mean(axis=0)
        near = np.linalg.norm((V - mouth) * [0.8, 1.0, 1.0], axis=1) < 36.0
        self.around_mouth = np.flatnonzero(near)
        upper, lower = head.lines["lip_seam_upper"], head.lines["lip_seam_lower"]
        self.seam_difference = (head.S[upper[1:-1]] - head.S[lower[1:-1]]).tocsr()
        self.seam_local = self.seam_difference[:, self.around_mouth]
        stiffness = self.K[self.around_mouth][:, self.around_mouth]
        self.lips = Factorization(
            stiffness + SEAM_WEIGHT * (self.seam_local.T @ self.seam_local) + 1e-9 * sp.identity(near.sum())
        )

    def __call__(self, delta):
        """(c + 2, 3) control deltas (skin, teeth, tongue, eye_left, eye_right) of a raw (c, 3) one."""
        skin = self.close_lips(delta[: self.n_skin])
        eyes = []
        for side in (1, -1):
            flip = np.array([side, 1.0, 1.0])
            mine = skin if side > 0 else skin[self.mirror] * flip
            moved, corrected = self.carry_eye(mine)
            skin = corrected if side > 0 else corrected[self.mirror] * flip
            eyes.append(moved * flip)
        out = np.concatenate([skin, delta[self.n_skin :], eyes])
        return out - 0.5 * (eyes[0] + eyes[1])

    def carry_eye(self, skin):
        """(3,) how the left ball goes with its lids, and skin (n, 3) with the margin kept on the ball."""
        margin = skin[self.margin]
        moved = margin.mean(axis=0)
        moved[2] = 0.0
        w = self.on_ball * self.normal[:, 2]
        moved[2] = (w * ((margin - moved) * self.normal).sum(axis=1)).sum() / (w * self.normal[:, 2]).sum()
        radial = ((margin - moved) * self.normal).sum(axis=1) * self.on_ball
        correction = spread(self.K, self.margin, -radial[:, None] * self.normal, ~self.around_eye)
        return moved, skin + correction

    def close_lips(self, skin):
        """skin (n, 3) with paired points of the fine seam moved alike: least bending with a heavy penalty."""
        open_by = self.seam_difference @ skin
        out = skin.copy()
        out[self.around_mouth] -= self.lips.solve(SEAM_WEIGHT * (self.seam_local.T @ open_by))
        return out
