"""Faces of blended shapes kept open by the least motion, without letting what lies around cross or fold.

Edges and what lies around a face are linear in the weights, so a few faces in many poses are one product of matrices.
What a face lacks in a pose is shared out over the shapes by how much they play there: the least motion that leaves none
lacking in any pose. Where lids are shut or near it such a change lets faces cross or fold around. Pairs that would
cross are kept on either side of a plane that lies between them now, which is linear too, and faces that would fold are
asked with the others, in the same least motion, until nothing does.

Tried: changes that let shut lids cross given up and made again without the lids' own shapes (0.4 to 0.9 mm of a blink
on its way where 0.1 to 0.3 do together, and folds left); where a face should look told roughly wherever it looks so by
45 degrees (at the corners of lids 0.6 instead of -0.1: rounds swing to and fro).
"""

from __future__ import annotations

from copy import copy
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import touching
from facewright.mesh.folds import folded_by_shape, least_turn
from facewright.mesh.intersect import intersections_of
from facewright.mesh.normals import cross, dot, face_corners, face_cross, lengths, normalized
from facewright.solve.least_motion import least_motion

_AROUND_MM, _FAR_MM, _MEETS_MM = 8.0, 25.0, 2.0  # from faces that are opened: what they may come to cross, from rest on
# and, of what is no farther at rest, in a pose: lids of wide eyes meet from afar
_SOUND = 0.5, 0.9  # share of its area, and cosine with where it should look, from which on a face is surely open
_AT_RISK, _AT_RISK_TURN = 0.15, 0.35  # share of its area, and cosine, of a face that may come to fold
_NEAR = 0.3, 0.6  # the same of one in a pose that is asked again while shapes change
_SHARE, _TURN, _BESIDE = 0.06, 0.2, (0.9, 0.3)  # what a face at risk keeps; one beside it: of its own, and at most
_LEAST_TURN, _LACKING = 0.1, 0.2  # of any face; share of what it should keep whose lack counts
_SLACK = 0.03
_STIFF = 1e-4  # length of a wish that hardly any motion can meet
_KEPT_APART = 0.25  # of their distance, by which two faces stay off a plane half way between them: they keep half of it
_ROUNDS, _WORST = 10, 12  # of solving; poses that are asked more of a face in each
_PATIENCE, _PATIENCE_OPEN = 4, 2  # rounds without gain, and once no face is folded
_STILL_MM = 1e-4
# What gives way no more readily than this, as margins of lids do, moves no farther, or is made that much stiffer.
_STIFF_EASE, _STIFF_MM, _STIFFER = 0.1, 0.1, 0.2


class Faces:
    """Some faces of a skin in blends of its targets.

    asked (k,) faces and used (n,) vertices of the skin, played (t,) targets that move them: their indices; at rest
    (n, 3), deltas (t, n, 3); faces (k, 3) asked and ring (r, 3), all that touches them, as indices into used
    """

    def __init__(self, asked, used, played, rest, deltas, faces, ring):
        self.asked, self.used, self.played = asked, used, played
        self.rest, self.deltas, self.faces = rest, deltas, faces
        self._covariance = _ring_covariance(rest, faces, ring)
        cross_at_rest = face_cross(rest, faces)
        self.area, self._normal = lengths(cross_at_rest), normalized(cross_at_rest)
        a, b, _ = face_corners(rest, faces)
        along = normalized(b - a)
        self._tangents = along, cross(self._normal, along)

    def look(self, weights, change=0.0):
        """Of each face in each pose (p, k): its doubled area seen along the normal that it should have, the cosine of
        its turn away from that, and that normal (p, k, 3)."""
        motion = np.append(self.rest[None], self.deltas + change, axis=0)
        full = np.append(np.ones((len(weights), 1)), weights, axis=1)

        def played(vectors):
            return (full @ vectors.reshape(len(vectors), -1)).reshape(-1, 3)

        a, b, c = (motion[:, self.faces[:, i]] for i in range(3))
        around = self._around(motion)
        doubled = cross(played(b - a), played(c - a))
        # Where two ways along the face at rest have gone with what is around it says roughly where it should look.
        ways = (played((way[:, None, :] @ around)[:, :, 0]) for way in self._tangents)
        normal = normalized(cross(*ways))
        area = np.tile(self.area, len(weights))
        size, along = lengths(doubled), dot(doubled, normal)
        unsure = np.flatnonzero((along < _SOUND[0] * area) | (along < _SOUND[1] * size))
        pose, face = np.divmod(unsure, len(self.faces))
        normal[unsure] = self._expected(full, around, pose, face)
        along[unsure] = dot(doubled[unsure], normal[unsure])
        shape = len(weights), len(self.faces)
        return along.reshape(shape), (along / np.maximum(size, 1e-12)).reshape(shape), normal.reshape(*shape, 3)

    def _around(self, motion):
        """(t, k, 3, 3) sums of (rest edge)(edge)^T of what touches each face, of motions (t, n, 3)."""
        t, n, _ = motion.shape
        sums = self._covariance @ np.ascontiguousarray(motion.transpose(1, 0, 2)).reshape(n, -1)
        return np.ascontiguousarray(sums.reshape(-1, 3, t, 3).transpose(2, 0, 1, 3))

    def _expected(self, full, around, pose, face):
        """(q, 3) normals of faces at rest, turned as what is around them has turned in poses."""
        covariance = np.empty((len(pose), 3, 3))
        order = np.argsort(face, kind="stable")
        for mine in np.split(order, np.flatnonzero(np.diff(face[order])) + 1):
            k = face[mine[0]] if len(mine) else 0
            covariance[mine] = (full[pose[mine]] @ around[:, k].reshape(-1, 9)).reshape(-1, 3, 3)
        return least_turn(covariance, self._normal[face])

    def _moving(self, weights):
        """(q, t) those of the weights (p, all targets) of poses that move these faces."""
        mine = weights[:, self.played]
        return mine[mine.any(axis=1)]

    def at_risk(self, weights):
        """(k,) bool: faces that fold in a pose of all targets' weights (p, s), or come near to it."""
        along, turn, _ = self.look(self._moving(weights))
        return ((along < _AT_RISK * self.area) | (turn < _AT_RISK_TURN)).any(axis=0)

    def opened(self, weights, risk, ease, around):
        """(t, n, 3) changes of the deltas that keep faces open in poses of all targets' weights (p, s).

        risk (k,) bool: faces at risk, which are to stay well open; the others stay as open as they are, or nearly so.
        ease (n,) 0..1: how readily a vertex gives way; around: the Surroundings, which stay sound. The least faults of
        some rounds
        """
        weights = np.concatenate([self._moving(weights), around.weights])
        opening = _Opening(self, weights, risk, ease, around)
        return opening.change() if opening.faces.any() else np.zeros_like(self.deltas)

    def only(self, mask):
        """Those Faces of a mask (k,)."""
        result = copy(self)
        result.asked, result.faces = self.asked[mask], self.faces[mask]
        result.area, result._normal = self.area[mask], self._normal[mask]
        result._tangents = tuple(way[mask] for way in self._tangents)
        result._covariance = self._covariance[np.repeat(mask, 3)]
        return result

    def rows(self, weights, change, pose, face, normal, root):
        """(q, 3 t n) csr: how much less is seen of faces (q,) in poses (q,) as deltas, over root (t, n, 1), grow."""
        corners = self.faces[face]
        full = self.deltas + change
        points = [self.rest[corners[:, i]] + _played(weights, full, pose, corners[:, i]) for i in range(3)]
        gradient = np.stack([cross(points[i - 2] - points[i - 1], normal) for i in range(3)], axis=1)
        return _as_rows(weights[pose], corners, -gradient, root)


class Surroundings:
    """What lies around Faces that change, in poses of all targets' weights (p, s): what they may come to cross.

    free (n,) bool: vertices of the patch that may give way; vertices (v, 3) of the whole skin at rest, faces (m, 3),
    deltas: list of (v, 3) of all targets. What is near is looked for once something changes
    """

    def __init__(self, patch, free, vertices, faces, deltas, weights):
        moving = weights[:, patch.played].any(axis=1)
        self.weights = weights[moving][:, patch.played]
        self._near = partial(_Near, patch.used, free, vertices, faces, deltas, weights[moving])
        self._before, self._met = {}, np.zeros((0, 3), np.int64)

    @cached_property
    def near(self):
        """The _Near of the patch."""
        return self._near()

    def unsound(self, change):
        """Whether more crosses or folds in some pose as deltas change by (t, n, 3); what crosses is remembered."""
        near, result = self.near, False
        touched = touching(near.own >= 0, near.faces)

        def faults(pose):
            folded = folded_by_shape(near.rest, pose, near.faces, touched)
            return intersections_of(pose, near.faces, near.moving), len(folded)

        for k, (row, before) in enumerate(zip(self.weights, near.poses)):
            motion = np.tensordot(row, change, 1)
            if not motion.any():
                continue
            after = before.copy()
            after[near.place] += motion
            pairs, folds = faults(after)
            if not len(pairs) and not folds:
                continue
            if k not in self._before:
                self._before[k] = faults(before)
            had, folded = self._before[k]
            result |= len(pairs) + folds > len(had) + folded
            key = [len(near.faces), 1]
            fresh = np.insert(pairs[~np.isin(pairs @ key, had @ key)], 0, k, axis=1)
            self._met = np.unique(np.append(self._met, fresh, axis=0), axis=0)
        return result

    def walls(self, root):
        """(q, 3 t n) csr and (q,): of corners of faces that have come to cross, how far they go past a plane between
        the two, as deltas, over root (t, n, 1), grow, and how far they are past it without a change."""
        if not len(self._met):
            return sp.csr_matrix((0, 3 * root.size)), np.zeros(0)
        pose, *pair = self._met.T
        corners = [self.near.faces[face] for face in pair]
        points = [self.near.poses[pose[:, None], of_one] for of_one in corners]
        way, middle, gap = _between(*points)
        sign = np.repeat([-1.0, 1.0], 3)
        past = sign * ((np.concatenate(points, axis=1) @ way[:, :, None])[:, :, 0] - middle[:, None])
        past = (past + _KEPT_APART * gap[:, None])[gap > 0.0].ravel()
        row = np.repeat(np.flatnonzero(gap > 0.0), 6)
        own = self.near.own[np.concatenate(corners, axis=1)][gap > 0.0].reshape(-1, 1)
        gradient = np.tile(sign, len(own) // 6)[:, None] * way[row]
        return _as_rows(self.weights[pose[row]], own, gradient[:, None], root), past


class _Near:
    """What lies near the vertices used (n,) of a patch: faces (m, 3) of its own vertices, these at rest (v, 3) and in
    poses (p, v, 3), place (n,) of the patch's vertices among them, own (v,) the other way round or -1, moving (m,)
    bool: faces that touch a free one. The rest as for Surroundings; deltas, weights (p, t): of all targets.
    """

    def __init__(self, used, free, vertices, faces, deltas, weights):
        def posed(chosen):
            return vertices[chosen] + np.tensordot(weights, [delta.take(chosen, axis=0) for delta in deltas], 1)

        reach = cKDTree(vertices[used]).query(vertices, distance_upper_bound=_FAR_MM)[0]
        near, far = reach < _AROUND_MM, np.flatnonzero(np.isfinite(reach))
        poses, patch = posed(far), np.searchsorted(far, used)
        low, high = (end(poses[:, patch], axis=1, keepdims=True) for end in (np.min, np.max))
        beside = ((poses > low - _MEETS_MM) & (poses < high + _MEETS_MM)).all(axis=2) & ~near[far]
        for pose, asked in zip(poses, beside):
            met = cKDTree(pose[patch]).query(pose[asked], distance_upper_bound=_MEETS_MM)[0] < _MEETS_MM
            near[far[asked][met]] = True
        around, faces = np.unique(faces[touching(near, faces)], return_inverse=True)
        self.faces, self.place = np.ascontiguousarray(faces.reshape(-1, 3)), np.searchsorted(around, used)
        self.rest, self.poses = vertices[around], posed(around)
        self.own = np.full(len(around), -1)
        self.own[self.place] = np.arange(len(used))
        self.moving = touching(np.isin(np.arange(len(around)), self.place[free]), self.faces)


def _between(one, other):
    """Of pairs of triangles (q, 3, 3) that do not cross the plane that parts them best: unit normals (q, 3), towards
    the first, places along these (q,) and (q,) the distance from one to the other along them, less than 0: none."""
    (a, b, c), (d, e, f) = (np.moveaxis(triangle, 1, 0) for triangle in (one, other))
    sides = [(b - a, c - b, a - c), (e - d, f - e, d - f)]
    ways = [cross(x, y) for x, y in (sides[0][:2], sides[1][:2])] + [cross(x, y) for x in sides[0] for y in sides[1]]
    ways = normalized(np.stack(ways + [-way for way in ways], axis=1))
    low, high = (one @ np.swapaxes(ways, 1, 2)).min(axis=1), (other @ np.swapaxes(ways, 1, 2)).max(axis=1)
    widest = (low - high).argmax(axis=1)[:, None]
    low, high = (np.take_along_axis(ends, widest, axis=1)[:, 0] for ends in (low, high))
    return np.take_along_axis(ways, widest[:, :, None], axis=1)[:, 0], 0.5 * (low + high), low - high


class _Opening:
    """The least change of the deltas of Faces that keeps them open in poses, and what lies around sound."""

    def __init__(self, patch, weights, risk, ease, around):
        self.patch, self.around = patch, around
        ease = (np.abs(patch.deltas).max(axis=2) > _STILL_MM) * ease
        self.root = np.sqrt(ease)[:, :, None]
        self.stiff = ease.max(axis=0) < _STIFF_EASE
        along, turn, _ = patch.look(weights)
        near = (along < _NEAR[0] * patch.area) | (turn < _NEAR[1])
        poses, self.faces = near.any(axis=1), near.any(axis=0)
        poses[len(poses) - len(around.weights) :] = True
        self.weights, self.risk = weights[poses], risk
        self.least = np.where(risk, _TURN, np.clip(_BESIDE[0] * turn[poses], _LEAST_TURN, _BESIDE[1]))

    def change(self):
        """(t, n, 3) changes of deltas, those with the least faults of some rounds."""
        best = change = motion = np.zeros_like(self.patch.deltas)
        pairs, fewest, last, idle = np.zeros((0, 2), np.int64), None, None, 0
        for rounds_left in reversed(range(_ROUNDS)):
            strays = self._strays(change)
            if strays:
                # A gap between shut lids is seen, a face that stays folded at their corners is not.
                self.root[:, self.stiff] *= _STIFFER
                change = motion = np.zeros_like(change)
            lack, faults = self._lack(change)
            better = fewest is None or faults < fewest
            unsound = better and change.any() and self.around.unsound(change)
            if better and not unsound:
                best, fewest, idle = change, faults, 0
            elif not strays:
                idle += 1
            if unsound and self._watches_more(change):
                lack, _ = self._lack(change)
            if fewest == (0, 0) or not rounds_left or idle == (_PATIENCE if fewest[0] else _PATIENCE_OPEN):
                break
            pairs = np.unique(np.append(pairs, _worst(lack / np.sqrt(self.patch.area), lack > 0.0), axis=0), axis=0)
            before, motion = motion, self._motion(change, motion, pairs, lack)
            if last and faults[0] > last[0]:
                motion = 0.5 * (motion + before)  # or it swings to and fro
            change, last = self.root * motion, faults
        return best

    def _strays(self, change):
        """Whether a change moves what is stiff too far in some pose."""
        return lengths(np.tensordot(self.weights, change[:, self.stiff], 1)).max(initial=0.0) > _STIFF_MM

    def _lack(self, change):
        """(p, k) what is missing of faces under a change, and the numbers of faces that are folded and that lack."""
        lack = np.full((len(self.weights), len(self.faces)), -np.inf)
        along, turn, self._normals = self.patch.only(self.faces).look(self.weights, change)
        size = along / np.where(turn == 0.0, 1e-12, turn)
        share = _SHARE * (self.risk * self.patch.area)[self.faces]
        wanted = np.maximum(self.least[:, self.faces] * size, share)
        lack[:, self.faces] = wanted - along
        return lack, (int((along < 0.0).sum()), int((wanted - along > _LACKING * wanted).sum()))

    def _watches_more(self, change):
        """Whether faces fold around that have not been watched; they are from now on."""
        folded = (self.patch.look(self.around.weights, change)[0] < 0.0).any(axis=0)
        more = folded & ~self.faces
        self.faces = self.faces | folded
        return more.any()

    def _motion(self, change, motion, pairs, lack):
        """(t, n, 3) least motion, of which root is the change, that leaves nothing missing of pairs (q, 2) of pose and
        face, from what is missing (p, k) under a change and its motion."""
        pose, face = pairs.T
        normals = self._normals[pose, np.cumsum(self.faces)[face] - 1]
        rows = self.patch.rows(self.weights, change, pose, face, normals, self.root)
        rows, over = _of_unit_length(rows, lack[pose, face] - rows @ motion.ravel())
        walls, past = _of_unit_length(*self.around.walls(self.root))
        rows, over = sp.vstack([rows, walls]).tocsr(), np.append(over, past)
        columns, local = np.unique(rows.indices, return_inverse=True)
        short = sp.csr_matrix((rows.data, local, rows.indptr), (rows.shape[0], len(columns)))
        result = np.zeros_like(motion)
        result.ravel()[columns] = least_motion(short, over, np.ones(len(columns)), _SLACK)
        return result


def _of_unit_length(rows, over):
    """Rows (q, m) csr and over (q,), divided by the length of each row; without those that hardly anything can meet."""
    length = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    able = length > _STIFF
    return (sp.diags(1.0 / length[able]) @ rows[able]).tocsr(), over[able] / length[able]


def _as_rows(weights, corners, gradient, root):
    """(q, 3 t n) csr of gradients (q, c, 3) at corners (q, c) in poses of weights (q, t), -1: a corner that stays; root
    (t, n, 1) times each."""
    n = root.shape[1]
    row, corner, target = np.nonzero((corners >= 0)[:, :, None] & (weights != 0.0)[:, None, :])
    at = corners[row, corner]
    value = (weights[row, target] * root[target, at, 0])[:, None] * gradient[row, corner]
    column = ((target * n + at) * 3)[:, None] + np.arange(3)
    result = sp.csr_matrix((value.ravel(), (np.repeat(row, 3), column.ravel())), (len(corners), 3 * root.size))
    result.eliminate_zeros()
    return result


def _played(weights, deltas, pose, vertex):
    """(q, 3) motions of vertices (q,) in poses (q,)."""
    return np.einsum("qt,tqd->qd", weights[pose], deltas[:, vertex])


def _worst(lack, asked):
    """(q, 2) pose and face: of each face the poses in which it lacks most, of those asked; lack, asked (p, k)."""
    order = np.argsort(np.where(asked, -lack, np.inf), axis=0, kind="stable")[:_WORST]
    face = np.broadcast_to(np.arange(lack.shape[1]), order.shape)
    kept = np.take_along_axis(asked, order, axis=0)
    return np.stack([order[kept], face[kept]], axis=1)


def _ring_covariance(rest, faces, ring):
    """(3k, n) csr that takes vertices to the sums of (rest edge)(edge)^T over the corners of what touches each face,
    as mesh.folds has them."""
    n, m = len(rest), len(ring)
    corners = face_corners(rest, ring)
    share = np.zeros((m, 3, 3))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        edge = corners[b] - corners[a]
        share[:, :, b] += edge
        share[:, :, a] -= edge
    column = np.broadcast_to(ring[:, None], (m, 3, 3))
    of_face = sp.csr_matrix((share.ravel(), (np.repeat(np.arange(3 * m), 3), column.ravel())), shape=(3 * m, n))
    touch = sp.csr_matrix((np.ones(3 * m), (ring.ravel(), np.repeat(np.arange(m), 3))), shape=(n, m))
    mine = sp.csr_matrix((np.ones(faces.size), (np.repeat(np.arange(len(faces)), 3), faces.ravel())), (len(faces), n))
    return (sp.kron(mine @ touch, sp.eye(3)) @ of_face).tocsr()
