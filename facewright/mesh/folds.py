"""Faces that lie upside down in what is around them, and how to lay them flat."""

from __future__ import annotations

import numpy as np

from facewright.mesh.adjacency import differing, dilate, touching, within
from facewright.mesh.normals import cross, dot, face_areas, face_corners, face_cross, face_normals, lengths

_HARDLY_TURNED = 0.85  # cosine: a face turned by less than 32 degrees does not lie upside down in what is around it
_LEAST_SHARE = 0.1  # of its area at rest that a face keeps, seen along the normal that it should have
_POLAR_STEPS, _POLAR_SURE = 7, 1e-9  # to a rotation, and what its two last estimates may differ by
_RINGS = 3  # around folds that may give way
_SWEEPS = 25  # between two looks at what should look where
_STEP, _FARTHEST = 0.2, 1.5  # of an edge: how far a vertex gives way in a sweep, and in all


def folded_by_shape(neutral, moved, faces, mask=None):
    """Indices of faces turned by more than 90 degrees against the neutral after the best rotation around them.

    neutral, moved (n, 3); faces (m, 3); mask (m,) bool limits the faces asked about. The rotation around a face is
    fitted to the corners of all faces that share a vertex with it (Kabsch). Only faces that turn at all are asked.
    """
    stirred = touching(differing(moved, neutral), faces)
    asked = np.flatnonzero(stirred if mask is None else stirred & mask)
    turned = dot(face_normals(neutral, faces[asked]), face_normals(moved, faces[asked])) < _HARDLY_TURNED
    asked = asked[turned]
    if not len(asked):
        return asked
    expected = expected_normals(neutral, moved, faces, asked)
    return asked[dot(expected, face_normals(moved, faces[asked])) < 0]


def expected_normals(neutral, moved, faces, asked):
    """(k, 3) normals of the faces `asked` at rest, turned as what is around each has turned."""
    touched = np.zeros(len(neutral), bool)
    touched[faces[asked]] = True
    covariance = _vertex_covariance(neutral, moved, faces[touching(touched, faces)])
    return least_turn(covariance[faces[asked]].sum(axis=1), face_normals(neutral, faces[asked]))


def least_turn(covariance, vectors):
    """(k, 3) vectors turned by the rotations that bring (rest)(now)^T, summed up (k, 3, 3), best together (Kabsch)."""
    turns, found = _nearest_rotations(np.ascontiguousarray(np.moveaxis(covariance, 0, 2)))
    result = np.einsum("jik,kj->ki", turns, vectors)
    hard = np.flatnonzero(~found)
    if len(hard):
        U, _, Vt = np.linalg.svd(covariance[hard])
        flip = np.linalg.det(U @ Vt) < 0
        U[flip, :, 2] *= -1
        result[hard] = np.einsum("mji,mj->mi", U @ Vt, vectors[hard])
    return result


def _nearest_rotations(matrices):
    """(3, 3, k) rotations nearest to matrices (3, 3, k), and (k,) bool where they have been found.

    Newton's steps to the polar factor (Higham 1986), in 0.4 of the time that singular value decompositions take.
    What is added first, the cofactors of a matrix of unit size, turns its least direction so that hardly any is
    mirrored; those that still are count as not found.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        X = matrices / np.sqrt((matrices * matrices).sum(axis=(0, 1)))
        X = X + _cofactors(X)
        for rounds_left in reversed(range(_POLAR_STEPS)):
            Y = _cofactors(X)
            determinant = (X[0] * Y[0]).sum(axis=0)
            Y /= determinant
            if rounds_left:
                scale = ((Y * Y).sum(axis=(0, 1)) / (X * X).sum(axis=(0, 1))) ** 0.25
                X = 0.5 * (scale * X + Y / scale)
        return X, (np.abs(X - Y).max(axis=(0, 1)) < _POLAR_SURE) & (determinant > 0.0)


def _cofactors(matrices):
    """(3, 3, k) cofactors of matrices (3, 3, k)."""
    result = np.empty_like(matrices)
    for i in range(3):
        for j in range(3):
            result[i, j] = matrices[i - 2, j - 2] * matrices[i - 1, j - 1]
            result[i, j] -= matrices[i - 2, j - 1] * matrices[i - 1, j - 2]
    return result


def _vertex_covariance(neutral, moved, faces):
    """(n, 3, 3) sums over the faces at a vertex of (rest edge)(moved edge)^T."""
    total = np.zeros((len(neutral), 3, 3))
    rest, now = face_corners(neutral, faces), face_corners(moved, faces)
    edges = ((0, 1), (1, 2), (2, 0))
    outer = sum((rest[b] - rest[a])[:, :, None] * (now[b] - now[a])[:, None, :] for a, b in edges)
    for corner in range(3):
        np.add.at(total, faces[:, corner], outer)
    return total


def laid_flat(neutral, moved, faces, mobility, *, rounds=12):
    """Vertices (n, 3) of a pose in which folded faces are turned back, moving as little as that takes.

    Each face around a fold keeps a tenth of its area, seen along the normal that it should have; what is missing is
    shared out among its corners by the area's gradient, again and again (position-based constraints: Mueller et al.
    2007). mobility (n,) 0..1: how readily a vertex gives way. Where nothing is folded, moved itself is returned
    """
    folded = folded_by_shape(neutral, moved, faces, touching(mobility != 0.0, faces))
    if not len(folded):
        return moved
    near = np.zeros(len(moved), bool)
    near[faces[folded]] = True
    near = dilate(near, faces, _RINGS)
    # What is expected of a face depends on the ring around it, which is looked at and stays.
    around = dilate(near, faces, 1)
    used, local = np.unique(faces[within(around, faces)], return_inverse=True)
    local = local.reshape(-1, 3)
    rest, start, ease = neutral[used], moved[used], np.where(near, mobility, 0.0)[used]
    asked_about = within(near[used], local)
    asked = np.flatnonzero(asked_about)
    area = face_areas(rest, local[asked])
    edge, least = float(np.sqrt(2.0 * area.mean())), _LEAST_SHARE * area
    now, best, fewest = start, start, len(folded)
    for _ in range(rounds):
        normals = expected_normals(rest, now, local, asked)
        for _ in range(_SWEEPS):
            way = _way_back(now, local[asked], normals, least, ease)
            if way is None:
                break
            now = start + _shortened(now + _shortened(way, _STEP * edge) - start, _FARTHEST * edge)
        left = len(folded_by_shape(rest, now, local, asked_about))
        if left < fewest:
            best, fewest = now, left
        if not left:
            break
    result = np.array(moved)
    result[used] = best
    return result


def _shortened(vectors, longest):
    """Rows of vectors no longer than that."""
    length = lengths(vectors)[:, None]
    return vectors * np.minimum(1.0, longest / np.maximum(length, 1e-12))


def _way_back(points, faces, normals, least, ease):
    """(n, 3) steps that spread faces (k, 3) whose area along normals (k, 3) is under least (k,), or None."""
    area = 0.5 * dot(face_cross(points, faces), normals)
    small = np.flatnonzero(area < least)
    if not len(small):
        return None
    F, n = faces[small], normals[small]
    a, b, c = face_corners(points, F)
    gradient = 0.5 * np.stack([cross(b - c, n), cross(c - a, n), cross(a - b, n)], axis=1)
    w = ease[F]
    size = (w * (gradient**2).sum(axis=2)).sum(axis=1)
    able = size > 1e-12
    step = np.where(able, (least - area)[small] / np.where(able, size, 1.0), 0.0)
    total, count = np.zeros_like(points), np.zeros(len(points))
    np.add.at(total, F, (step[:, None] * w)[:, :, None] * gradient)
    np.add.at(count, F, 1.0)
    return total / np.maximum(count, 1.0)[:, None]
