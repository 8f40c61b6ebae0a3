"""What a scan's colours tell of hair: far darker than the skin beside it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import face_areas
from facewright.mesh.render import LUMA
from facewright.register.colors import surface_colors

# Brightness (sRGB, of the nearest skin's): what is surely hair, what may be skin in the shade.
SURELY, HARDLY = 0.35, 0.55
NEAREST = 3
WITHIN = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""(s, 3) places on a face whose colours stand for it."""
FINE = 100_000  # faces, of which one place each is enough


def hair_by_color(scan, skin_points):
    """(n,) 0..1 for each vertex of a Scan: how surely its colour is hair's; 0 without colours.

    skin_points (k, 3) mm: places known to be skin, all over the face, so that light from one side is no hair
    """
    brightness = _brightness(scan)
    if brightness is None or not np.isfinite(brightness).any():
        return np.zeros(len(scan.vertices))
    skin = Surface(scan.vertices, scan.faces).closest(skin_points)
    known = interpolate(brightness, scan.faces, skin.faces, skin.barycentric)
    points, known = skin_points[np.isfinite(known)], known[np.isfinite(known)]
    if not len(points):
        return np.zeros(len(scan.vertices))
    nearest = cKDTree(points).query(scan.vertices, min(NEAREST, len(points)))[1].reshape(len(scan.vertices), -1)
    share = brightness / np.maximum(known[nearest].mean(axis=1), 1e-3)
    return np.nan_to_num(np.clip((HARDLY - share) / (HARDLY - SURELY), 0.0, 1.0))


def _brightness(scan):
    """(n,) sRGB 0..1 around each vertex, nan where there is no colour; None without any."""
    colors = surface_colors(scan)
    if colors is None:
        return None
    places = WITHIN[:1] if len(scan.faces) > FINE else WITHIN
    m = len(scan.faces)
    seen = colors(np.repeat(np.arange(m), len(places)), np.tile(places, (m, 1))) @ LUMA
    face = seen.reshape(m, -1).mean(axis=1)
    weight = np.where(np.isfinite(face), face_areas(scan.vertices, scan.faces), 0.0)
    corners, n = scan.faces.ravel(), len(scan.vertices)
    total = np.bincount(corners, np.repeat(np.nan_to_num(face) * weight, 3), n)
    area = np.bincount(corners, np.repeat(weight, 3), n)
    return np.divide(total, area, out=np.full(n, np.nan), where=area > 0)
