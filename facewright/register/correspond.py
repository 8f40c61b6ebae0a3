"""Which point of the scan belongs to which vertex of the template, and how far to believe it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import border_vertices
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import face_areas, vertex_normals


@dataclass(frozen=True)
class Matches:
    """For k template points: points (k, 3) on the scan, its normals (k, 3), weights (k,) in 0..1, distance (k,) mm."""

    points: np.ndarray
    normals: np.ndarray
    weights: np.ndarray
    distance: np.ndarray


class Target:
    """A scan prepared for matching: nearest points, smooth normals, border, and what a camera outside can see.

    vertices (n, 3) mm, faces (m, 3), openness (n,) in 0..1 or None: pouches and mouth bags of the scan attract nothing
    """

    MIN_OPENNESS = 0.06

    def __init__(self, vertices, faces, openness=None):
        self.surface = Surface(vertices, faces)
        self.vertices, self.faces = self.surface.vertices, self.surface.faces
        self.normals = vertex_normals(self.vertices, self.faces)
        self.border = border_vertices(self.faces, len(self.vertices))
        self.openness = np.ones(len(self.vertices)) if openness is None else np.asarray(openness)

    def match(self, points, normals, *, max_distance, max_angle_deg=60.0, tau=None):
        """Matches of template points (k, 3) with outward normals (k, 3).

        A match loses its weight beyond max_distance mm, where the normals differ by more than max_angle_deg, where the
        nearest point lies on a border of the scan, or in a pouch. tau mm: scale of the Geman-McClure weight.
        """
        nearest = self.surface.closest(points)
        corners = self.faces[nearest.faces]
        scan_normals = interpolate(self.normals, self.faces, nearest.faces, nearest.barycentric)
        scan_normals /= np.maximum(np.linalg.norm(scan_normals, axis=1, keepdims=True), 1e-12)
        cosine = np.einsum("kc,kc->k", scan_normals, normals)
        limit = np.cos(np.radians(max_angle_deg))
        weights = np.clip((cosine - limit) / (1 - limit) * 2.0, 0.0, 1.0)
        weights[nearest.distance > max_distance] = 0.0
        on_border = (self.border[corners] | (nearest.barycentric < 1e-9)).all(axis=1) & self.border[corners].any(axis=1)
        weights[on_border] = 0.0
        openness = interpolate(self.openness, self.faces, nearest.faces, nearest.barycentric)
        weights *= np.clip(openness / self.MIN_OPENNESS - 1.0, 0.0, 1.0) if self.openness.min() < 1 else 1.0
        if tau is not None:
            weights *= (tau**2 / (tau**2 + nearest.distance**2)) ** 2
        return Matches(nearest.points, scan_normals, weights, nearest.distance)

    def samples(self, count, seed=0):
        """(count, 3) points spread evenly by area over the open part of the scan, and their normals."""
        openness = self.openness[self.faces].mean(axis=1)
        areas = face_areas(self.vertices, self.faces) * (openness > self.MIN_OPENNESS)
        rng = np.random.default_rng(seed)
        edges = np.cumsum(areas)
        strata = (np.arange(count) + rng.random(count)) / count * edges[-1]
        face = np.minimum(np.searchsorted(edges, strata), len(areas) - 1)
        u, v = rng.random(count), rng.random(count)
        flip = u + v > 1
        u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
        barycentric = np.stack([1 - u - v, u, v], axis=1)
        points = interpolate(self.vertices, self.faces, face, barycentric)
        normals = interpolate(self.normals, self.faces, face, barycentric)
        return points, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def nearest_with_normals(points, normals, candidates, candidate_normals, normal_mm=10.0):
    """Indices (k,) of the nearest candidate when a turn of the normal by one radian counts as normal_mm."""
    tree = cKDTree(np.hstack([candidates, candidate_normals * normal_mm]))
    return tree.query(np.hstack([points, normals * normal_mm]), workers=2)[1]
