"""Shapes whose blends fold no face: what no shape does by itself, two or three of them may do together.

A face that keeps a third of its area in one shape and a half in another may lie upside down where both play, and one
that turns between two in-betweens half way. Such faces are few. They are asked in a sample of poses that is the same
for every head: shapes on their way, pairs with a corrective, looks with lids half shut, blends of expressions and
visemes. Where one folds or nearly does, the shapes at fault are changed by the least motion, shared out by how much
they play there, that leaves it open in all of these. Edges and what lies around are linear in the weights, so a few
faces in many poses are one product of matrices.

Tried: what is missing of a face shared out pose by pose until none is missing (0.39 mm where the least motion needs
0.11, other faces folded by it); blends alone as the sample, 1,000 of them (folds stay where a lid half shut meets a
look); margins of lids that give way to nothing (a face between three of their vertices stays folded); every two
expressions blended twice (no fold fewer on three of four heads).
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from facewright.contact.blend_poses import plain_poses, sample_poses, together
from facewright.contact.targets import is_even
from facewright.expand import expand_weights
from facewright.mesh.adjacency import dilate, face_components, touching
from facewright.mesh.folds import expected_normals, folded_by_shape, least_turn
from facewright.mesh.intersect import intersections_of
from facewright.mesh.normals import cross, dot, face_corners, face_cross, lengths, max_norms, normalized
from facewright.solve.least_motion import least_motion
from facewright.transfer.shapes import CORRECTIVE_BASE, even_handed

_AROUND_MM = 8.0  # from a face that is opened: what it may come to cross
_BLINKS = "eyeBlinkLeft", "eyeBlinkRight"
_SUSPECT = 0.5  # of its area at rest, seen as it should look: less of a face in one shape makes it suspect
_EVERY = 2  # pose of the sample in which they are asked whether they are at risk
_SOUND = 0.25, 0.45  # the same, and cosine, from which on a face is not asked more closely
_AT_RISK, _AT_RISK_TURN = 0.15, 0.35  # share of its area, and cosine, of a face that may come to fold
_NEAR = 0.3, 0.6  # the same of a face in a pose that is asked again while shapes change
_SHARE, _TURN, _BESIDE = 0.06, 0.2, (0.9, 0.3)  # what a face at risk keeps; one beside it: of its own, and at most
_LEAST_TURN, _LACKING = 0.1, 0.2  # of any face; share of what it should keep whose lack counts
_SEAM_EASE, _MARGIN_EASE = 0.2, 0.03  # how readily the lips' line and margins of lids give way; the rest: 1
_SLACK = 0.03
_STILL_MM, _STIRRED_MM = 1e-4, 0.02
_ROUNDS, _PATIENCE, _WORST = 6, 2, 12  # of solving, and without gain; poses that are asked more of a face in each


def lay_blends_flat(face, targets):
    """Targets of a data.Face in whose blends no face of the skin outside the inner mouth folds, as far as the sample
    of poses can tell; those in which none comes near to it are returned as they are."""
    skin = _Skin(face, targets)
    weights = skin.weights(sample_poses(targets))
    touched = np.zeros(len(skin.V), bool)
    risk = np.zeros(len(skin.faces), bool)
    for patch in skin.patches(skin.suspects()):
        risk[patch] = skin.faces_of(patch).at_risk(weights[::_EVERY])
    touched[skin.faces[risk]] = True
    touched = dilate(touched, skin.faces)
    ease = skin.ease * touched
    patches = [skin.faces_of(patch) for patch in skin.patches(np.flatnonzero(touching(touched, skin.faces)))]
    plain = skin.weights(plain_poses(targets))

    def opened(patch):
        """What opens the faces of a patch and makes nothing cross where no blends play; else without the lids' own."""
        held = skin.held[patch.played]
        for may_change in (np.ones(len(held), bool), ~held)[: 1 + held.any()]:
            change = patch.opened(weights, risk[patch.asked], may_change[:, None] * ease[patch.used])
            if not change.any() or skin.stays_sound(patch, change, plain):
                return change
        return np.zeros_like(patch.deltas)

    changes = [(patch, opened(patch)) for patch in patches]
    result = skin.changed(changes)
    return result.evened(face.template.mirror) if changes and is_even(face) else result


class _Skin:
    """The skin of a face with all its targets."""

    def __init__(self, face, targets):
        skin = face.template.skin
        self.at, self.targets = skin.vertex_slice, targets
        self.V = face.vertices[self.at]
        self.all_faces = face.template.faces[skin.face_slice]
        inner = face.regions["mouth_interior"][self.at]
        self.faces = even_handed(self.all_faces[~inner[self.all_faces].any(axis=1)], face.template.mirror)[0]
        self.names = [*targets.names, *targets.extras]
        self.deltas = [targets.delta(name)[self.at] for name in self.names]
        # Shut lids lie a hundredth of a millimetre apart, and what has brought them there is hard to change.
        shut = {name: drivers for name, drivers in targets.correctives.items() if set(drivers) & set(_BLINKS)}
        self.held = np.isin(self.names, [*_BLINKS, *shut, *(driver for pair in shut.values() for driver in pair)])
        self.ease = np.ones(len(self.V))
        for name, line in face.lines.items():
            if name.startswith("lip_seam"):
                self.ease[line] = _SEAM_EASE
            elif name.startswith("lid_"):
                self.ease[line] = _MARGIN_EASE
            elif name == "neck_ring":
                self.ease[line] = 0.0

    def weights(self, poses):
        """(p, t) weights of the targets that play poses."""
        index = {name: i for i, name in enumerate(self.names)}
        result = np.zeros((len(poses), len(self.names)))
        for row, pose in zip(result, poses):
            for name, weight in expand_weights(pose, self.targets.in_betweens, self.targets.correctives).items():
                row[index[name]] = weight
        return result

    def suspects(self):
        """(k,) indices of faces that some shape or in-between leaves little of, seen as they should look."""
        rest = face_cross(self.V, self.faces)
        area, found = dot(rest, rest), np.zeros(len(self.faces), bool)
        for motion in self._stops():
            stirred = max_norms(motion) > _STIRRED_MM
            near = np.flatnonzero(touching(stirred, self.faces) & ~found)
            now = face_cross(self.V + motion, self.faces[near])
            small = near[dot(now, rest[near]) < _SUSPECT * area[near]]
            if len(small):
                moved = self.V + motion
                normals = expected_normals(self.V, moved, self.faces, small)
                seen = dot(face_cross(moved, self.faces[small]), normals)
                found[small[seen < _SUSPECT * np.sqrt(area[small])]] = True
        return np.flatnonzero(found)

    def _stops(self):
        """(n, 3) motions of the skin by each shape and each in-between, both eyes at once."""
        motion = dict(zip(self.names, self.deltas))
        for names in together(self.targets.names):
            base = [motion[CORRECTIVE_BASE[name]] for name in names if CORRECTIVE_BASE.get(name) in motion]
            steps = [sorted(self.targets.in_betweens.get(name, {}).items()) for name in names]
            for stop in zip(*([*(target for _, target in own), name] for own, name in zip(steps, names))):
                yield sum((motion[target] for target in stop), sum(base, 0.0))

    def patches(self, asked):
        """List of (k,) indices of faces, of those asked, that hang together by their corners."""
        corners = self.faces[asked]
        _, local = np.unique(corners, return_inverse=True)
        local = local.reshape(-1, 3)
        label = face_components(local, local.max(initial=-1) + 1) if len(asked) else asked
        return [asked[label == one] for one in np.unique(label)]

    def faces_of(self, asked):
        """The _Faces of indices (k,), their vertices numbered anew, with the targets that move them."""
        touched = np.zeros(len(self.V), bool)
        touched[self.faces[asked]] = True
        ring = self.all_faces[touching(touched, self.all_faces)]
        used, local = np.unique(ring, return_inverse=True)
        deltas = np.array([delta.take(used, axis=0) for delta in self.deltas])
        played = np.flatnonzero(np.abs(deltas).max(axis=(1, 2)) > _STILL_MM)
        faces = np.searchsorted(used, self.faces[asked])
        return _Faces(asked, used, played, self.V[used], deltas[played], faces, local.reshape(-1, 3))

    def stays_sound(self, patch, change, weights):
        """Whether a change (t, n, 3) of a patch's deltas lets nothing more cross or fold around it in any of the poses
        of all targets' weights (p, s)."""
        moving = patch.played[change.any(axis=(1, 2))]
        near = cKDTree(self.V[patch.used]).query(self.V, distance_upper_bound=_AROUND_MM)[0] < _AROUND_MM
        used, faces = np.unique(self.all_faces[touching(near, self.all_faces)], return_inverse=True)
        faces, place = np.ascontiguousarray(faces.reshape(-1, 3)), np.searchsorted(used, patch.used)
        deltas = np.array([delta.take(used, axis=0) for delta in self.deltas])
        rest, moved = self.V[used], np.zeros(len(used), bool)
        moved[place] = change.any(axis=(0, 2))
        touched = touching(moved, faces)

        def faults(pose):
            return len(intersections_of(pose, faces, touched)) + len(folded_by_shape(rest, pose, faces, touched))

        for row in weights[weights[:, moving].any(axis=1)]:
            before = rest + np.tensordot(row, deltas, 1)
            after = before.copy()
            after[place] += np.tensordot(row[patch.played], change, 1)
            left = faults(after)
            if left and left > faults(before):
                return False
        return True

    def changed(self, changes):
        """The Targets with changes [(_Faces, (t, n, 3) of the deltas of its vertices)]."""
        targets = self.targets
        deltas, extras = np.array(targets.deltas), dict(targets.extras)
        for patch, change in changes:
            for i, own in zip(patch.played, change):
                if not own.any():
                    continue
                name = self.names[i]
                if i >= len(deltas) and extras[name] is targets.extras[name]:
                    extras[name] = np.array(extras[name])
                whole = deltas[i] if i < len(deltas) else extras[name]
                whole[self.at][patch.used] += own
        return replace(targets, deltas=deltas, extras=extras)


class _Faces:
    """Some faces of a skin in blends of its targets.

    asked (k,) faces and used (n,) vertices of the skin, played (t,) targets that move them: their indices; at rest
    (n, 3), deltas (t, n, 3); faces (k, 3) asked and ring (r, 3), all that touches them, as indices into used
    """

    def __init__(self, asked, used, played, rest, deltas, faces, ring):
        self.asked, self.used, self.played = asked, used, played
        self.rest, self.deltas, self.faces = rest, deltas, faces
        self._covariance = _ring_covariance(rest, faces, ring)
        cross_at_rest = face_cross(rest, faces)
        self._area, self._normal = lengths(cross_at_rest), normalized(cross_at_rest)
        a, b, _ = face_corners(rest, faces)
        along = normalized(b - a)
        self._tangents = along, cross(self._normal, along)

    def _look(self, weights, change=0.0):
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
        area = np.tile(self._area, len(weights))
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
        along, turn, _ = self._look(self._moving(weights))
        return ((along < _AT_RISK * self._area) | (turn < _AT_RISK_TURN)).any(axis=0)

    def opened(self, weights, risk, ease):
        """(t, n, 3) changes of the deltas that keep faces open in poses of all targets' weights (p, s).

        risk (k,) bool: faces at risk, which are to stay well open; the others stay as open as they are, or nearly so.
        ease 0..1: how readily a vertex (n,), or it in each target (t, n), gives way. The least faults of some rounds
        """
        weights = self._moving(weights)
        along, turn, _ = self._look(weights)
        near = (along < _NEAR[0] * self._area) | (turn < _NEAR[1])
        poses, faces = near.any(axis=1), near.any(axis=0)
        if not faces.any():
            return np.zeros_like(self.deltas)
        beside = np.clip(_BESIDE[0] * turn, _LEAST_TURN, _BESIDE[1])
        least = np.where(risk, _TURN, beside)[poses][:, faces]
        return self._only(faces)._solved(weights[poses], risk[faces], least, ease)

    def _only(self, mask):
        """Those _Faces of a mask (k,)."""
        result = copy(self)
        result.asked, result.faces = self.asked[mask], self.faces[mask]
        result._area, result._normal = self._area[mask], self._normal[mask]
        result._tangents = tuple(way[mask] for way in self._tangents)
        result._covariance = self._covariance[np.repeat(mask, 3)]
        return result

    def _solved(self, weights, risk, least, ease):
        """As opened, of poses of the own targets' weights (p, t) and least cosines of turns (p, k)."""
        ease = (np.abs(self.deltas).max(axis=2) > _STILL_MM) * ease
        root, change, pairs = np.sqrt(ease)[:, :, None], np.zeros_like(self.deltas), np.zeros((0, 2), np.int64)
        motion, best, fewest, idle = change, change, None, 0
        for rounds_left in reversed(range(_ROUNDS)):
            along, turn, normal = self._look(weights, change)
            size = along / np.where(turn == 0.0, 1e-12, turn)
            wanted = np.maximum(least * size, _SHARE * risk * self._area)
            lack = wanted - along
            lacking = lack > _LACKING * wanted
            faults = (int((along < 0.0).sum()), int(lacking.sum()))
            if fewest is None or faults < fewest:
                best, fewest, idle = change, faults, 0
            else:
                idle += 1
            if not lacking.any() or not rounds_left or idle == _PATIENCE:
                break
            pairs = np.unique(np.append(pairs, _worst(lack / np.sqrt(self._area), lack > 0.0), axis=0), axis=0)
            pose, face = pairs.T
            rows = self._rows(weights, change, pose, face, normal[pose, face], root)
            length = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
            able = length > 1e-3 * np.sqrt(self._area[face])
            rows = (sp.diags(1.0 / length[able]) @ rows[able]).tocsr()
            over = lack[pose, face][able] / length[able] - rows @ motion.ravel()
            columns, local = np.unique(rows.indices, return_inverse=True)
            short = sp.csr_matrix((rows.data, local, rows.indptr), (rows.shape[0], len(columns)))
            motion = np.zeros_like(self.deltas)
            motion.ravel()[columns] = least_motion(short, over, np.ones(len(columns)), _SLACK)
            change = root * motion
        return best

    def _rows(self, weights, change, pose, face, normal, root):
        """(q, 3 t n) csr: how much less is seen of faces (q,) in poses (q,) as deltas, over root (t, n, 1), grow."""
        corners = self.faces[face]
        full = self.deltas + change
        points = [self.rest[corners[:, i]] + _played(weights, full, pose, corners[:, i]) for i in range(3)]
        gradient = np.stack([cross(points[i - 2] - points[i - 1], normal) for i in range(3)], axis=1)
        row, target = np.nonzero(weights[pose])
        at = corners[row]
        value = -(weights[pose][row, target, None] * root[target[:, None], at, 0])[:, :, None] * gradient[row]
        column = ((target[:, None] * len(self.rest) + at) * 3)[:, :, None] + np.arange(3)
        shape = len(pose), self.deltas.size
        result = sp.csr_matrix((value.ravel(), (np.repeat(row, 9), column.ravel())), shape=shape)
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
