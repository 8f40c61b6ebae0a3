"""The mouth's lining stays in the head: where a shape draws chin or cheek over it, it gives way inwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import border_vertices
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import dot, lengths, vertex_normals


@dataclass(frozen=True)
class BagOptions:
    """flesh_mm  left between lining and outer skin, or half of what is there at rest
    least_mm  lining less deep at rest is not asked
    lip_mm    from the seam: lining that belongs to the lips and stays, and lining that gives way freely
    face_mm   from the seam: outer skin that the lining could come out of; lips roll in and out before it
    most_mm   deeper than this nothing comes out
    rounds    of giving way
    """

    flesh_mm: float = 0.5
    least_mm: float = 0.5
    lip_mm: tuple[float, float] = (8.0, 18.0)
    face_mm: tuple[float, float] = (11.0, 60.0)
    most_mm: float = 12.0
    rounds: int = 6


NOSTRILS = BagOptions(lip_mm=(0.5, 3.0), face_mm=(0.0, 30.0))
"""Nostrils follow the tip of the nose, and its wings may stay."""

_NOTHING_MM, _LEAST_SHARE = 0.01, 0.1
_SAMPLES = np.array([[i, j, 3 - i - j] for i in range(4) for j in range(4 - i)]) / 3.0  # barycentric


class MouthBag:
    """The lining of one mouth, or of nostrils, asked at its vertices and within its faces, which are large.

    vertices (n, 3) of the skin at rest, faces (m, 3); seams two lines; inner, outer (n,) bool: lining, and seen skin
    """

    def __init__(self, vertices, faces, seams, inner, outer, options=None):
        self.options = options or BagOptions()
        away = cKDTree(vertices[np.concatenate(seams)]).query(vertices)[0]
        stays, gives = self.options.lip_mm
        self.free = inner * np.clip((away - stays) / (gives - stays), 0.0, 1.0)
        least, most = self.options.face_mm
        self.patch = faces[(outer & (away > least) & (away < most))[faces].all(axis=1)]
        of_patch = np.zeros(len(vertices), bool)
        of_patch[self.patch] = True
        self._around = faces[of_patch[faces].any(axis=1)]  # what the normals of the patch depend on
        mine = faces[inner[faces].all(axis=1) & (self.free[faces] > 0.0).any(axis=1)]
        self.corners = np.repeat(mine, len(_SAMPLES), axis=0)
        self.shares = np.tile(_SAMPLES, (len(mine), 1))
        self._index_places()
        self._rim = border_vertices(self.patch, len(vertices))
        before = self.before(vertices)
        depth = np.nan_to_num(-self.heights(before, vertices, np.arange(len(self.corners)))[0], posinf=0.0)
        near = (depth > self.options.least_mm) & (depth < self.options.most_mm)
        self.corners, self.shares = self.corners[near], self.shares[near]
        self._index_places()
        self._wanted = np.clip(0.5 * depth[near], 0.0, self.options.flesh_mm)
        # Lining that goes with the skin before it stays behind it.
        found = before.closest(self._samples(vertices, np.arange(len(self.corners))))
        self._before, self._before_shares = self.patch[found.faces], found.barycentric
        self._room, self._at_rest = depth[near] - self._wanted, self._behind(vertices)

    def _index_places(self):
        """Samples on edges and corners lie in several faces, and are asked about once."""
        self._place = _same_place(self.corners, self.shares)
        self._first = np.unique(self._place, return_index=True)[1]
        self._vertices, corner = np.unique(self.corners, return_inverse=True)
        self._corner = corner.reshape(-1, 3)

    def tucked(self, skin):
        """(n, 3) displacement that brings the lining of a pose (n, 3) back behind the outer skin."""
        moved, every = np.array(skin), np.arange(len(self.corners))
        asked = np.flatnonzero(lengths(self._behind(skin) - self._at_rest) > self._room)
        if not len(asked):
            return np.zeros_like(skin)
        before = self.before(skin)  # which does not give way
        asked = asked[self._may_come_out(before, skin, asked)]
        for _ in range(self.options.rounds):
            height, normal = self.heights(before, moved, asked)
            over = height + self._wanted[asked]
            coming = (over > _NOTHING_MM) & (height < self.options.most_mm)
            if not coming.any():
                break
            out, over, normal, asked = asked[coming], over[coming], normal[coming], every
            shares = self.shares[out]
            pull = shares * self.free[self.corners[out]]
            pull = pull / np.maximum((shares * pull).sum(axis=1, keepdims=True), _LEAST_SHARE) * over[:, None]
            total, count = np.zeros_like(skin), np.zeros(len(skin))
            np.add.at(total, self.corners[out], -(pull * shares)[..., None] * normal[:, None])
            np.add.at(count, self.corners[out], shares)
            moved += total / np.maximum(count, 1e-9)[:, None]
        return moved - skin

    def _behind(self, skin):
        """(k, 3) from the skin that lies before each sample at rest to the sample, in a pose (n, 3)."""
        return _points(skin, self.corners, self.shares) - _points(skin, self._before, self._before_shares)

    def _samples(self, skin, index):
        """(k, 3) points of the lining that are asked about."""
        return _points(skin, self.corners[index], self.shares[index])

    def before(self, skin):
        """The outer skin of a pose (n, 3) that lining could come out of."""
        return _Before(skin, self.patch, self._around, self._rim)

    def heights(self, before, skin, index):
        """(k,) how far samples of the lining lie outside of the nearest outer skin, and its normals (k, 3)."""
        asked, again = _each_once(self._place[index], len(self._first))
        height, normal, _ = before.heights(self._samples(skin, self._first[asked]))
        return height[again], normal[again]

    def _may_come_out(self, before, skin, index):
        """(k,) bool of samples: a corner of their face may be too near to the outer skin to vouch for them."""
        asked, again = _each_once(self._corner[index], len(self._vertices))
        height, _, distance = before.heights(skin[self._vertices[asked]])
        depth = np.where(height < 0.0, distance, 0.0)[again]
        away = lengths(skin[self.corners[index]] - self._samples(skin, index)[:, None])
        return (depth - away).max(axis=1, initial=0.0) <= self._wanted[index]


class _Before:
    """The outer skin of a pose (n, 3) that lining could come out of: faces patch (m, 3), those around it for normals,
    rim (n,) bool of the patch."""

    def __init__(self, skin, patch, around, rim):
        self._patch, self._rim = patch, rim
        self._surface, self._normals = Surface(skin, patch), vertex_normals(skin, around)

    def closest(self, points):
        """ClosestPoints of points (k, 3) on it."""
        return self._surface.closest(points)

    def heights(self, points):
        """(k,) mm by which points (k, 3) lie outside of it, -inf past its rim, where no such skin lies before them; the
        normals (k, 3) there; and distances (k,)."""
        found = self.closest(points)
        normal = interpolate(self._normals, self._patch, found.faces, found.barycentric)
        height = dot(points - found.points, normal)
        beyond = (self._rim[self._patch[found.faces]] & (found.barycentric > 1e-6)).any(axis=1)
        return np.where(beyond, -np.inf, height), normal, found.distance


def _points(vertices, corners, shares):
    """(k, 3) points with shares (k, 3) of corners (k, 3)."""
    return np.einsum("kc,kcd->kd", shares, vertices.take(corners, axis=0))


def _each_once(numbers, count):
    """(k,) which of so many numbers occur, and where those of an array lie among them: a quick np.unique."""
    occurs = np.zeros(count, bool)
    occurs[numbers] = True
    return np.flatnonzero(occurs), (np.cumsum(occurs) - 1)[numbers]


def _same_place(corners, shares):
    """(k,) numbers of points with shares (k, 3) of vertices (k, 3): those on edges and corners lie in several faces."""
    order = np.where(shares > 0.0, corners, -1).argsort(axis=1)
    who = np.take_along_axis(np.where(shares > 0.0, corners, -1), order, axis=1)
    thirds = np.take_along_axis(np.rint(3.0 * shares).astype(np.int64), order, axis=1)
    return np.unique(np.concatenate([who, thirds], axis=1), axis=0, return_inverse=True)[1].reshape(-1)
