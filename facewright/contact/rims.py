"""The rims of shut lids lie on each other: round as they are, they would pass through each other."""

from __future__ import annotations

import numpy as np

from facewright.mesh.fade import smooth_step
from facewright.mesh.normals import normalized
from facewright.mesh.polyline import arc_lengths

_ENDS_MM = 2.0  # from a canthus: there it sets in
_CORNER_MM = 3.0  # the same of rims that leave the corners alone
_LEAN = np.radians(30.0)  # over its margin, of the rim of a shut lid
_FIRM_MM, _SOFT_MM = 1.2, 2.8  # from the margin: so far a lid keeps its form whole, and not at all


class FirmRims:
    """The rims of both lids, which margins carry as they are: a rim is firm (the tarsus), skin beyond gives way.

    Each vertex hangs on a point of its margin, in a frame of the margin's way there and of the ray from the eye's
    centre: round a corner of the eye a rim turns with its margin, which comes to lie flat when the eye is shut.
    vertices (n, 3) mm at rest, sides: masks (n,) of the outer skin of the upper and the lower lid; margins: the two
    lines of vertices from canthus to canthus; center (3,) of the eye
    """

    def __init__(self, vertices, sides, margins, center):
        self._margins, self._center = margins, center
        hung = [_hung(vertices, np.flatnonzero(side), line) for side, line in zip(sides, margins)]
        self._index, self._on, self._share, self._weight, self._inner = zip(*hung)
        frames = self._frames(vertices)
        # The way from the lower margin to the upper one, across both, says on which side the other lid lies.
        up = vertices[margins[0][len(margins[0]) // 2]] - vertices[margins[1][len(margins[1]) // 2]]
        self._offsets = []
        for index, (foot, frame), sign in zip(self._index, frames, (-1.0, 1.0)):
            offset = np.einsum("kij,kj->ki", frame, vertices[index] - foot)
            self._offsets.append(_leaning(offset, sign * np.sign(frame[:, 2].sum(axis=0) @ up)))

    def __call__(self, pose, corners=True):
        """The pose (n, 3) of shut lids with rims as the margins carry them; none leans over its margin much.

        corners  rims are carried round the corners of the eye too
        """
        result = pose.copy()
        for number, (foot, frame) in enumerate(self._frames(pose)):
            index = self._index[number]
            carried = foot + np.einsum("kij,ki->kj", frame, self._offsets[number])
            weight = self._weight[number] * (1.0 if corners else self._inner[number])
            result[index] += weight[:, None] * (carried - pose[index])
        return result

    def _frames(self, pose):
        """Of each lid: feet (k, 3) of its rim, frames (k, 3, 3) of rows along the margin, away from the eye, across."""
        result = []
        for line, on, share in zip(self._margins, self._on, self._share):
            chain, share = pose[line], share[:, None]
            way = normalized(np.gradient(chain, axis=0))
            foot, along = ((1.0 - share) * each[on] + share * each[on + 1] for each in (chain, way))
            away = normalized(foot - self._center)
            along = normalized(along - (along * away).sum(axis=1, keepdims=True) * away)
            result.append((foot, np.stack([along, away, np.cross(along, away)], axis=1)))
        return result


def _leaning(offsets, over):
    """Offsets (k, 3) in frames of the margin that lean over it, to the other lid's side, by _LEAN at most; over: the
    sign of that side. What leans more is laid down, as far from the margin as before."""
    out, across = offsets[:, 1], over * offsets[:, 2]
    angle = np.arctan2(across, out)
    size, lean = np.hypot(out, across), np.minimum(angle, _LEAN)
    return np.stack([offsets[:, 0], size * np.cos(lean), over * size * np.sin(lean)], axis=1)


def _hung(vertices, side, line):
    """Vertices of one lid near its margin: their indices, the margin's edges that they hang on, the share of the way
    along those, how firmly they hang there, and how far from the corners (0 to 1)."""
    start, edge = vertices[line[:-1]], np.diff(vertices[line], axis=0)
    share = ((vertices[side][:, None] - start) * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=1), 1e-12)
    share = np.clip(share, 0.0, 1.0)
    away = np.linalg.norm(vertices[side][:, None] - start - share[:, :, None] * edge, axis=2)
    nearest = away.argmin(axis=1)
    k = np.arange(len(side))
    share, ends = share[k, nearest], from_ends(vertices[line], _CORNER_MM)
    weight = smooth_step(away[k, nearest], _SOFT_MM, _FIRM_MM)
    inner = smooth_step((1.0 - share) * ends[nearest] + share * ends[nearest + 1])
    hangs = weight > 0.0
    return side[hangs], nearest[hangs], share[hangs], weight[hangs], inner[hangs]


def from_ends(chain, reach_mm=_ENDS_MM):
    """(k,) 0 at the ends of a chain of points (k, 3), 1 from reach_mm on."""
    steps = arc_lengths(chain)
    return np.clip(np.minimum(steps, steps[-1] - steps) / reach_mm, 0.0, 1.0)
