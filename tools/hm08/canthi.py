"""The outer corners of the eyes, tapered: hm08's margins meet there in a half circle that is 4.5 mm high."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facewright.mesh.normals import normalized
from facewright.mesh.polyline import arc_lengths
from hm08.eyeball import at_height, height_above
from hm08.neutral import LID_GAP_MM, clear_of_ball
from hm08.spread import spread

REACH_MM = 7.0  # from the corner inwards, seen from in front
SLOPES = (1.15, 1.0)  # at which the upper and the lower margin come to the corner: height over width
FREE_MM = 14.0  # skin that follows


class Taper:
    """Margins that run to a pointed outer corner, which stays where it is; the skin around follows.

    A vertex of a margin goes to a place between the two margins as they were, and moves in every shape as that place
    does: lids that met still meet.
    """

    def __init__(self, head):
        self.head = head
        lines = [head.lines[f"lid_{lid}_left"] for lid in ("upper", "lower")]
        self.margin = np.unique(np.concatenate(lines))
        upper, lower = (head.V[line] for line in lines)
        self.rows = np.eye(len(self.margin))  # places on the margins as they were
        for line, slope in zip(lines, SLOPES):
            new = tapered(head.V[line], slope)
            bent = np.flatnonzero((new != head.V[line, :2]).any(axis=1))
            places = [np.searchsorted(self.margin, vertices) for vertices in (line[bent], *lines)]
            self.rows[places[0]] = 0.0
            for place, margin, share in zip(places[1:], (upper, lower), _shares(upper, lower, new[bent])):
                self.rows[np.ix_(places[0], place)] += share[:, None] * _interpolation(margin[:, 0], new[bent, 0])
        self._far = np.linalg.norm(head.V - upper[-1], axis=1) > FREE_MM

    def tapered_head(self):
        """The Head with tapered corners."""
        V, center = self.head.V, self.head.eye_center
        wanted = self.rows @ V[self.margin]
        wanted = at_height(wanted, center, np.maximum(height_above(wanted, center), LID_GAP_MM))
        moved = spread(self.head.K, self.margin, wanted - V[self.margin], self._far)
        moved = clear_of_ball(V + moved, self.margin, center) - V
        moved = moved + moved[self.head.mirror] * [-1, 1, 1]
        return replace(self.head, V=V + moved, V_open=self.head.V_open + moved)

    def carried(self, deltas):
        """Deltas (s, n, 3) of the head as it was, of the tapered one."""
        result = np.array(deltas)
        for vertices, order in ((self.margin, slice(None)), (self.head.mirror[self.margin], self.head.mirror)):
            own = deltas[:, vertices]
            change = np.moveaxis(np.einsum("ij,sjc->sic", self.rows, own) - own, 0, 1)
            field = spread(self.head.K, self.margin, change.reshape(len(self.margin), -1), self._far)
            result += np.moveaxis(field.reshape(len(field), len(deltas), 3), 0, 1)[:, order]
        return result


def tapered(line, slope):
    """(k, 2) a left margin (k, 3), inner to outer canthus, that comes to its end at a slope, seen from in front.

    A cubic curve leads there from where the margin is REACH_MM aside of it. Vertices keep their shares of the way.
    """
    own = (line[-1, :2] - line[::-1, :2]) * [1.0, -1.0]  # mm inwards and up from the corner
    way = arc_lengths(own)
    stop = int(np.argmax(own[:, 0] > REACH_MM))
    height, length = (np.interp(REACH_MM, own[: stop + 1, 0], values[: stop + 1]) for values in (own[:, 1], way))
    start = np.array([REACH_MM, height])
    leaves = normalized(own[stop - 2] - own[stop + 1])
    arrives = normalized(np.array([-1.0, -np.sign(height) * slope]))
    third = np.linalg.norm(start) / 3
    t = np.linspace(0.0, 1.0, 400)[:, None]
    curve = t**3 * start + 3 * t**2 * (1 - t) * (start + third * leaves) - 3 * t * (1 - t) ** 2 * third * arrives
    along = arc_lengths(curve)
    result = line[:, :2].copy()
    for axis, sign in ((0, -1.0), (1, 1.0)):
        new = np.interp(way[1:stop] / length, along / along[-1], curve[:, axis])
        result[::-1][1:stop, axis] = line[-1, axis] + sign * new
    return result


def _shares(upper, lower, points):
    """Two (k,): how much of points (k, 2) between two margins is of the upper (u, 3) and of the lower (l, 3) one."""
    up, down = (_interpolation(line[:, 0], points[:, 0]) @ line[:, 1] for line in (upper, lower))
    share = np.clip((points[:, 1] - down) / np.maximum(up - down, 1e-6), 0.0, 1.0)
    return share, 1.0 - share


def _interpolation(x, at):
    """(k, n) rows that interpolate values at x (n,) linearly at (k,); x rises about these."""
    after = np.clip(np.searchsorted(x, at), 1, len(x) - 1)
    share = np.clip((at - x[after - 1]) / np.maximum(x[after] - x[after - 1], 1e-9), 0.0, 1.0)
    rows = np.zeros((len(at), len(x)))
    rows[np.arange(len(at)), after - 1] = 1.0 - share
    rows[np.arange(len(at)), after] += share
    return rows
