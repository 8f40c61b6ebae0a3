"""The jaw: how it turns, and lips that stay closed when it is open."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.polyline import arc_lengths
from hm08.regions import geodesic
from hm08.shapes.fair import falloff
from hm08.skeleton import hinge_of
from hm08.spread import spread

LIPS_MM = 9.0  # skin so near to the seam stays as it is in mouthClose with jawOpen
FADE_MM = 30.0
# hm08's lower lip goes down in straight lines from the corners to the middle, a V; of the motion beyond the corners' a
# lip has (1 - (1 - q)^2)^ROUND at the share q of the way to the middle. A V has q.
ROUND = 0.85
LIP_MM, ROUND_FADE_MM = 7.0, 24.0
SHARE = 0.25  # of the jaw's turn by which closed lips go down with it


def rounded(head, jaw_open):
    """(n, 3) jawOpen with a lower lip that hangs in a round arc; the upper lip stays, the skin around follows."""
    V, lower, upper = head.V, head.lines["lip_seam_lower"], head.lines["lip_seam_upper"]
    way = arc_lengths(V[lower])
    q = 1.0 - np.abs(2.0 * way / way[-1] - 1.0)
    corners = 0.5 * (jaw_open[lower[0]] + jaw_open[lower[-1]])
    middle = jaw_open[lower[np.argmax(q)]] - corners
    now = (jaw_open[lower] - corners) @ middle / (middle @ middle)
    more = (1.0 - (1.0 - q) ** 2) ** ROUND - now
    more *= 1.0 - falloff(q, (0.0, 0.05))
    below = geodesic(V, head.F, lower)
    lip = np.flatnonzero((below < LIP_MM) & (below < geodesic(V, head.F, upper) - 1e-9))
    nearest = cKDTree(V[lower]).query(V[lip])[1]
    handles = np.concatenate([lip, upper])
    values = np.concatenate([more[nearest, None] * middle, np.zeros((len(upper), 3))])
    return jaw_open + spread(head.K, handles, values, below > ROUND_FADE_MM)


def closing(head, jaw_open, R, t):
    """(n, 3) mouthClose: what, added to jawOpen (n, 3), makes the lips a rigid copy of the neutral's.

    The lips turn about the jaw's hinge by a share of its turn (R, t); the skin around follows smoothly.
    """
    V = head.V
    seam = np.concatenate([head.lines["lip_seam_upper"], head.lines["lip_seam_lower"]])
    distance = geodesic(V, head.F, seam)
    handles = np.flatnonzero(distance < LIPS_MM)
    angle = SHARE * np.arctan2(R[2, 1], R[1, 1])
    c, s = np.cos(angle), np.sin(angle)
    part = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    hinge = hinge_of(R, t)
    closed = (V[handles] - hinge) @ part.T + hinge
    return spread(head.K, handles, closed - V[handles] - jaw_open[handles], distance > FADE_MM)


def rigid_motion(points, moved):
    """R (3, 3), t (3,) with moved ~ points @ R.T + t, least squares (Kabsch)."""
    a, b = points.mean(axis=0), moved.mean(axis=0)
    U, _, Vt = np.linalg.svd((points - a).T @ (moved - b))
    D = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    R = Vt.T @ D @ U.T
    return R, b - R @ a
