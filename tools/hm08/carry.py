"""What every identity delta must respect, as linear maps of control deltas: eyes, lids, lips, origin, parts.

The control points of the template are hm08's own of skin, teeth and tongue, and one more for each eye (its centre).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.normals import normalized
from facewright.solve.quadratic import Factorization
from hm08.density import NEW_CORNER, SEAM_RING
from hm08.eyeball import height_above
from hm08.neutral import LID_GAP_MM, inside_faces
from hm08.spread import bilaplacian, spread

SEAM_WEIGHT = 1e4
CONTACT_RINGS = (0.7, 2.5)  # how many rings about the seam move as one: along the lips, and more at the corners
NOSE_RADIUS_MM = 22.0
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
        self.nostrils = carry_nostrils(control)
        self.center = head.eye_center
        self.margin = np.array(control.eye_left.rings[0])
        fine = head.V[[head.grid["eye_left"][(0, 4 * i)] for i in range(len(self.margin))]]
        self.normal = normalized(fine - self.center)
        stands_off = height_above(fine, self.center) - LID_GAP_MM
        self.on_ball = np.exp(-((np.maximum(stands_off, 0.0) / NEAR_BALL_MM) ** 2))
        self.around_eye = np.linalg.norm(V - self.center, axis=1) < 26.0
        mouth = V[control.mouth.rings[SEAM_RING]].mean(axis=0)
        near = np.linalg.norm((V - mouth) * [0.8, 1.0, 1.0], axis=1) < 36.0
        self.around_mouth = np.flatnonzero(near)
        self.seam_difference = contact_rows(head)
        self.seam_local = self.seam_difference[:, self.around_mouth]
        stiffness = self.K[self.around_mouth][:, self.around_mouth]
        self.lips = Factorization(
            stiffness + SEAM_WEIGHT * (self.seam_local.T @ self.seam_local) + 1e-9 * sp.identity(near.sum())
        )

    def __call__(self, delta):
        """(c + 2, 3) control deltas (skin, teeth, tongue, eye_left, eye_right) of a raw (c, 3) one."""
        skin = self.close_lips(self.nostrils @ delta[: self.n_skin])
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


def contact_rows(head):
    """(k, c_skin) operator: by how much vertices that lie face to face on the closed lips move apart, weighted.

    Full weight at the seam, less on the rings before and behind it; near the corners, where the lips lie together
    further out, on more of them.
    """
    corner = round(4 * NEW_CORNER)
    mouth = head.grid["mouth"]
    upper, lower, weight = [], [], []
    for (r, c), v in mouth.items():
        other = mouth.get((r, 2 * corner - c))
        if c >= corner or other is None:
            continue
        reach = CONTACT_RINGS[0] + CONTACT_RINGS[1] * np.exp(-(((corner - c) / 8.0) ** 2))
        w = np.exp(-(((r / 4 - SEAM_RING) / reach) ** 2))
        if w > 0.05:
            upper += [other, head.mirror[other]]
            lower += [v, head.mirror[v]]
            weight += [w, w]
    return (sp.diags(weight) @ (head.S[upper] - head.S[lower])).tocsr()


def carry_nostrils(control):
    """(c_skin, c_skin) operator that gives the insides of the nostrils the motion of the nose around them.

    The passages are deeper than hm08's pits, so the pits' own deltas do not fit them: a nose that shrinks would leave
    them standing through its side. Inside, a delta becomes the affine map fitted to the skin around the nostril, plus
    what the rim does beyond that, fading with depth.
    """
    n = control.n_skin
    V, mirror = control.vertices[:n], control.mirror[:n]
    rings = control.nostril_left.rings
    rim = np.array(rings[1])
    inside = nostril_inside(control)
    taken = np.zeros(n, bool)
    taken[inside] = taken[mirror[inside]] = True
    center = V[rim].mean(axis=0)
    distance = np.linalg.norm(V - center, axis=1)
    near = np.flatnonzero((distance < NOSE_RADIUS_MM) & ~taken & (V[:, 0] > -2.0) & (V[:, 2] > 10.0))
    w = np.exp(-((distance[near] / (0.6 * NOSE_RADIUS_MM)) ** 2))
    design = np.concatenate([V[near] - center, np.ones((len(near), 1))], axis=1)
    fit = np.linalg.solve(design.T @ (w[:, None] * design) + 1e-3 * np.eye(4), design.T * w)
    rows = np.zeros((len(inside), n))
    at = np.concatenate([V[inside] - center, np.ones((len(inside), 1))], axis=1)
    rows[:, near] = at @ fit
    depth = np.linalg.norm(V[inside][:, None] - V[rim][None], axis=2)
    share = np.exp(-((depth / 3.0) ** 2)) + 1e-12
    fade = np.exp(-((depth.min(axis=1) / 5.0) ** 2))
    share = share / share.sum(axis=1, keepdims=True) * fade[:, None]
    residual = np.zeros((len(rim), n))
    residual[np.arange(len(rim)), rim] = 1.0
    residual[:, near] -= np.concatenate([V[rim] - center, np.ones((len(rim), 1))], axis=1) @ fit
    rows += share @ residual
    return _both_sides(rows, inside, mirror)


def _both_sides(rows, inside, mirror):
    """The identity with rows (k, n) at the left inside vertices and their images at the right ones; components of x
    need no sign here: the operator acts on each component of a delta alike, and mirroring commutes with it."""
    n = len(mirror)
    keep = np.ones(n, bool)
    keep[inside] = keep[mirror[inside]] = False
    left = sp.csr_matrix(rows)
    right = sp.csr_matrix(rows[:, mirror])
    place = sp.csr_matrix((np.ones(len(inside)), (inside, np.arange(len(inside)))), shape=(n, len(inside)))
    place_right = sp.csr_matrix(
        (np.ones(len(inside)), (mirror[inside], np.arange(len(inside)))), shape=(n, len(inside))
    )
    return (sp.diags(keep.astype(float)) + place @ left + place_right @ right).tocsr()


def nostril_inside(control):
    """(k,) control vertices of the left nostril deeper than its rim."""
    rings = control.nostril_left.rings
    blind_end = set(control.quads[inside_faces(control)].ravel().tolist())
    return np.array(sorted(blind_end | set(rings[0]) | set(rings[-1]) | set(rings[-2])))
