"""Deformation transfer: the motion of one head carried to another of the same topology.

Sumner and Popovic 2004, "Deformation Transfer for Triangle Meshes", in the form of one Poisson system (Botsch et al.
2006): each source triangle says how it turns and stretches, S_f; the target's triangles are asked to do the same, and
the vertices follow in the least-squares sense. What differs from the papers:

- the unknowns are displacements, so that a triangle that does not move costs nothing and vertices can be held at zero;
- no fourth vertex: S_f takes the unit normal to the unit normal. The papers scale it by the root of the area's growth,
  which at the corners of the mouth (triangles grow tenfold when the jaw opens) would throw the lips forward;
- residuals weigh by the target's triangle areas, so the result does not depend on how densely a part is meshed;
- the source is first turned onto the target by the best rotation, so a rigid motion of either head commutes;
- pairs of vertices that are not joined by an edge can be linked: lashes to lids, one lid margin to the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from facewright.mesh.normals import face_areas, face_normals, normalized
from facewright.solve.procrustes import best_rotation
from facewright.solve.quadratic import Factorization

_THINNEST = 1e-3  # of the sum of squared edges: a thinner triangle's area counts as this (equilateral: 0.144)
_FLATTEST = 1e-6  # squared area over squared sum of squared edges, below which a source triangle's map is damped
_SMALL_GAP_MM = 0.5  # two linked vertices closer than this have no direction worth following


@dataclass(frozen=True)
class Links:
    """Pairs of vertices whose relation is carried as if an edge joined them.

    pairs   (l, 2) vertex indices
    weights (l,) like a cotangent: 1 pulls as much as an edge of an equilateral mesh
    by_gap  motion between the two counts in lengths of their gap (what closes it on the source closes it on the
            target); else in sizes of the heads
    """

    pairs: np.ndarray
    weights: np.ndarray
    by_gap: bool = True


def _target_edges_in_source_frames(source, target, faces):
    """(m, 2, 3) coefficients of each target edge pair (ab, ac) in the source's frame (ab, ac, unit normal).

    Solved for the difference to the source's own edges, damped for slivers only: a source triangle without area does
    no harm, and a target equal to the source gets exactly (1, 0, 0) and (0, 1, 0).
    """
    E = np.stack([source[faces[:, 1]] - source[faces[:, 0]], source[faces[:, 2]] - source[faces[:, 0]]], axis=1)
    T = np.stack([target[faces[:, 1]] - target[faces[:, 0]], target[faces[:, 2]] - target[faces[:, 0]]], axis=1)
    normals = face_normals(source, faces)
    gram = np.einsum("fid,fjd->fij", E, E)
    size = gram[:, 0, 0] + gram[:, 1, 1] + 1e-30
    flatness = np.linalg.det(gram) / size**2  # at most 0.25
    damping = np.maximum(_FLATTEST - flatness, 0.0) * size
    damped = gram + damping[:, None, None] * np.eye(2)
    projected = np.einsum("fjd,fid->fji", T - E, E)  # (m, target edge, source edge)
    in_plane = np.eye(2) + projected @ np.linalg.inv(damped)
    out_of_plane = np.einsum("fjd,fd->fj", T, normals)
    return np.concatenate([in_plane, out_of_plane[:, :, None]], axis=2)


def _cotangents(V, F):
    """(m, 3) half cotangents of the angles at the corners, areas of slivers bounded from below."""
    a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    dots = np.stack([((b - a) * (c - a)).sum(1), ((a - b) * (c - b)).sum(1), ((a - c) * (b - c)).sum(1)], axis=1)
    squared_edges = 2 * dots.sum(axis=1)
    double_area = 2 * np.maximum(face_areas(V, F), _THINNEST * squared_edges)
    return 0.5 * dots / np.maximum(double_area, 1e-30)[:, None]


def _sparse(rows, columns, values, shape):
    return sp.coo_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()


def _pair_laplacian(pairs, weights, n):
    i, j = pairs[:, 0], pairs[:, 1]
    rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
    return _sparse(rows, columns, np.concatenate([weights, weights, -weights, -weights]), (n, n))


def nearest_links(source, faces, fixed, weight=1.0):
    """Links that tie every loose component (one without a held vertex) to what is held: lashes to lids.

    Each loose vertex is linked to its nearest vertex of the held components; the weight falls with the square of
    their distance (source (n, 3), mm), so that the root of a lash is led and its tip follows the lash.
    """
    n = len(source)
    joins = sp.coo_matrix((np.ones(2 * len(faces)), (faces[:, :2].ravel(), faces[:, 1:].ravel())), shape=(n, n))
    labels = connected_components(joins, directed=False)[1]
    loose = ~np.isin(labels, labels[fixed])
    if not loose.any():
        return Links(np.zeros((0, 2), np.int64), np.zeros(0))
    held = np.flatnonzero(~loose)
    distance, nearest = cKDTree(source[held]).query(source[loose])
    return Links(np.stack([np.flatnonzero(loose), held[nearest]], axis=1), weight / (1 + distance**2))


class DeformationTransfer:
    """One head made ready to take over any number of shapes of another head of the same topology.

    Minimises, over displacements x of the target with x = 0 where fixed,
        sum_f area_f |grad x - (S_f - 1) grad target|^2  +  sum_l w_l |x_i - x_j - M_l (d_i - d_j)|^2
    with S_f the source triangle's affine map, d the source's deltas, M_l the rotation and scale that take the source's
    gap between two linked vertices to the target's.

    source, target (n, 3) mm, faces (m, 3); fixed (n,) bool: never moves (at least one vertex)
    links   tuple of Links; nearest_links are added for components without a fixed vertex
    rotation (3, 3) that turns the source onto the target; default: the best one for what moves
    face_weights (m,) factors on the areas, default 1
    cost    one sparse Cholesky factorisation; see bench/transfer.py
    """

    def __init__(self, source, target, faces, *, fixed, links=(), rotation=None, face_weights=None):
        source, target = np.asarray(source, float), np.asarray(target, float)
        faces, fixed = np.asarray(faces), np.asarray(fixed, bool)
        _check(source, target, faces, fixed)
        n = len(source)
        face_weights = np.ones(len(faces)) if face_weights is None else np.asarray(face_weights, float)
        areas = face_areas(target, faces) * face_weights
        moving_faces = ~fixed[faces].all(axis=1)
        weights = np.bincount(faces.ravel(), weights=np.repeat(areas * moving_faces, 3), minlength=n)
        if rotation is None:
            rotation = best_rotation(source, target, weights if weights.any() else None)
        self.rotation = rotation
        self.source = source @ self.rotation.T
        self.faces, self._face_weights = faces[moving_faces], face_weights[moving_faces]
        self.fixed = fixed
        self._normals = face_normals(self.source, self.faces)
        links = (*links, nearest_links(source, faces, fixed))
        self._pairs = np.concatenate([link.pairs for link in links])
        self._pair_weights = np.concatenate([link.weights for link in links])
        self._pair_by_gap = np.concatenate([np.full(len(link.pairs), link.by_gap) for link in links])
        self._set_up(target, ~fixed)

    def _set_up(self, target, free):
        """Factor the Poisson matrix and make the operators that turn source motion into right-hand sides."""
        n, faces, pairs = len(target), self.faces, self._pairs
        half_cot = _cotangents(target, faces) * self._face_weights[:, None]
        w_bc, w_ac, w_ab = half_cot[:, 0], half_cot[:, 1], half_cot[:, 2]
        # Rows a, b, c of a face; columns: the wanted displacement differences along ab and ac.
        divergence = np.stack([-w_ab, -w_ac, w_ab + w_bc, -w_bc, -w_bc, w_ac + w_bc], axis=1).reshape(-1, 3, 2)
        P = divergence @ _target_edges_in_source_frames(self.source, target, faces)  # (m, 3, 3): ab, ac, normal
        rows, columns = np.repeat(faces, 3, axis=1), np.tile(faces, (1, 3))
        on_corners = np.stack([-P[:, :, 0] - P[:, :, 1], P[:, :, 0], P[:, :, 1]], axis=2)
        self._from_vertices = _sparse(rows, columns, on_corners, (n, n))
        self._from_normals = P[:, :, 2]  # (m, 3 corners)
        signs = np.tile(self._pair_weights, 2) * np.repeat([1.0, -1.0], len(pairs))
        self._from_gaps = _sparse(pairs.T, np.tile(np.arange(len(pairs)), 2), signs, (n, len(pairs)))
        self._gap_maps = _gap_maps(self.source, target, pairs, self._pair_by_gap)
        laplacian = np.concatenate([-divergence.sum(axis=2, keepdims=True), divergence], axis=2)
        matrix = _sparse(rows, columns, laplacian, (n, n)) + _pair_laplacian(pairs, self._pair_weights, n)
        self._from_held = matrix[free][:, ~free]
        self._factor = Factorization(matrix[free][:, free]) if free.any() else None

    def transfer(self, deltas, held=None):
        """Carry deltas (k, n, 3) mm of the source to the target: (k, n, 3) mm.

        held (k, n, 3): how the fixed vertices of the target move, known from elsewhere; default: not at all
        """
        deltas = np.asarray(deltas, float)
        if deltas.ndim != 3 or deltas.shape[1:] != self.source.shape:
            raise ValueError(f"deltas: expected (k, {len(self.source)}, 3), got {deltas.shape}")
        result = np.zeros(deltas.shape)
        if held is not None:
            result[:, self.fixed] = held[:, self.fixed]
        if self._factor is None or not len(deltas):
            return result
        rhs = np.empty((int((~self.fixed).sum()), len(deltas), 3))
        for k, delta in enumerate(deltas):
            rhs[:, k] = self._right_hand_side(delta)
        rhs = rhs.reshape(len(rhs), -1)
        if held is not None:
            known = result[:, self.fixed].transpose(1, 0, 2)
            rhs -= self._from_held @ known.reshape(len(known), -1)
        solution = self._factor.solve(rhs)
        result[:, ~self.fixed] = solution.reshape(len(solution), -1, 3).transpose(1, 0, 2)
        return result

    def _right_hand_side(self, delta):
        """(free vertices, 3) of one shape (n, 3) of the source; faces at rest are skipped."""
        delta = delta @ self.rotation.T
        rhs = self._from_vertices @ delta
        moving = (delta[:, 0] != 0) | (delta[:, 1] != 0) | (delta[:, 2] != 0)
        a, b, c = self.faces.T
        at = np.flatnonzero(moving[a] | moving[b] | moving[c])
        faces = self.faces[at]
        push = self._from_normals[at][:, :, None] * self._normal_change(at, delta)[:, None, :]  # (a, corner, 3)
        for axis in range(3):
            rhs[:, axis] += np.bincount(faces.ravel(), weights=push[:, :, axis].ravel(), minlength=len(rhs))
        if len(self._pairs):
            gaps = delta[self._pairs[:, 0]] - delta[self._pairs[:, 1]]
            rhs += self._from_gaps @ np.einsum("lij,lj->li", self._gap_maps, gaps)
        return rhs[~self.fixed]

    def _normal_change(self, at, delta):
        """(a, 3) change of the unit normals of faces at (a,); none where a face collapses."""
        corners = (self.source + delta)[self.faces[at]]
        normals = normalized(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        collapsed = ~normals.any(axis=1)
        change = normals - self._normals[at]
        change[collapsed] = 0.0
        return change


def _gap_maps(source, target, pairs, by_gap):
    """(l, 3, 3) rotation times scale that takes source[i] - source[j] to target[i] - target[j].

    Where not by_gap (l,), or where a gap is next to nothing and has no direction, the scale of the heads' sizes.
    """
    a = source[pairs[:, 0]] - source[pairs[:, 1]]
    b = target[pairs[:, 0]] - target[pairs[:, 1]]
    length_a, length_b = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
    overall = np.linalg.norm(target - target.mean(axis=0)) / np.linalg.norm(source - source.mean(axis=0))
    maps = np.tile(overall * np.eye(3), (len(pairs), 1, 1))
    clear = by_gap & (np.minimum(length_a, length_b) > _SMALL_GAP_MM)
    u, v = a[clear] / length_a[clear, None], b[clear] / length_b[clear, None]
    axis, cosine = np.cross(u, v), (u * v).sum(axis=1)
    turn = np.zeros((len(u), 3, 3))
    turn[:, [2, 0, 1], [1, 2, 0]] = axis
    turn -= turn.transpose(0, 2, 1)
    # Rodrigues for the shortest turn; 1 + cosine is 0 only for opposite gaps, which no two heads have.
    rotation = np.eye(3) + turn + turn @ turn / np.maximum(1 + cosine, 1e-6)[:, None, None]
    maps[clear] = rotation * (length_b[clear] / length_a[clear])[:, None, None]
    return maps


def _check(source, target, faces, fixed):
    if source.shape != target.shape or source.ndim != 2 or source.shape[1] != 3:
        raise ValueError(f"deformation transfer needs one topology: source {source.shape}, target {target.shape}")
    if fixed.shape != (len(source),) or not fixed.any():
        raise ValueError(f"fixed: expected ({len(source)},) bool with at least one vertex held, got {fixed.shape}")
    if faces.ndim != 2 or faces.shape[1] != 3 or (len(faces) and faces.max() >= len(source)):
        raise ValueError(f"faces: expected (m, 3) into {len(source)} vertices, got {faces.shape}")


def deformation_transfer(source, target, faces, deltas, *, fixed=None, links=()):
    """Carry per-vertex deltas from one head to another of the same topology (see DeformationTransfer).

    source, target (n, 3) mm; faces (m, 3); deltas (k, n, 3) mm from source; not modified
    fixed   (n,) bool, never moves; default: the vertices that no shape moves
    returns (k, n, 3) mm from target; onto itself it gives the deltas back
    """
    deltas = np.asarray(deltas, float)
    if fixed is None:
        fixed = ~deltas.any(axis=(0, 2))
    return DeformationTransfer(source, target, faces, fixed=fixed, links=links).transfer(deltas)
