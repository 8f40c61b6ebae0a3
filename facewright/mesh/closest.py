"""Nearest points on a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np

from facewright.mesh.normals import dot


@dataclass(frozen=True)
class ClosestPoints:
    """points (k, 3) on the surface, faces (k,), barycentric (k, 3), distance (k,) in mm."""

    points: np.ndarray
    faces: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray


class Surface:
    """A triangle mesh prepared for many nearest-point queries. vertices (n, 3), faces (m, 3)."""

    def __init__(self, vertices, faces):
        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        self._tree = igl.AABB()
        self._tree.init(self.vertices, self.faces)

    def closest(self, points):
        """ClosestPoints of points (k, 3)."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        squared, faces, nearest = self._tree.squared_distance(self.vertices, self.faces, points)
        faces = np.asarray(faces).reshape(-1)
        nearest = np.asarray(nearest).reshape(-1, 3)
        barycentric = barycentric_coordinates(nearest, self.vertices[self.faces[faces]])
        return ClosestPoints(nearest, faces, barycentric, np.sqrt(np.asarray(squared).reshape(-1)))


def barycentric_coordinates(points, triangles):
    """(k, 3) coordinates of points (k, 3) in triangles (k, 3, 3); degenerate triangles give their first corner."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    v0, v1, v2 = b - a, c - a, points - a
    d00, d01, d11, d20, d21 = dot(v0, v0), dot(v0, v1), dot(v1, v1), dot(v2, v0), dot(v2, v1)
    denominator = d00 * d11 - d01 * d01
    good = denominator > 1e-30
    safe = np.where(good, denominator, 1.0)
    v = np.where(good, (d11 * d20 - d01 * d21) / safe, 0.0)
    w = np.where(good, (d00 * d21 - d01 * d20) / safe, 0.0)
    u, v, w = (np.clip(share, 0.0, 1.0) for share in (1 - v - w, v, w))
    return np.stack([u, v, w], axis=1) / (u + v + w)[:, None]


def interpolate(values, F, faces, barycentric):
    """Values (n, ...) at points given by (k,) faces and (k, 3) barycentric coordinates: (k, ...)."""
    corners = values[F[faces]]  # (k, 3, ...)
    return np.einsum("kc,kc...->k...", barycentric, corners)
