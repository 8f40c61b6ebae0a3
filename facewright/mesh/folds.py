"""Faces that lie upside down in what is around them, and how to lay them flat."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import dilate, vertex_adjacency
from facewright.mesh.normals import face_normals

_HARDLY_TURNED = 0.85  # cosine: a face turned by less than 32 degrees does not lie upside down in what is around it

_PATIENCE = 5
_AROUND = 9  # rings around folds that smoothing may reach


def folded_by_shape(neutral, moved, faces, mask=None):
    """Indices of faces turned by more than 90 degrees against the neutral after the best rotation around them.

    neutral, moved (n, 3); faces (m, 3); mask (m,) bool limits the faces asked about. The rotation around a face is
    fitted to the corners of all faces that share a vertex with it (Kabsch). Only faces that turn at all are asked.
    """
    turned = (face_normals(neutral, faces) * face_normals(moved, faces)).sum(axis=1) < _HARDLY_TURNED
    asked = np.flatnonzero(turned if mask is None else turned & mask)
    if not len(asked):
        return asked
    touched = np.zeros(len(neutral), bool)
    touched[faces[asked]] = True
    covariance = _vertex_covariance(neutral, moved, faces[touched[faces].any(axis=1)])
    around = covariance[faces[asked]].sum(axis=1)  # (k, 3, 3)
    U, _, Vt = np.linalg.svd(around)
    flip = np.linalg.det(U @ Vt) < 0
    U[flip, :, 2] *= -1
    expected = np.einsum("mij,mj->mi", np.swapaxes(U @ Vt, 1, 2), face_normals(neutral, faces[asked]))
    return asked[(expected * face_normals(moved, faces[asked])).sum(axis=1) < 0]


def _vertex_covariance(neutral, moved, faces):
    """(n, 3, 3) sums over the faces at a vertex of (rest edge)(moved edge)^T."""
    total = np.zeros((len(neutral), 3, 3))
    outer = sum(
        (neutral[faces[:, b]] - neutral[faces[:, a]])[:, :, None]
        * (moved[faces[:, b]] - moved[faces[:, a]])[:, None, :]
        for a, b in ((0, 1), (1, 2), (2, 0))
    )
    for corner in range(3):
        np.add.at(total, faces[:, corner], outer)
    return total


def neighbour_mean(faces, n, lines=()):
    """(n, n) csr: the middle of each vertex's neighbours. Inner vertices of lines have only each other for neighbours,
    so that a line stays smooth."""
    A = vertex_adjacency(faces, n).tocoo()
    inner = np.zeros(n, bool)
    rows, columns = [], []
    for line in lines:
        inner[line[1:-1]] = True
        rows += [line[1:-1], line[1:-1]]
        columns += [line[:-2], line[2:]]
    kept = ~inner[A.row]
    rows, columns = np.concatenate([A.row[kept], *rows]), np.concatenate([A.col[kept], *columns])
    W = sp.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()
    return (sp.diags(1.0 / np.maximum(np.asarray(W.sum(axis=1)).ravel(), 1.0)) @ W).tocsr()


def laid_flat(neutral, moved, faces, keep, mean, *, rounds=40, step=0.5):
    """Vertices (n, 3) of a pose in which folded faces are smoothed with their neighbours until none is left.

    keep (n,) bool: vertices that stay; mean: neighbour_mean of the mesh. A round moves each vertex of a fold by `step`
    of its way to the middle of its neighbours. Where nothing is folded, moved itself is returned
    """
    loose = ~keep[faces].all(axis=1)
    folded = folded_by_shape(neutral, moved, faces, loose)
    if not len(folded):
        return moved
    near = np.zeros(len(moved), bool)
    near[faces[folded]] = True
    near = dilate(near, faces, _AROUND)
    used, local = np.unique(faces[near[faces].all(axis=1)], return_inverse=True)
    local = local.reshape(-1, 3)
    stays = keep[used] | ~_surrounded(mean, near)[used]
    weights, rest, now = mean[used][:, used], neutral[used], moved[used]
    loose = ~stays[local].all(axis=1)
    for number in range(rounds):
        folded = folded_by_shape(rest, now, local, loose)
        if not len(folded):
            break
        knot = np.zeros(len(used), bool)
        knot[local[folded]] = True
        knot = dilate(knot, local, 1 + number // _PATIENCE) & ~stays  # what resists is smoothed with more around it
        now[knot] += step * (weights[knot] @ now - now[knot])
    result = np.array(moved)
    result[used] = now
    return result


def _surrounded(mean, mask):
    """(n,) bool: vertices all of whose neighbours are in a mask (n,)."""
    return np.asarray((mean != 0) @ (~mask).astype(float)).ravel() == 0
