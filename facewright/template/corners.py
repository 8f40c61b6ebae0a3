"""Corners of the mouth whose small faces move as what is around them does."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import dilate, vertex_adjacency
from facewright.mesh.laplacian import clamped_laplacian, lumped_mass
from facewright.mesh.normals import vertex_normals
from facewright.solve.quadratic import Factorization

_ROUNDS, _STEP = 5, 0.3
_LEAST_FREE = 1e-2


def relaxed_corners(vertices, faces, seams, *, radius_mm):
    """Vertices (n, 3) in which no face at a corner of the mouth is a sliver: they slide along the skin, evenly spread.

    faces (m, 3); seams: two lines of vertices, upper and lower, from corner to corner; they stay, and all beyond
    radius_mm of a corner
    """
    moved = np.array(vertices)
    away = np.linalg.norm(vertices[:, None] - vertices[seams[0][[0, -1]]], axis=2).min(axis=1)
    share = np.clip(2.0 * (1.0 - away / radius_mm), 0.0, 1.0)
    share[np.concatenate(seams)] = 0.0
    free = np.flatnonzero(share)
    A = vertex_adjacency(faces, len(vertices))[free]
    degree = np.asarray(A.sum(axis=1))
    for _ in range(_ROUNDS):
        normals = vertex_normals(moved, faces)[free]
        way = (A @ moved) / degree - moved[free]
        way -= np.einsum("kc,kc->k", way, normals)[:, None] * normals
        moved[free] += _STEP * share[free, None] * way
    return moved


def even_corners(vertices, faces, corners, fields, *, radius_mm, smooth_mm):
    """Displacement fields (s, n, 3) smoothed within radius_mm of each corner (vertex indices).

    Minimises smooth^4 |M^-1/2 L d|^2 + sum_i m_i h_i |d_i - field_i|^2, with h 1 in the inner half of the radius and
    rising to the rim, where the field stays. Scanned shapes open a corner by faces of 0.01 mm2 that grow 70-fold, each
    its own way; in sums of shapes they fold.
    """
    result = np.array(fields)
    for corner in corners:
        away = np.linalg.norm(vertices - vertices[corner], axis=1)
        bent = dilate(away < radius_mm, faces)  # all that what is free has a part in
        used, local = np.unique(faces[bent[faces].any(axis=1)], return_inverse=True)
        points, local, reach = vertices[used], local.reshape(-1, 3), away[used] / radius_mm
        free, bent = reach < 1.0, bent[used]
        L, mass = clamped_laplacian(points, local)[bent], np.maximum(lumped_mass(points, local), 1e-4)
        hold = mass / np.maximum(1.0 - np.clip(2.0 * reach - 1.0, 0.0, 1.0), _LEAST_FREE) ** 3
        system = (smooth_mm**4 * (L.T @ sp.diags(1.0 / mass[bent]) @ L) + sp.diags(hold)).tocsr()[free]
        given = np.moveaxis(result[:, used], 0, 1).reshape(len(used), -1)
        wanted = hold[free, None] * given[free] - system[:, ~free] @ given[~free]
        smooth = Factorization(system[:, free]).solve(wanted)
        result[:, used[free]] = np.moveaxis(smooth.reshape(-1, len(fields), 3), 1, 0)
    return result
