"""The lips as sections across their seam, each of which moves and rolls as a whole."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from facewright.mesh.normals import normalized
from hm08.density import NEW_CORNER, SEAM_RING

CORNER_COLUMN = round(4 * NEW_CORNER)
SEAM_ROW = 4 * SEAM_RING
LIP_ROWS = (-6, 12, 24)  # of the mouth's grid: the sections' weight rises, is full up to, and ends at these


class LipSections:
    """The left half of the lips as sections across the seam.

    vertices (k,); row (k,) of the mouth's grid; t (k,) 0 in the middle, 1 at the corner; upper (k,) bool
    pivot (k, 3) the seam's point of each section; along (k, 3) its unit tangent towards the corner
    """

    def __init__(self, vertices, row, t, upper, pivot, along):
        self.vertices, self.row, self.t, self.upper = vertices, row, t, upper
        self.pivot, self.along = pivot, along

    def weights(self):
        """(k,) how firmly each vertex goes with its section."""
        start, full, end = LIP_ROWS
        inner = np.clip((self.row - start + 4) / 4, 0.0, 1.0)
        outer = np.clip((end - self.row) / (end - full), 0.0, 1.0)
        return np.minimum(inner, outer) + 1e-4

    def moved(self, V, upper, lower, turn_upper, turn_lower):
        """(k, 3) displacements: each section goes with its seam point and turns about it.

        upper, lower  pair of (m, 3) mm at m places from the middle to the corner, evenly spread: of the left half, and
                      of the right half as it is
        turn_*        (m,) degrees at such places, the same on both sides; positive rolls the lip outwards
        """
        out = np.zeros((len(self.vertices), 3))
        for half, moves, turns, sign in ((self.upper, upper, turn_upper, -1), (~self.upper, lower, turn_lower, 1)):
            t = self.t[half]
            turns = np.atleast_1d(turns)[:, None]
            angle = sign * np.radians(along_lip(turns, turns, t)[:, 0])
            offset = V[self.vertices[half]] - self.pivot[half]
            axis = self.along[half]
            c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
            along = (offset * axis).sum(axis=1, keepdims=True) * axis
            across = offset - along
            turned = along + c * across + s * np.cross(axis, across)
            out[half] = along_lip(*moves, t) + turned - offset
        return out


def along_lip(left, right, t):
    """(k, d) values at t (k,), 0 in the middle and 1 at the left corner, of a smooth curve through knots (m, d) of both
    halves, evenly spread from the middle to the corner."""
    left, right = np.asarray(left, float), np.asarray(right, float)
    if len(left) == 1:
        return np.repeat(left, len(t), axis=0)
    at = np.linspace(0.0, 1.0, len(left))
    return CubicSpline(np.append(-at[:0:-1], at), np.concatenate([right[:0:-1], left]), axis=0)(t)


def lip_sections(head):
    """LipSections of a Head."""
    table = head.grid["mouth"]
    rows = sorted({r for r, _ in table if LIP_ROWS[0] <= r <= LIP_ROWS[2]})
    keys = [(r, c) for r in rows for c in range(0, 2 * CORNER_COLUMN + 1, 2) if (r, c) in table]
    row, column = np.array(keys).T
    vertices = np.array([table[key] for key in keys])
    columns = np.arange(0, 2 * CORNER_COLUMN + 1, 2)
    seam = head.V[[table[(SEAM_ROW, c)] for c in columns]]
    half = CORNER_COLUMN // 2
    tangent = np.zeros_like(seam)
    for part in (slice(0, half + 1), slice(half, None)):
        step = np.gradient(seam[part], axis=0) * (1.0 if part.start == 0 else -1.0)
        kernel = np.ones(5) / 5
        padded = np.concatenate([step[[0, 0]], step, step[[-1, -1]]])
        tangent[part] = np.stack([np.convolve(padded[:, d], kernel, mode="valid") for d in range(3)], axis=1)
    tangent[[0, -1]] = [1.0, 0.0, 0.0]
    tangent = normalized(tangent)
    i = column // 2
    t = 1.0 - np.abs(CORNER_COLUMN - column) / CORNER_COLUMN
    return LipSections(vertices, row, t, column > CORNER_COLUMN, seam[i], tangent[i])
