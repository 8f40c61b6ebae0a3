"""From the smooth adult mean to the template's neutral: real eyeballs, refitted lids, closed lips."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.laplacian import uniform_laplacian
from facewright.solve.quadratic import Factorization
from hm08.control import EYE_SHIFT_MM
from hm08.density import NEW_CORNER, SEAM_RING
from hm08.eyeball import at_height, height_above
from hm08.spread import bilaplacian, spread
from hm08.topology import QuadTopology

LID_GAP_MM = 0.15
SOCKET_GAP_MM = 0.25
MARGIN_PULL_MM = 1.2  # the corners of the eye stand off the ball by more than this and stay so
LIP_GAP_MM = 0.1
# (gap, how far the slit lies above the straight way) in mm at the seam, half a ring and a ring behind it.
CONTACT = ((LIP_GAP_MM, 0.0), (0.12, -0.22), (0.3, 0.1))
CORNER_RADII_MM = (3.0, 7.0)  # mouth corner: free within, held from there on
CORNER_ANCHOR = 0.3
NOSTRIL_DEPTH_MM = {0: 1.5, -1: 5.0, -2: 9.0}  # by ring of the nostril's grid; the blind end 11
NOSTRIL_END_MM = 11.0


def deepen_nostrils(control):
    """(c, 3) control vertices with the nostril pits pushed up and back into passages that narrow a little."""
    V = control.vertices.copy()
    rings = control.nostril_left.rings
    inside = set(control.quads[inside_faces(control)].ravel().tolist()) - set(rings[-2])
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


def inside_faces(control):
    """(m,) bool: quads of the left nostril's blind end, within its innermost ring."""
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
        gap = np.median(height_above(margin, np.array([start[0], start[1], z])))
        low, high = (z, high) if gap > LID_GAP_MM else (low, z)
    return np.array([start[0], start[1], z])


def refit_lids(V, F, margin, center, K=None):
    """V (n, 3) with the left lid margin (k,) drawn to the ball; corners that stand off stay off, softly."""
    K = bilaplacian(V, F) if K is None else K
    excess = height_above(V[margin], center) - LID_GAP_MM
    wish = at_height(V[margin], center, LID_GAP_MM + np.maximum(excess - MARGIN_PULL_MM, 0.0))
    values = wish - V[margin]
    far = np.linalg.norm(V - center, axis=1) > 30.0
    return V + spread(K, margin, values, far)


def clear_of_ball(V, margin, center):
    """V (n, 3) with whatever lies inside the left ball (the lids' inner faces, hm08's socket) laid over it.

    The margin (k,) stays where it is.
    """
    deep = height_above(V, center) < SOCKET_GAP_MM
    deep[margin] = False
    out = V.copy()
    out[deep] = at_height(V[deep], center, SOCKET_GAP_MM)
    return out


def close_lips(V, rows, K):
    """V (n, 3) with the lips closed: paired points brought together, each half the way; the inner mouth follows.

    rows  [(upper (k,), lower (k,)), ...] one for each of CONTACT: the seam and two rings behind it, from corner to
          corner; behind the seam the slit bends up and down again, so that no ray looks through it
    """
    handles, values = [], []
    for (upper, lower), (gap, bend) in zip(rows, CONTACT):
        k = len(upper)
        taper = np.sin(np.pi * np.arange(k) / (k - 1)) ** 0.5
        middle = 0.5 * (V[upper] + V[lower]) + (bend * taper)[:, None] * [0.0, 1.0, 0.0]
        half = 0.5 * gap * np.array([0.0, 1.0, 0.0])
        handles += [upper[1:-1], lower[1:-1]]
        values += [(middle + half - V[upper])[1:-1], (middle - half - V[lower])[1:-1]]
    upper, _ = rows[0]
    handles, values = [*handles, upper[[0, -1]]], [*values, np.zeros((2, 3))]
    far = np.linalg.norm((V - V[upper].mean(axis=0)) * [0.8, 1.0, 1.0], axis=1) > 45.0
    return V + spread(K, np.concatenate(handles), np.concatenate(values), far)


def part_lips(V, seam_upper, seam_lower, K, *, opening_mm=2.0):
    """V (n, 3) with the closed lips parted by so much in the middle and less towards the corners."""
    k = len(seam_upper)
    half = 0.5 * opening_mm * np.sin(np.pi * np.arange(k) / (k - 1))[1:-1]
    up = np.stack([0 * half, half, 0 * half], axis=1)
    handles = np.concatenate([seam_upper[1:-1], seam_lower[1:-1], seam_upper[[0, -1]]])
    far = np.linalg.norm((V - V[seam_upper].mean(axis=0)) * [0.8, 1.0, 1.0], axis=1) > 45.0
    return V + spread(K, handles, np.concatenate([up, -up, np.zeros((2, 3))]), far)


def round_corner(V, F, corner, seam):
    """V (n, 3) with the pinched corner of the mouth evened out: least curvature of the mesh near the left corner.

    hm08's rings around the lips run together there in a point; the seam's own vertices (seam) stay where they are.
    """
    n = len(V)
    L = uniform_laplacian(F, n).tocsr()
    L = sp.diags(1.0 / L.diagonal()) @ L
    distance = np.linalg.norm(V - V[corner], axis=1)
    inner, outer = CORNER_RADII_MM
    free = distance < outer
    free[seam] = False
    w = np.clip((distance - inner) / (outer - inner), 0.0, 1.0)
    anchor = CORNER_ANCHOR * w**2 / np.maximum(1.0 - w, 1e-3)
    K = (L.T @ L).tocsr()
    f = np.flatnonzero(free)
    rhs = anchor[f][:, None] * V[f] - K[f] @ np.where(free[:, None], 0.0, V)
    out = V.copy()
    out[f] = Factorization(K[f][:, f] + sp.diags(anchor[f] + 1e-9)).solve(rhs)
    return out


def separate_lips(V, mouth, corner_column, seam, K):
    """V (n, 3) with the lips' outer faces parted where they cross near the left corner.

    Vertices of a ring that lie face to face keep a gap that widens away from the seam; each side goes half the way.
    mouth  dict (4 ring, 4 column) -> vertex
    """
    keys = [(r, c) for r, c in mouth if -4 <= r <= 16 and c <= corner_column and (r, 2 * corner_column - c) in mouth]
    ring = np.array([r / 4 for r, _ in keys])
    column = np.array([c for _, c in keys])
    lower = np.array([mouth[key] for key in keys])
    upper = np.array([mouth[(r, 2 * corner_column - c)] for r, c in keys])
    gap = V[upper, 1] - V[lower, 1]
    push = 0.5 * np.maximum(LIP_GAP_MM * (1.0 + np.abs(ring - SEAM_RING)) - gap, 0.0)
    move = dict.fromkeys(np.unique(seam).tolist(), 0.0)
    side = column < corner_column
    for mine, sign in ((upper, 1.0), (lower, -1.0)):
        move |= {int(v): sign * p for v, p in zip(mine[side], push[side]) if p > 1e-3}
    for r in range(-4, 17, 2):  # the corner's own column goes to the middle between its neighbours
        around = [mouth.get((r, corner_column + d)) for d in (-2, 0, 2)]
        if r != 4 * SEAM_RING and None not in around:
            low, own, high = around
            middle = 0.5 * (V[low, 1] + move.get(low, 0.0) + V[high, 1] + move.get(high, 0.0))
            move[own] = middle - V[own, 1]
    handles = np.array(sorted(move))
    values = np.zeros((len(handles), 3))
    values[:, 1] = [move[int(v)] for v in handles]
    far = np.linalg.norm(V - V[mouth[(4 * SEAM_RING, corner_column)]], axis=1) > 22.0
    return V + spread(K, handles, values, far)


def seam_columns():
    """Level-2 columns (4 per control column) of the seam's vertices from the left corner: lower lip, upper lip."""
    corner = round(4 * NEW_CORNER)
    lower = np.arange(corner, -1, -2)
    upper = np.arange(corner, 4 * 19 + 1, 2)
    return lower, upper
