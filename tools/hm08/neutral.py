"""From the smooth adult mean to the template's neutral: real eyeballs, refitted lids, closed lips."""

from __future__ import annotations

import numpy as np

from hm08.control import EYE_SHIFT_MM
from hm08.density import NEW_CORNER, SEAM_RING
from hm08.spread import bilaplacian, spread

EYE_RADIUS_MM = 12.0
LID_GAP_MM = 0.15
LIP_GAP_MM = 0.1
NOSTRIL_DEPTH_MM = {0: 1.5, -1: 5.0, -2: 9.0}  # by ring of the nostril's grid; the blind end 11
NOSTRIL_END_MM = 11.0


def deepen_nostrils(control):
    """(c, 3) control vertices with the nostril pits pushed up and back into passages that narrow a little."""
    V = control.vertices.copy()
    rings = control.nostril_left.rings
    inside = set(control.quads[_inside_faces(control)].ravel().tolist()) - set(rings[-2])
    direction = np.array([-0.12, 0.88, -0.46])
    direction /= np.linalg.norm(direction)
    for k, depth in [*NOSTRIL_DEPTH_MM.items(), (None, NOSTRIL_END_MM)]:
        ring = np.array(sorted(inside) if k is None else rings[k])
        center = V[ring].mean(axis=0)
        narrow = 1.0 - 0.018 * depth
        moved = center + (V[ring] - center) * narrow + direction * depth
        V[ring] = moved
        V[control.mirror[ring]] = moved * [-1, 1, 1]
    return V


def _inside_faces(control):
    from hm08.topology import QuadTopology

    topology = QuadTopology(control.quads)
    ring = [int(v) for v in control.nostril_left.rings[-2]]
    return ~topology.side_of_loop(ring, int(control.nostril_left.rings[2][0]))


def symmetric(V, mirror):
    """(n, 3) positions averaged with their mirror image."""
    return 0.5 * (V + V[mirror] * [-1, 1, 1])


def place_eye(margin, center):
    """(3,) centre of a 12 mm ball behind the lid margin (k, 3): as deep as a median gap of 0.15 mm wants.

    Sideways and up it stays where the head's own eyeball was, 1 mm further out.
    """
    start = np.array([center[0] + EYE_SHIFT_MM, center[1], center[2]])
    low, high = start[2] - 15, start[2] + 15
    for _ in range(60):
        z = 0.5 * (low + high)
        gap = np.median(np.linalg.norm(margin - [start[0], start[1], z], axis=1)) - EYE_RADIUS_MM
        low, high = (z, high) if gap > LID_GAP_MM else (low, z)
    return np.array([start[0], start[1], z])


def refit_lids(V, F, margin, center, K=None):
    """V (n, 3) with the left lid margin (k,) drawn to the ball; corners that stand off stay off, softly."""
    K = bilaplacian(V, F) if K is None else K
    offset = V[margin] - center
    distance = np.linalg.norm(offset, axis=1)
    wish = EYE_RADIUS_MM + LID_GAP_MM
    excess = distance - wish
    pull = np.where(excess > 1.2, 1.2 + 0.0 * excess, excess)
    values = -(offset / distance[:, None]) * pull[:, None]
    far = np.linalg.norm(V - center, axis=1) > 30.0
    return V + spread(K, margin, values, far)


def close_lips(V, F, seam_upper, seam_lower, K=None):
    """V (n, 3) with paired seam points 0.1 mm apart, each side half the way; the inner mouth is carried along."""
    K = bilaplacian(V, F) if K is None else K
    upper, lower = seam_upper[1:-1], seam_lower[1:-1]
    middle = 0.5 * (V[upper] + V[lower])
    half = 0.5 * LIP_GAP_MM * np.array([0.0, 1.0, 0.0])
    values = np.concatenate([middle + half - V[upper], middle - half - V[lower]])
    seam = np.concatenate([seam_upper, lower])
    corner = np.zeros((1, 3))
    handles = np.concatenate([upper, lower, seam_upper[[0, -1]]])
    values = np.concatenate([values, corner, corner])
    center = V[seam].mean(axis=0)
    far = np.linalg.norm((V - center) * [0.8, 1.0, 1.0], axis=1) > 45.0
    return V + spread(K, handles, values, far)


def seam_columns():
    """Level-2 columns (4 per control column) of the seam's vertices from the left corner: lower lip, upper lip."""
    corner = round(4 * NEW_CORNER)
    lower = np.arange(corner, -1, -2)
    upper = np.arange(corner, 4 * 19 + 1, 2)
    return lower, upper, 4 * SEAM_RING
