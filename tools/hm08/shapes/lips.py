"""The lips as sections across their seam, each of which moves and rolls as a whole."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from facewright.mesh.normals import normalized
from facewright.mesh.polyline import arc_lengths
from hm08.density import NEW_CORNER, SEAM_RING

CORNER_COLUMN = round(4 * NEW_CORNER)
SEAM_ROW = 4 * SEAM_RING
LIP_ROWS = (-6, 12, 24)  # of the mouth's grid: the sections' weight rises, is full up to, and ends at these
CORNER_SOFT = (0.7, 0.95)  # of the way to the corner: sections lose their hold on all but the seam
PARTING = 0.85
LIP_WEIGHT = 0.25


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
        # The corner is soft: there the rings run together, and both lips would pull at one place.
        soft = np.clip((self.t - CORNER_SOFT[0]) / (CORNER_SOFT[1] - CORNER_SOFT[0]), 0.0, 1.0)
        soft = np.where(self.row == SEAM_ROW, 1.0, 1.0 - soft * soft * (3 - 2 * soft))
        return LIP_WEIGHT * (np.minimum(inner, outer) * soft + 1e-4)

    def moved(self, V, upper, lower, turn_upper, turn_lower):
        """(k, 3) displacements: each section goes with its seam point and turns about it.

        upper, lower  pair of (m, 3) mm at m places from the middle to the corner, evenly spread: of the left half, and
                      of the right half as it is
        turn_*        (m,) degrees at such places, the same on both sides; positive rolls the lip outwards
        """
        out = np.zeros((len(self.vertices), 3))
        both = [along_lip(*half, self.t) for half in (upper, lower)]
        middle, apart = 0.5 * (both[0] + both[1]), 0.5 * (both[0] - both[1])
        # Lips part softly from the corner, else the skin around it would fold.
        near = np.clip((self.t - PARTING) / (1.0 - PARTING), 0.0, 1.0)[:, None]
        apart = apart * (1.0 - near**2)
        for half, turns, sign in ((self.upper, turn_upper, -1), (~self.upper, turn_lower, 1)):
            t = self.t[half]
            turns = np.atleast_1d(turns)[:, None]
            angle = sign * np.radians(along_lip(turns, turns, t)[:, 0])
            offset = V[self.vertices[half]] - self.pivot[half]
            axis = self.along[half]
            c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
            along = (offset * axis).sum(axis=1, keepdims=True) * axis
            across = offset - along
            turned = along + c * across + s * np.cross(axis, across)
            out[half] = (middle - sign * apart)[half] + turned - offset
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
    steps = arc_lengths(seam)
    # By length: the columns crowd at the corner.
    share = np.where(columns <= CORNER_COLUMN, steps / steps[half], (steps[-1] - steps) / (steps[-1] - steps[half]))
    t = share[i]
    return LipSections(vertices, row, t, column > CORNER_COLUMN, seam[i], tangent[i])
