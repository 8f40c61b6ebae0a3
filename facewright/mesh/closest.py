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
        nearest, faces, distance = self.nearest(points)
        barycentric = barycentric_coordinates(nearest, self.vertices.take(self.faces.take(faces, axis=0), axis=0))
        return ClosestPoints(nearest, faces, barycentric, distance)

    def nearest(self, points):
        """points (k, 3), faces (k,) and distance (k,) of ClosestPoints, where nobody asks for more."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        squared, faces, nearest = self._tree.squared_distance(self.vertices, self.faces, points)
        faces, nearest = np.asarray(faces).reshape(-1), np.asarray(nearest).reshape(-1, 3)
        return nearest, faces, np.sqrt(np.asarray(squared).reshape(-1))


def barycentric_coordinates(points, triangles):
    """(k, 3) coordinates of points (k, 3) in triangles (k, 3, 3); degenerate triangles give their first corner."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    v0, v1, v2 = b - a, c - a, points - a
    d00, d01, d11, d20, d21 = dot(v0, v0), dot(v0, v1), dot(v1, v1), dot(v2, v0), dot(v2, v1)
    denominator = d00 * d11 - d01 * d01
    good = denominator > 1e-30
    safe = np.where(good, denominator, np.inf)
    shares = np.empty((len(points), 3))
    shares[:, 1] = (d11 * d20 - d01 * d21) / safe
    shares[:, 2] = (d00 * d21 - d01 * d20) / safe
    shares[:, 0] = 1 - shares[:, 1] - shares[:, 2]
    np.clip(shares, 0.0, 1.0, out=shares)
    return shares / (shares[:, 0] + shares[:, 1] + shares[:, 2])[:, None]


def interpolate(values, F, faces, barycentric):
    """Values (n, ...) at points given by (k,) faces and (k, 3) barycentric coordinates: (k, ...)."""
    corners = values.take(F.take(faces, axis=0), axis=0)  # (k, 3, ...)
    return np.einsum("kc,kc...->k...", barycentric, corners)
