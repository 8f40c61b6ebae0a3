"""The jaw: how it turns, and lips that stay closed when it is open."""

from __future__ import annotations

import numpy as np

from hm08.regions import geodesic
from hm08.skeleton import hinge_of
from hm08.spread import spread

LIPS_MM = 9.0  # skin so near to the seam stays as it is in mouthClose with jawOpen
FADE_MM = 30.0
SHARE = 0.25  # of the jaw's turn by which closed lips go down with it


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
