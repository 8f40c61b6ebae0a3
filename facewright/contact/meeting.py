"""Shut lids lie on each other without passing through each other.

Lids turn about the axis of their eye. Seen along that turn, upper and lower lid are sheets over the plane of (place
along the axis, distance from it), and no turn changes what lies over what. So where a vertex lies over a face or an
edge over an edge is found once, and that the upper lid stays above the lower one is a set of linear inequalities in how
far the vertices turn. Faces that would fold are more of them. The least motion that meets all is a quadratic programme.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from facewright.contact.rims import from_ends
from facewright.mesh.adjacency import touching, unique_edges, within
from facewright.mesh.fade import smooth_step
from facewright.mesh.folds import expected_normals, folded_by_shape
from facewright.mesh.intersect import self_intersections
from facewright.mesh.normals import cross, dot, face_areas, face_corners, face_cross, normalized
from facewright.mesh.overlap import barycentric, where_edges_pass
from facewright.mesh.seam import seam_sides
from facewright.solve.least_motion import least_motion

_REACH_MM, _LINING_MM = 8.0, 3.0  # over the skin and over the lining from the margins: what the other lid may meet
_MARGIN_GAP_MM = 0.01  # left between two lids beside their margins, at most
_OVER_MM, _OVER_ENDS_MM = 0.06, 3.0  # by which the upper margin passes the lower one, that far from the canthi
_NEAR_MM, _DEEPEST_MM = 0.5, 4.0  # lids nearer than this over a place may come to meet there; deeper is no contact
_MARGIN_EASE = 0.004  # how readily a margin gives way; the rest: 1
_FOLD = 10.0  # crossings that a folded face counts as
_PRESSED, _LEAST_SHARE = 0.5, 0.15  # of its area at rest, seen as it should look: a face is watched, and keeps so much
_SUSPECT = 0.5  # the same beside its neighbours, from which on it is looked at closely
_FRONT, _NARROW_MM = 0.5, 0.05  # seen from ahead: share of its area from which on a face looks out; its least width
_STIFF = 0.25  # of a face's edges: one whose area turns change by less is left alone
_STILL_MM, _LOOSE, _SMOOTH_MM = 1e-3, 0.02, 0.5  # what is not moved itself follows what lies around it
_HELD = 1e3  # weight of a margin, which does not follow
# The sill behind shut margins: how steeply it rises and so far from them; where it ends; by how much it is raised at
# most, of the room beneath the other lid's lining too; lining that counts as either; by how much less it rises, round
# by round, where something crosses or folds, and how far along the axis from there that is felt.
_SILL, _SILL_MM, _SILL_ENDS_MM = 1.0, 1.0, 4.0
_SILL_MOST_MM, _SILL_SHARE, _SILL_LINING_MM = 2.5, 0.7, 6.0
_SILL_LOWER, _SILL_ASIDE_MM = (0.4, 0.4, 0.5, 1.0), (1.0, 0.2)


class Meeting:
    """The skin of the two lids of one eye next to their margins, with the lining that lies behind these.

    vertices (n, 3) mm at rest, faces (m, 3), outer (n,) bool: the outer skin; upper, lower: margin vertices from
    canthus to canthus; axes: contact.axes.EyeAxes. sides: masks (n,) of the outer skin of the upper and the lower lid
    """

    def __init__(self, vertices, faces, outer, upper, lower, axes):
        self.axes = axes
        margins = np.zeros(len(vertices), bool)
        margins[upper] = margins[lower] = True
        skin = seam_sides(vertices, faces[outer[faces].all(axis=1)], upper, lower, _REACH_MM)
        self.sides = [side & ~margins for side in skin]
        lining = seam_sides(vertices, faces[(~outer | margins)[faces].all(axis=1)], upper, lower, _LINING_MM)
        over, behind = seam_sides(vertices, faces[(~outer | margins)[faces].all(axis=1)], upper, lower, _SILL_LINING_MM)
        self._behind, self._lower = np.flatnonzero(behind & ~margins), np.asarray(lower)
        over[upper] = True
        self._over = faces[within(over, faces)]
        self._sill_faces = faces[touching(over | behind | margins, faces)]
        self._at_rest = vertices
        patches = []
        for side, behind, line in zip(skin, lining, (upper, lower)):
            mine = side | behind
            mine[line] = True
            patches.append(faces[within(mine, faces)])
        self._used, local = np.unique(np.concatenate(patches), return_inverse=True)
        local = local.reshape(-1, 3)
        self._lids = [_Sheet(local[: len(patches[0])]), _Sheet(local[len(patches[0]) :])]
        chosen = np.zeros(len(vertices), bool)
        chosen[self._used] = True
        self._faces = np.searchsorted(self._used, faces[within(chosen, faces)])
        self._rest = vertices[self._used]
        self._area = face_areas(self._rest, self._faces)
        along, radius, angle = axes.cylindrical(self._rest)
        self._far = float(radius.mean())
        seen = _seen_area(along, self._far * angle, self._faces)
        front = (np.abs(seen) > _FRONT * self._area) & (outer | margins)[self._used][self._faces].all(axis=1)
        self._front, self._seen = self._faces[front], seen[front]
        self._ease, self._beside = np.ones(len(self._used)), np.full(len(self._used), np.inf)
        self._margins = []
        for line, sign in ((upper, 1.0), (lower, -1.0)):
            at, share = np.searchsorted(self._used, line), from_ends(vertices[line])
            self._margins.append((at, sign, -_OVER_MM * from_ends(vertices[line], _OVER_ENDS_MM)))
            self._ease[at], self._beside[at] = _MARGIN_EASE, _MARGIN_GAP_MM * share
        self._ease[np.intersect1d(*(at for at, *_ in self._margins))] = 0.0
        self._laplacian = _laplacian(self._rest, self._faces)
        self._before = None

    def __call__(self, pose, gap_mm, unfolded=False):
        """The pose (n, 3) of shut lids with each lid on its side of the other one, turned as little as that takes.

        gap_mm  left between them; unfolded: the pose has no folded faces, and shall have none
        """
        gap = np.minimum(gap_mm, self._beside)
        points = pose[self._used]
        along, radius, angle = self.axes.cylindrical(points)
        place, height = np.stack([along, radius], axis=1), self._far * angle
        motion = np.zeros(len(points))
        for (at, sign, lap), (other, *_) in zip(self._margins, self._margins[::-1]):
            motion[at] = 0.5 * (sign * lap - height[at] + along_line(along[at], along[other], height[other]))
        A, B = _contacts(place, height + motion, *self._lids), self._order(along)
        least = _LEAST_SHARE * np.abs(self._seen) / self._size(along)
        over = np.append(A @ height + abs(A) @ (0.5 * gap), B @ height + least)
        A = sp.vstack([A, B]).tocsr()
        for last in (False, True):
            rows, lack = A, over + A @ motion
            if unfolded:
                folds, short = self._folds(self.axes.turned(points, motion / self._far))
                rows, lack = sp.vstack([A, folds]).tocsr(), np.append(lack, short)
            motion = motion + least_motion(rows, lack, self._ease)
            if not last:
                motion = self._smoothed(motion)
        turns = np.zeros(len(pose))
        turns[self._used] = motion / self._far
        return self.axes.turned(pose, turns)

    def sealed(self, pose):
        """The pose (n, 3) of shut lids with a sill of the lower lid's lining behind the margins, if nothing crosses it.

        Two margins that touch leave a slit as wide as what is kept between them, and where the rims before them run
        level somebody looks through it. The lining, which nobody sees, rises behind it.
        """
        along, radius, angle = self.axes.cylindrical(pose[self._behind])
        at, before, height = self.axes.cylindrical(pose[self._lower])
        depth = np.maximum(along_line(along, at, before) - radius, 0.0)
        level = along_line(along, at, height) - angle
        away = np.hypot(depth, self._far * level)
        share = smooth_step(away, _SILL_ENDS_MM, _SILL_MM) * along_line(along, at, from_ends(pose[self._lower]))
        most = np.minimum(_SILL_SHARE * self._room(pose, along, radius, angle), _SILL_MOST_MM / self._far)
        slope = np.minimum(depth, _SILL_MM) / self._far
        faulty, steep, near = self._faulty(pose), _SILL, 0.0
        for lower in (0.0, *_SILL_LOWER):
            steep = steep - lower * near
            turns = np.zeros(len(pose))
            turns[self._behind] = np.clip(share * (level + steep * slope), 0.0, most)
            sealed = self.axes.turned(pose, turns)
            new = np.setdiff1d(self._faulty(sealed), faulty)
            if not len(new):
                return sealed
            there = (pose[self._sill_faces[new]] @ self.axes.axis).mean(axis=1) - self.axes.center @ self.axes.axis
            near = smooth_step(np.abs(along[:, None] - there).min(axis=1), *_SILL_ASIDE_MM)
        return pose

    def _room(self, pose, along, radius, angle):
        """(k,) radians from places behind the lower margin up to the upper lid's lining; no end under nothing."""
        over, away, height = self.axes.cylindrical(pose)
        points = np.broadcast_to(np.stack([along, radius], axis=1), (len(self._over), len(along), 2))
        share = barycentric(np.stack([over, away], axis=1)[self._over], points)
        room = np.einsum("fkc,fc->fk", share, height[self._over]) - angle
        room[(share.min(axis=2) < 0.0) | (room < 0.0)] = np.inf
        return room.min(axis=0, initial=np.inf)

    def faults(self, pose):
        """Number of pairs of faces that cross in a pose (n, 3) and not at rest, and of folded faces."""
        if self._before is None:
            self._before = self._crossing(self._rest)
        points = pose[self._used]
        crossing = np.setdiff1d(self._crossing(points), self._before)
        return len(crossing) + _FOLD * len(folded_by_shape(self._rest, points, self._faces))

    def _faulty(self, pose):
        """Indices of the faces around the lining that cross others, or are folded, in a pose (n, 3)."""
        pairs = self_intersections(pose, self._sill_faces)
        folded = folded_by_shape(self._at_rest, pose, self._sill_faces)
        return np.unique(np.append(pairs.ravel(), folded))

    def _crossing(self, points):
        pairs = self_intersections(points, self._faces)
        return pairs[:, 0] * len(self._faces) + pairs[:, 1]

    def _size(self, along):
        """(m,) by how much a turn of their vertices changes what is seen of faces that look out at rest."""
        x = along[self._front]
        return np.maximum(0.5 * np.linalg.norm(np.roll(x, -1, axis=1) - np.roll(x, 1, axis=1), axis=1), _NARROW_MM)

    def _order(self, along):
        """(m, k) csr: how much less is seen of faces that look out at rest as heights grow, over _size."""
        x = along[self._front]
        rows = 0.5 * np.sign(self._seen)[:, None] * (np.roll(x, -1, axis=1) - np.roll(x, 1, axis=1))
        rows /= self._size(along)[:, None]
        at = np.repeat(np.arange(len(x)), 3)
        return sp.csr_matrix((rows.ravel(), (at, self._front.ravel())), shape=(len(x), len(along)))

    def _folds(self, points):
        """Of faces that are pressed flat or folded: (m, k) csr how much they lose of what is seen of them as vertices
        turn, and (m,) how much they lack; both over the size of that."""
        doubled = face_cross(points, self._faces)
        around = np.zeros_like(points)
        for corner in self._faces.T:
            np.add.at(around, corner, doubled)
        # What looks as its neighbours do with most of its area is sound: the rest is asked with more care.
        asked = np.flatnonzero(dot(doubled, normalized(around[self._faces].sum(axis=1))) < 2.0 * _SUSPECT * self._area)
        normals = expected_normals(self._rest, points, self._faces, asked)
        area = 0.5 * dot(doubled[asked], normals)
        pressed = area < _PRESSED * self._area[asked]
        faces, n, rest = self._faces[asked][pressed], normals[pressed], self._area[asked][pressed]
        a, b, c = face_corners(points, faces)
        gradient = 0.5 * np.stack([cross(b - c, n), cross(c - a, n), cross(a - b, n)], axis=1)
        rows = -(gradient * (self.axes.tangents(points) / self._far)[faces]).sum(axis=2)
        size = np.linalg.norm(rows, axis=1)
        able = size > _STIFF * np.sqrt(rest)
        rows, faces, size = rows[able] / size[able, None], faces[able], size[able]
        lack = (_LEAST_SHARE * rest - area[pressed])[able] / size
        at = np.repeat(np.arange(len(rows)), 3)
        return sp.csr_matrix((rows.ravel(), (at, faces.ravel())), shape=(len(rows), len(points))), lack

    def _smoothed(self, motion):
        """A motion (k,) with what lies around taken along."""
        hold = np.where(np.abs(motion) > _STILL_MM, 1.0, _LOOSE)
        hold[self._ease < 1.0] = _HELD
        return spsolve((sp.diags(hold) + self._laplacian).tocsc(), hold * motion)


def _seen_area(along, height, faces):
    """(m,) signed area of faces (m, 3) as seen from ahead."""
    x, y = along[faces], height[faces]
    return 0.5 * ((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (y[:, 1] - y[:, 0]) * (x[:, 2] - x[:, 0]))


class _Sheet:
    """Faces (m, 3) with their edges (e, 2) and vertices (v,)."""

    def __init__(self, faces):
        self.faces, self.edges, self.vertices = faces, unique_edges(faces), np.unique(faces)[:, None]


def _laplacian(vertices, faces):
    """(k, k) csr of the squared differences between neighbours, nearer ones weighing more."""
    edges = unique_edges(faces)
    a, b = vertices[edges.T]
    weight = _SMOOTH_MM**2 / np.maximum(((a - b) ** 2).sum(axis=1), 1e-3)
    W = sp.coo_matrix((weight, edges.T), shape=(len(vertices),) * 2).tocsr()
    return sp.diags(np.asarray((W + W.T).sum(axis=1)).ravel()) - W - W.T


def _contacts(place, height, upper, lower):
    """(c, k) csr: of each place where the two lids lie over each other, how the lower one's height there less the upper
    one's depends on the heights (k,) of vertices; place (k, 2). Where they are far from each other none is made."""
    corners, shares = [], []
    for mine, other, sign in ((upper, lower, -1.0), (lower, upper, 1.0)):
        points, faces = _meeting(place, sign * height, mine.vertices, other.faces)
        share = barycentric(place[faces], place[points])[:, 0]
        over = share.min(axis=1, initial=1.0) >= 0.0
        corners.append(np.append(points, faces, axis=1)[over])
        shares.append(sign * np.append(np.ones((len(points), 1)), -share, axis=1)[over])
    one, two = _meeting(place, -height, upper.edges, lower.edges)
    t, s = where_edges_pass(*(place[edge[:, i]] for edge in (one, two) for i in (0, 1)))
    over = (np.minimum(t, s) >= 0.0) & (np.maximum(t, s) <= 1.0)
    corners.append(np.append(one, two, axis=1)[over])
    shares.append(np.stack([t - 1.0, -t, 1.0 - s, s], axis=1)[over])
    corners, shares = np.concatenate(corners), np.concatenate(shares)
    depth = (shares * height[corners]).sum(axis=1)
    near = (depth > -_NEAR_MM) & (depth < _DEEPEST_MM)
    at = np.repeat(np.arange(near.sum()), 4)
    return sp.csr_matrix((shares[near].ravel(), (at, corners[near].ravel())), shape=(near.sum(), len(place)))


def _meeting(place, height, one, other):
    """Pairs (p, i), (p, j) of the elements one (a, i) and other (b, j) whose boxes meet in place (k, 2), the first of
    which comes higher than the other or nearly so."""
    space = np.append(place, height[:, None], axis=1)
    a, b = space[one], space[other]
    low, high, least, most = a.min(axis=1), a.max(axis=1), b.min(axis=1), b.max(axis=1)
    order = np.argsort(least[:, 0])
    longest = (most[:, 0] - least[:, 0]).max(initial=0.0)
    first = np.searchsorted(least[order, 0], low[:, 0] - longest)
    count = np.searchsorted(least[order, 0], high[:, 0], side="right") - first
    i = np.repeat(np.arange(len(one)), count)
    j = order[np.arange(len(i)) + np.repeat(first - np.append(0, np.cumsum(count)[:-1]), count)]
    for keep in (
        lambda i, j: high[i, 2] > least[j, 2] - _NEAR_MM,
        lambda i, j: (most[j, 0] >= low[i, 0]) & (least[j, 1] <= high[i, 1]) & (most[j, 1] >= low[i, 1]),
    ):
        kept = keep(i, j)
        i, j = i[kept], j[kept]
    return one[i], other[j]


def along_line(wanted, places, values):
    """Values (k,) at places along the axis, read at wanted; flat beyond the ends."""
    order = np.argsort(places)
    return np.interp(wanted, places[order], values[order])
