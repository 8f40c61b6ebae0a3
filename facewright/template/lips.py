"""Lips of a neutral that meet along their seam without passing through each other."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from facewright.mesh.closest import Surface
from facewright.mesh.laplacian import cotangent_laplacian, lumped_mass, uniform_laplacian
from facewright.mesh.normals import normalized, vertex_normals
from facewright.mesh.seam import seam_sides
from facewright.mesh.untangle import untangled
from facewright.solve.quadratic import Factorization

PIN = 1e3  # weight of a point that is put where it belongs, against 1 mm2 of smoothness


class SoftSpread:
    """Smooth displacements that follow wishes of some vertices.

    Minimises sum_i w_i |u_i - d_i|^2 + smooth^4 |M^-1/2 L u|^2 over vertices within radius mm of the seam, 0 beyond.

    vertices (n, 3) mm, faces (m, 3), seam (k,) indices
    """

    def __init__(self, vertices, faces, seam, *, radius=14.0, smooth_mm=1.0):
        n = len(vertices)
        near = cKDTree(vertices[seam]).query(vertices, distance_upper_bound=radius)[0] < radius
        self.inner = np.flatnonzero(near)
        L = cotangent_laplacian(vertices, faces)
        mass = np.maximum(lumped_mass(vertices, faces), 1e-2)
        B = smooth_mm**4 * (L @ sp.diags(1.0 / mass) @ L) + 1e-3 * uniform_laplacian(faces, n)
        self.smoothness = B.tocsr()[self.inner][:, self.inner]
        self._n = n

    def __call__(self, wishes, weights):
        """(n, 3) field for wishes (n, 3) with weights (n,); 0 weight asks for nothing."""
        w = weights[self.inner]
        field = np.zeros((self._n, 3))
        field[self.inner] = Factorization(self.smoothness + sp.diags(w + 1e-9)).solve(w[:, None] * wishes[self.inner])
        return field


def paired_modes(vertices, faces, upper, lower, *, radius_mm=14.0, touch_mm=0.5):
    """A function that corrects displacement fields (n, 3) so that what touches in the neutral moves alike.

    Minimises |M^-1/2 L u|^2 + sum over contacts w |(d + u)_i - (d + u)_opposite|^2 for the correction u of a field d.
    Contacts are the seam's pairs and every lip vertex with the nearest point of the other lip, with a weight that
    fades with their distance (touch_mm); else heads made of the modes would have crossing lips.
    """
    seam = np.concatenate([upper, lower[1:-1]])
    spread = SoftSpread(vertices, faces, seam, radius=radius_mm)
    C = _contacts(vertices, faces, upper, lower, touch_mm)
    G = (C.T @ C).tocsr()
    inner = spread.inner
    factor = Factorization(spread.smoothness + G[inner][:, inner] + 1e-9 * sp.identity(len(inner)))

    def correction(field):
        result = np.zeros_like(field)
        result[inner] = factor.solve(-(G @ field)[inner])
        return result

    return correction


def _contacts(vertices, faces, upper, lower, touch_mm):
    """Sparse (c, n): rows of differences between a point of one lip and its opposite on the other, weighted."""
    n = len(vertices)
    a, b = upper[1:-1], lower[1:-1]
    k = len(a)
    pairs = np.sqrt(PIN) * (
        sp.csr_matrix((np.ones(k), (np.arange(k), a)), shape=(k, n))
        - sp.csr_matrix((np.ones(k), (np.arange(k), b)), shape=(k, n))
    )
    blocks = [pairs]
    sides = seam_sides(vertices, faces, upper, lower)
    for mine, other in (sides, sides[::-1]):
        patch = faces[other[faces].all(axis=1)]
        index = np.flatnonzero(mine)
        nearest = Surface(vertices, patch).closest(vertices[index])
        weight = np.sqrt(PIN) * np.exp(-0.5 * (nearest.distance / touch_mm) ** 2)
        rows = np.arange(len(index))
        opposite = sp.csr_matrix(
            (nearest.barycentric.ravel(), (np.repeat(rows, 3), patch[nearest.faces].ravel())), shape=(len(index), n)
        )
        own = sp.csr_matrix((np.ones(len(index)), (rows, index)), shape=(len(index), n))
        blocks.append(sp.diags(weight) @ (own - opposite))
    return sp.vstack(blocks).tocsr()


def closed_lips(vertices, faces, upper, lower, *, radius_mm=14.0, gap_mm=0.04, rounds=6):
    """Vertices (n, 3) of a skin whose lips meet: paired seam points gap_mm apart, nothing through anything.

    upper, lower (k,) paired seam lines. Every pair moves half and half onto its middle, the surroundings follow
    smoothly (radius_mm); then whatever still is less than gap_mm in front of the other lip is pushed apart, half and
    half; knots in the corners that are left after so many rounds are smoothed away.
    """
    seam = np.concatenate([upper, lower[1:-1]])
    sides = seam_sides(vertices, faces, upper, lower)
    spread = SoftSpread(vertices, faces, seam, radius=radius_mm)
    a, b = upper[1:-1], lower[1:-1]
    field = np.zeros_like(vertices)
    for _ in range(rounds):
        moved = vertices + field
        pushes, weights = _apart(moved, faces, sides, gap_mm)
        normals = vertex_normals(moved, faces)
        want = 0.5 * (moved[b] - moved[a] + gap_mm * normalized(normals[b] - normals[a]))
        pushes[a], pushes[b] = want, -want
        weights[a] = weights[b] = PIN
        # Smoothness holds the whole displacement, not each round's: else the lips would creep.
        field = spread(field + pushes, weights)
    keep = np.zeros(len(vertices), bool)
    keep[seam] = True
    return untangled(vertices + field, faces, keep)


def _apart(vertices, faces, sides, gap_mm):
    """Wishes (n, 3) and weights (n,) that push the lips apart where one is within or behind the other."""
    wishes, weights = np.zeros_like(vertices), np.zeros(len(vertices))
    normals = vertex_normals(vertices, faces)
    for mine, other in (sides, sides[::-1]):
        patch = faces[other[faces].all(axis=1)]
        rim = _rim(patch, len(vertices))
        index = np.flatnonzero(mine)
        nearest = Surface(vertices, patch).closest(vertices[index])
        corners = patch[nearest.faces]
        normal = normalized(np.einsum("kc,kcd->kd", nearest.barycentric, normals[corners]))
        depth = gap_mm - np.einsum("kd,kd->k", vertices[index] - nearest.points, normal)
        on_rim = (rim[corners] & (nearest.barycentric > 1e-6)).any(axis=1)
        facing = np.einsum("kd,kd->k", normals[index], normal) < 0.2
        hit = (depth > 0) & (depth < 2.0) & facing & ~on_rim
        push = 0.6 * depth[hit, None] * normal[hit]
        wishes[index[hit]] += push
        weights[index[hit]] += 1.0
        # The other side answers at the corners of the triangle that was passed.
        share = nearest.barycentric[hit]
        for corner in range(3):
            np.add.at(wishes, corners[hit, corner], -push * share[:, [corner]])
            np.add.at(weights, corners[hit, corner], share[:, corner])
    return wishes / np.maximum(weights, 1.0)[:, None], np.minimum(weights, 1.0) * PIN


def _rim(patch, n):
    """(n,) bool: border vertices of a patch of faces."""
    edges = np.sort(patch[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    rim = np.zeros(n, bool)
    rim[unique[count == 1].ravel()] = True
    return rim
