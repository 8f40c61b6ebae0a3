"""Lips that are shut stay shut where a shape does not open them, however it slides them along each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import unique_edges
from facewright.mesh.spread import SoftSpread

_PIN = 100.0  # weight of a wish against 1 mm2 of bending


@dataclass(frozen=True)
class ShutOptions:
    """overlap_mm by which one lip covers the other as seen from the front
    lap_mm     by which lips that are drawn apart may go on covering each other
    touch_mm   a slit narrower than this is none
    inside_mm, outside_mm  behind and before the seam: lip that counts; lining seen before the line is a slit
    corner_mm  from a corner of the mouth: there lips part by so little that no slit is seen
    pitch_deg  a slit counts as seen from so far above and below the front
    smooth_mm  width over which a wish is felt; reach_mm over which it fades
    rounds     of wishes
    """

    overlap_mm: float = 0.05
    lap_mm: float = 0.1
    touch_mm: float = 0.05
    inside_mm: float = 0.5
    outside_mm: float = 9.0
    corner_mm: float = 1.0
    pitch_deg: float = 4.0
    smooth_mm: float = 4.0
    reach_mm: float = 9.0
    rounds: int = 5


class LipSlit:
    """The slit between the lips of one head, looked at from the front of our frame (+Z out of the face, +Y up).

    vertices (n, 3) of the surroundings of the lips at rest, faces (m, 3); patches: faces of the upper and the lower lip
    seams    the two lines, paired; outer (n,) bool; free (n,) bool: skin that may follow
    """

    def __init__(self, vertices, faces, patches, seams, outer, free, options=None):
        self.options = options or ShutOptions()
        self.seams = seams
        seam = np.unique(np.concatenate(seams))
        away = cKDTree(vertices[seam]).query(vertices)[0]
        shown = away < np.where(outer, self.options.outside_mm, self.options.inside_mm)
        pitch = np.radians(self.options.pitch_deg)
        self._heights = [np.array([0.0, np.cos(pitch), turn * np.sin(pitch)]) for turn in (-1.0, 1.0)]
        self._edges = [unique_edges(patch[shown[patch].all(axis=1)]) for patch in patches]
        self._spread = SoftSpread(vertices, faces, free, self.options.reach_mm)
        corners = cKDTree(vertices[seams[0][[0, -1]]])
        self._asked = [corners.query(vertices[line[1:-1]])[0] > self.options.corner_mm for line in seams]
        self._at_rest = [np.maximum(gap, 0.0) for gap in self.gaps(vertices)]

    def gaps(self, skin):
        """(k,) of each line of a pose (n, 3): height in mm of the slit at its inner vertices, less than 0: covered."""
        x = skin[:, 0]
        corners = x[self.seams[0][[0, -1]]]
        result = []
        for line, asked in zip(self.seams, self._asked):
            at, worst = x[line[1:-1]], np.full(len(line) - 2, -np.inf)
            # Where a pose crowds a corner the lips run upright: their height there is no slit.
            asked = asked & (np.abs(at[:, None] - corners).min(axis=1) > self.options.corner_mm)
            over = [_Crossings(at, x, edges) for edges in self._edges]
            for height in self._heights:
                y = skin @ height
                low, high = -over[0].highest(-y), over[1].highest(y)  # edges of the upper lip and the lower one
                gap = np.full(len(at), -np.inf)
                both = np.isfinite(low) & np.isfinite(high)
                gap[both] = low[both] - high[both]
                worst = np.maximum(worst, gap)
            result.append(np.where(asked, worst, -np.inf))
        return result

    def wishes(self, skin, lifted=False):
        """(n, 3) what shuts the slit of a pose (n, 3), half and half, and (n,) by how much it is open there, mm.

        lifted  lips that cover each other by more than lap_mm are also drawn apart so far
        """
        move, over = np.zeros(len(skin)), np.zeros(len(skin))
        for line, gap, rest, sign in zip(self.seams, self.gaps(skin), self._at_rest, (-1.0, 1.0)):
            more = gap - rest
            wish = np.where(more > self.options.touch_mm, more + self.options.overlap_mm, 0.0)
            if lifted:
                lap = np.maximum(-self.options.lap_mm - gap, 0.0)
                wish = wish - np.where(np.isfinite(lap), lap, 0.0)
            move[line[1:-1]], over[line[1:-1]] = 0.5 * sign * wish, np.abs(wish)
        return move[:, None] * [0.0, 1.0, 0.0], over

    def shut(self, skin, lifted=False):
        """(n, 3) correction that shuts the slit of a pose (n, 3); lifted as in wishes."""
        field, hold = np.zeros_like(skin), np.zeros(len(skin))
        hold[np.concatenate(self.seams)] = 1.0
        for _ in range(self.options.rounds):
            wishes, over = self.wishes(skin + field, lifted)
            if not over.any():
                break
            field = field + self._spread(wishes, _PIN * hold, self.options.smooth_mm)
        return field


class _Crossings:
    """Where edges (e, 2) of points at x (n,) pass places at (k,) of x."""

    def __init__(self, at, x, edges):
        one, other = np.sort(x[edges], axis=1).T
        self._place, self._edge = np.nonzero((at[:, None] >= one) & (at[:, None] <= other) & (other - one > 1e-9))
        self._a, self._b = edges[self._edge].T
        self._share = (at[self._place] - x[self._a]) / (x[self._b] - x[self._a])
        self._count = len(at)

    def highest(self, y):
        """(k,) largest y (n,) of the edges at each place; -inf where there is none."""
        result = np.full(self._count, -np.inf)
        np.maximum.at(result, self._place, y[self._a] + self._share * (y[self._b] - y[self._a]))
        return result
