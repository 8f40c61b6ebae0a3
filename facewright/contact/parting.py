"""Faces that cross are moved apart, a few hundredths of a millimetre: what is left when lips and lids have been solved.

Contact asks vertices, and stops at a depth that nobody sees; edges of the small faces at a corner of the mouth and in
shut lids still pass through each other. Here the pairs of faces that cross are found exactly and moved apart along the
normals between them, as far as they reach past each other (position-based constraints: Mueller et al. 2007), until none
crosses. What goes on crossing is crumpled: its motion is made smooth in space as far as that helps, and it is moved
apart again. Which of two sheets belongs in front is known of an upper lip and a lower one. Else it is told by the
winding number: between skins that meet it is that of flesh on either side of the crossing; between a skin and its own
lining, turned inside out, that of air. Asked of lips too, a thin one that has crumpled is sent through the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from facewright.mesh.adjacency import differing, dilate, touching
from facewright.mesh.ease import eased
from facewright.mesh.folds import folded_by_shape, laid_flat
from facewright.mesh.intersect import intersections_of, self_intersections
from facewright.mesh.laplacian import lumped_mass
from facewright.mesh.normals import lengths, max_norms, normalized, vertex_normals
from facewright.mesh.overlap import crossing_points, overlap_along
from facewright.mesh.winding import winding_numbers

_FOLD = 10.0  # crossings that a folded face counts as
_FLAT_ROUNDS = 3
_STILL_MM, _ABOUT_MM, _DEEP_MM = 1e-4, 1.0, 0.2


@dataclass(frozen=True)
class PartingOptions:
    """gap_mm    left between faces that have been moved apart
    most_mm   by which a pair is moved at once
    aside_mm  from a crossing: there flesh is asked for
    opposed   length of the difference of two normals from which on it says along which way faces part
    rings     of faces around a vertex of a lip whose normals count as its own where it parts from the other lip
    across    length of the difference of two such normals from which on lips may also part along one of the two
    shorter   share of the other way out at which one is taken whatever lies there
    least_act where the correction acts less it is taken to act so much, or it would grow large for the rest
    patience  rounds of looking for crossings without one that leaves fewer; sweeps over what has been found, in each
    eased_mm  widths within which motion is made smooth around crossings that stay, one after the other; eased_shares of
              the way there that are tried; eased_rings of faces around such a crossing that hang together with it;
              eased_patience as before
    """

    gap_mm: float = 0.005
    most_mm: float = 0.15
    aside_mm: float = 0.005
    opposed: float = 0.2
    rings: int = 10
    across: float = 0.6
    shorter: float = 1 / 3
    least_act: float = 0.25
    patience: int = 6
    sweeps: int = 6
    eased_mm: tuple[float, ...] = (1.0, 2.0, 0.5)
    eased_shares: tuple[float, ...] = (0.25, 0.5, 0.75, 1.0)
    eased_rings: int = 6
    eased_patience: int = 3


class Parting:
    """The skin of one head, asked for crossings in any pose of it that it has not at rest.

    vertices (n, 3) mm at rest, faces (m, 3); near (m,) bool: faces that may cross; asked (m,) bool: one of a pair
    farthest (n,) mm by which vertices are moved at most; farther (n,) mm: at a second try, where crossings are left
    sides    two (n,) bool: an upper and a lower lip; one meets the other, but is no lining of it
    """

    def __init__(self, vertices, faces, near, asked, farthest, sides=(), farther=None, options=None):
        self.options = options or PartingOptions()
        self.used, local = np.unique(faces[near], return_inverse=True)
        self.faces = np.ascontiguousarray(local.reshape(-1, 3))
        self.rest, self.asked, self._n = vertices[self.used], asked[near], len(vertices)
        self._farthest = farthest[self.used, None]
        self._farther = None if farther is None else farther[self.used, None]
        self._mass = lumped_mass(self.rest, self.faces)
        self._ring = _mean_of_ring(self.faces, len(self.used))
        self._side = np.zeros(len(self.faces), int)  # 1 and 2 for faces of the two sides
        for number, side in enumerate(sides, start=1):
            self._side[side[self.used][self.faces].all(axis=1)] = number
        self._before = self._keys(self_intersections(self.rest, self.faces))
        # What is left out here would close these faces: in front of the skin at rest there is no flesh.
        outside = self.rest + self.options.aside_mm * vertex_normals(self.rest, self.faces)
        self._beyond = -np.asarray(igl.fast_winding_number(self.rest, self.faces, outside)).reshape(-1)

    def __call__(self, poses, acts, ways_out, still=None, clean=0, on_way=0, left=()):
        """(n, 3) correction of a shape after which none of its poses has new crossings, or as few as could be.

        poses  sequence of (n, 3); acts: how strongly the correction acts in each, a number or (n, 1)
        ways_out  for each a function of points (k, 3): their ways (k, 3) out of what skin must not enter
        still  (n,) bool: vertices that stay where they are
        clean  how many poses, the last ones, are known to have none: they are asked about where the correction acts
        on_way how many poses, the last ones, lie on the way to others: there only solids count
        left   the poses as contact has left them, where corrections have been made since that may have taken skin into
               solids when they came together; default: the poses
        """
        farthest = self._farthest if still is None else np.where(still[self.used, None], 0.0, self._farthest)
        asked = [(pose[self.used], self._cut(act), way_out) for pose, act, way_out in zip(poses, acts, ways_out)]

        def fresh():
            poses = [_Pose(*each) for each in asked]
            for pose, first in zip(poses, left):
                pose.left = first[self.used]
            for pose in poses[len(poses) - on_way :]:
                pose.on_way = True
            for pose in poses[len(poses) - clean :]:
                pose.looked = pose.skin(np.zeros_like(self.rest))
            return poses

        tried = fresh()
        field, faults = self._solved(tried, farthest)
        if faults and self._farther is not None:
            farther = np.where(farthest > 0.0, self._farther, 0.0)
            met = np.concatenate([pose.met for pose in tried])
            if (farther > farthest)[self.faces[met]].any():
                other, of_other = self._solved(fresh(), farther)
                field = other if of_other < 0.5 * faults else field
        return self._of_skin(field)

    def _solved(self, poses, farthest):
        """A field (k, 3), nowhere longer than farthest (k, 1), that leaves the fewest faults, and how many."""
        field, faults = self._parted(poses, np.zeros_like(self.rest), farthest, self.options.patience)
        for width in self.options.eased_mm:
            other = self._eased(poses, field, farthest, width) if faults else None
            if other is None:
                break
            other, of_other = self._parted(poses, other, farthest, self.options.eased_patience)
            if of_other < faults:
                field, faults = other, of_other
        return field, faults

    def _parted(self, poses, field, farthest, patience):
        """A field (k, 3), from the given one on, that leaves the fewest faults, and how many."""
        best, fewest, waited = field, np.inf, 0
        while waited < patience:
            faults = self._faults(poses, field)
            if not faults:
                return field, 0
            waited += 1
            if faults < fewest:
                best, fewest, waited = field, faults, 0
            for pose in poses:
                for correction in (self._apart, self._flat, self._out):
                    field = _within(field + correction(pose, field), farthest)
        return best, fewest

    def _faults(self, poses, field):
        """Crossings of poses, what corrections take into solids and, where faces have crossed, folded ones too."""
        left = sum(self._look(pose, field) for pose in poses)
        folds = sum(self._folds(pose, field) for pose in poses if len(pose.met))
        return left + _FOLD * folds + sum(self._deep(pose, field) for pose in poses)

    def _deep(self, pose, field):
        """Number of vertices that corrections take deep into what they must not enter."""
        return int((lengths(pose.way_back(field)[1]) > _DEEP_MM).sum())

    def _eased(self, poses, field, farthest, width):
        """(k, 3) a field with that share of smoother motion around the crossings that leaves the fewest faults.

        None where nothing crosses.
        """
        if not sum(self._look(pose, field) for pose in poses):
            return None
        way = np.zeros_like(field)
        for pose in poses:
            if len(pose.pairs):
                way += self._smoothly(pose, field, width) / np.maximum(pose.act, self.options.least_act)
        ways = [_within(field + share * way, farthest) for share in self.options.eased_shares]
        return min(ways, key=lambda field: self._faults(poses, field))

    def _smoothly(self, pose, field, width):
        """(k, 3) what makes the motion of a pose smooth around its crossings; only what hangs together with one counts,
        or an open mouth would be drawn shut."""
        crossing = np.zeros(len(field), bool)
        crossing[self.faces[pose.pairs]] = True
        among = dilate(crossing, self.faces, self.options.eased_rings)
        return eased(self.rest, self._mass, pose.skin(field) - self.rest, crossing, width, among)

    def _of_skin(self, field):
        result = np.zeros((self._n, 3))
        result[self.used] = field
        return result

    def _cut(self, act):
        return act[self.used] if np.ndim(act) else np.full((len(self.used), 1), float(act))

    def _keys(self, pairs):
        return pairs[:, 0] * len(self.faces) + pairs[:, 1]

    def _look(self, pose, field):
        """Number of new crossings of a pose; those found are remembered with their sense."""
        if pose.on_way:
            return 0
        now = pose.skin(field)
        if pose.looked is None:
            stirred = max_norms(now - self.rest) > _STILL_MM
            pairs = self_intersections(now, self.faces, self._about(now, stirred)) if stirred.any() else pose.pairs
        else:
            touched = touching(differing(now, pose.looked), self.faces)
            kept = pose.pairs[~touched[pose.pairs].any(axis=1)]
            pairs = np.concatenate([kept, intersections_of(now, self.faces, touched)]) if touched.any() else kept
        pairs = pairs[self.asked[pairs].any(axis=1)]
        pairs = pairs[~np.isin(self._keys(pairs), self._before)]
        pose.looked, pose.pairs = now, pairs
        fresh = pairs[~np.isin(self._keys(pairs), self._keys(pose.met))]
        if len(fresh):
            pose.met = np.concatenate([pose.met, fresh])
            pose.senses = self._senses(now, pose)
        return len(pairs)

    def _about(self, now, stirred):
        """(m,) bool: faces of vertices that are stirred or lie among those."""
        low, high = now[stirred].min(axis=0) - _ABOUT_MM, now[stirred].max(axis=0) + _ABOUT_MM
        return touching(stirred | ((now > low) & (now < high)).all(axis=1), self.faces)

    def _folds(self, pose, field):
        """Number of folded faces of a pose among those that the correction moves."""
        moved = touching(differing(field, 0.0), self.faces)
        return len(folded_by_shape(self.rest, pose.skin(field), self.faces, moved))

    def _flat(self, pose, field):
        """(k, 3) what turns back faces of a pose that have been folded."""
        if not len(pose.met):
            return 0.0
        now = pose.skin(field)
        flat = laid_flat(self.rest, now, self.faces, np.ones(len(now)), rounds=_FLAT_ROUNDS)
        return (flat - now) / np.maximum(pose.act, self.options.least_act)

    def _out(self, pose, field):
        """(k, 3) what takes vertices of a pose back that corrections take into what they must not enter."""
        moved, back = pose.way_back(field)
        way = np.zeros_like(field)
        way[moved] = back
        return way / np.maximum(pose.act, self.options.least_act)

    def _ways_apart(self, now, pose):
        """(k, 3) unit ways along which the first faces of pairs met may not reach past the second ones, and (n,) which
        of all pairs met have one."""
        ways = self._ways(now, pose.met)
        known = lengths(ways) > self.options.opposed
        ways, pairs = normalized(ways[known]), pose.met[known]
        lips = self._of_both_lips(pairs)
        if lips.any():
            ways[lips] = self._ways_of_lips(now, *self.faces[pairs[lips].T])
        return ways * pose.senses[known, None], known

    def _ways_of_lips(self, now, a, b):
        """(k, 3) unit ways along which faces a (k, 3) of one lip part from faces b (k, 3) of the other: away from one
        of the two or from both, whichever is the shortest.

        The skin around says where a face looks: at the edge of a thin lip each of its sides would push the other lip
        its own way, and a slit would open.
        """
        normals = vertex_normals(now, self.faces)
        for _ in range(self.options.rings):
            normals = self._ring @ normals
        one, other = (normalized(normals[corners].mean(axis=1)) for corners in (a, b))
        ways = np.stack([normalized(one - other), one, -other])
        depths = np.array([overlap_along(now[a], now[b], way)[0] for way in ways])
        depths[np.isneginf(depths)] = np.inf  # they do not lie over each other along it
        depths[1:, lengths(one - other) < self.options.across] = np.inf
        return ways[depths.argmin(axis=0), np.arange(len(a))]

    def _of_both_lips(self, pairs):
        """(k,) bool of pairs (k, 2): one face of each side."""
        return self._side[pairs].prod(axis=1) == 2

    def _ways(self, now, pairs):
        """(k, 3) from the first face of each pair to the second, in the mean of what their corners look along."""
        normals = vertex_normals(now, self.faces)
        return normals[self.faces[pairs[:, 0]]].mean(axis=1) - normals[self.faces[pairs[:, 1]]].mean(axis=1)

    def _flesh(self, now, pairs):
        """(k,) winding number on either side of a crossing: 1 where two skins meet, 0 of a skin and its own lining."""
        one, other = (now[self.faces[pairs[:, i]]] for i in (0, 1))
        points = crossing_points(one, other) + self.options.aside_mm * normalized(self._ways(now, pairs))
        return winding_numbers(now, self.faces, points) + self._beyond[self.faces[pairs]].mean(axis=(1, 2))

    def _senses(self, now, pose):
        """(k,) of all pairs met: 1 where two skins meet, -1 where a skin has come through its own lining.

        Pairs that hang together are one crossing and decide together, lips that meet for all around them, the first
        ones for all that come later. Where one way out is much shorter than the other it is taken; else flesh decides.
        """
        met, (one, other) = pose.met, self._side[pose.met].T
        senses, known = np.ones(len(met)), self._of_both_lips(met)
        senses[: len(pose.senses)], known[: len(pose.senses)] = pose.senses, True
        apart = len(self.faces) * ((one == other) & (one > 0))  # a lip in itself does not hang together with the rest
        _, ends = np.unique(met + apart[:, None], return_inverse=True)
        a, b = ends.reshape(-1, 2).T
        count = ends.max() + 1
        links = sp.coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
        label = connected_components(links, directed=False)[1][a]
        votes = np.bincount(label[known], senses[known], minlength=count)
        new = np.flatnonzero(~known & (votes[label] == 0.0))
        if len(new):
            votes = votes + self._votes(now, met[new], label[new], count)
        senses[~known] = np.where(votes > 0.0, 1.0, -1.0)[label[~known]]
        return senses

    def _votes(self, now, pairs, label, count):
        """(count,) of each crossing: more than 0 where its pairs (k, 2), labelled (k,), are skins that meet."""
        ways, (a, b) = normalized(self._ways(now, pairs)), self.faces[pairs.T]
        votes, deep = np.zeros(count), np.zeros((2, count))
        for most, way in zip(deep, (ways, -ways)):
            np.maximum.at(most, label, overlap_along(now[a], now[b], way)[0])
        for sign, (one, other) in ((1.0, deep), (-1.0, deep[::-1])):
            votes[one < self.options.shorter * other] = sign
        unsure = votes[label] == 0.0
        if unsure.any():
            flesh = np.clip(self._flesh(now, pairs[unsure]), 0.0, 1.0)
            votes += np.bincount(label[unsure], flesh - 0.5, minlength=count)
        return votes

    def _apart(self, pose, field):
        """(k, 3) what moves apart the faces that have crossed so far in a pose."""
        start = now = pose.skin(field)
        if not len(pose.pairs):
            return np.zeros_like(field)
        ways, known = self._ways_apart(now, pose)
        a, b = self.faces[pose.met[known].T]
        for _ in range(self.options.sweeps):
            depth, at, there = overlap_along(now[a], now[b], ways)
            hit = depth > -self.options.gap_mm
            if not hit.any():
                break
            push = np.minimum(depth[hit] + self.options.gap_mm, self.options.most_mm)
            at, there = at[hit], there[hit]
            push /= (at**2).sum(axis=1) + (there**2).sum(axis=1)
            corners = np.concatenate([a[hit], b[hit]])
            share = np.concatenate([at, there])
            step = np.concatenate([-push, push])[:, None] * np.tile(ways[hit], (2, 1))
            total, count = np.zeros_like(now), np.zeros(len(now))
            np.add.at(total, corners, share[..., None] * step[:, None])
            np.add.at(count, corners, share)
            now = now + total / np.maximum(count, 1.0)[:, None]
        return (now - start) / np.maximum(pose.act, self.options.least_act)


def _mean_of_ring(faces, n):
    """(n, n) csr that takes the mean over the faces (m, 3) around each vertex of the mean of their corners."""
    corners = sp.coo_matrix((np.ones(faces.size), (faces.ravel(), np.arange(faces.size) // 3)), (n, len(faces))).tocsr()
    both = corners @ corners.T
    return sp.diags(1.0 / np.asarray(both.sum(axis=1)).ravel()) @ both


def _within(field, farthest):
    """A field (k, 3) no longer anywhere than farthest (k, 1)."""
    return field * np.minimum(1.0, farthest / np.maximum(lengths(field)[:, None], 1e-12))


class _Pose:
    """What is known of one pose: crossings now, all pairs met with their senses, and how deep skin lay in solids."""

    def __init__(self, vertices, act, way_out):
        self._vertices, self.act, self._way_out = vertices, act, way_out
        self.left, self.on_way = vertices, False
        self.looked, self.pairs, self.met = None, np.empty((0, 2), np.int64), np.empty((0, 2), np.int64)
        self.senses, self._depth = np.empty(0), np.full(len(vertices), np.nan)

    def skin(self, field):
        return self._vertices + self.act * field

    def way_back(self, field):
        """Vertices (m,) that corrections move, and ways (m, 3) by which they lie deeper in solids than contact left
        them."""
        now = self.skin(field)
        moved = np.flatnonzero(differing(now, self.left))
        if not len(moved):
            return moved, np.zeros((0, 3))
        fresh = moved[np.isnan(self._depth[moved])]
        if len(fresh):
            self._depth[fresh] = lengths(self._way_out(self.left[fresh]))
        way = self._way_out(now[moved])
        depth = lengths(way)
        return moved, way * (np.maximum(depth - self._depth[moved], 0.0) / np.maximum(depth, 1e-12))[:, None]
