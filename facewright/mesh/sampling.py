"""Points spread over a surface, and whether a point lies on its border."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.mesh.adjacency import border_edges
from facewright.mesh.closest import interpolate
from facewright.mesh.normals import face_areas

PLASTIC = 0.7548776662466927  # with its square the least regular pair of steps on the unit square


@dataclass(frozen=True)
class SurfaceSamples:
    """points (k, 3), faces (k,), barycentric (k, 3): area-even samples of a surface."""

    points: np.ndarray
    faces: np.ndarray
    barycentric: np.ndarray


def sample_surface(vertices, faces, count, subset=None):
    """SurfaceSamples of `count` points spread evenly by area, the same on every run.

    vertices (n, 3), faces (m, 3); subset (m,) bool limits them to some faces. A systematic walk over the cumulated
    area chooses the face, a low-discrepancy sequence the place in it.
    """
    chosen = np.arange(len(faces)) if subset is None else np.flatnonzero(subset)
    areas = face_areas(vertices, faces[chosen])
    total = np.cumsum(areas)
    if not len(chosen) or total[-1] <= 0:
        return SurfaceSamples(np.empty((0, 3)), np.empty(0, np.int64), np.empty((0, 3)))
    steps = (np.arange(count) + 0.5) / count * total[-1]
    face = chosen[np.minimum(np.searchsorted(total, steps), len(chosen) - 1)]
    u = (0.5 + np.arange(count) * PLASTIC) % 1.0
    v = (0.5 + np.arange(count) * PLASTIC**2) % 1.0
    outside = u + v > 1.0
    u, v = np.where(outside, 1.0 - u, u), np.where(outside, 1.0 - v, v)
    barycentric = np.stack([1.0 - u - v, u, v], axis=1)
    return SurfaceSamples(interpolate(vertices, faces, face, barycentric), face, barycentric)


def on_border(faces, closest_faces, barycentric, tolerance=1e-9):
    """(k,) bool: points given by face and barycentric coordinates lie on a border edge or border vertex of F (m, 3)."""
    edges = border_edges(faces)
    n = int(faces.max()) + 1
    keys = np.sort(np.minimum(edges[:, 0], edges[:, 1]) * n + np.maximum(edges[:, 0], edges[:, 1]))
    is_border_vertex = np.zeros(n, bool)
    is_border_vertex[edges.ravel()] = True
    corners = faces[closest_faces]
    zero = barycentric < tolerance
    result = np.zeros(len(corners), bool)
    for corner in range(3):
        a, b = corners[:, (corner + 1) % 3], corners[:, (corner + 2) % 3]
        result |= zero[:, corner] & np.isin(np.minimum(a, b) * n + np.maximum(a, b), keys)
        alone = zero[:, (corner + 1) % 3] & zero[:, (corner + 2) % 3]
        result |= alone & is_border_vertex[corners[:, corner]]
    return result
