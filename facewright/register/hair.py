"""What a scan's colours tell of hair: it is far darker than the skin beside it."""

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
    """(n,) 0..1 how surely vertices of a Scan are hair by being far darker than skin; 0 without colours.

    skin_points (k, 3) mm: places known to be skin, all over the face, so that light from one side is no hair
    """
    nothing = np.zeros(len(scan.vertices))
    colors = _colors(scan)
    if colors is None:
        return nothing
    skin = Surface(scan.vertices, scan.faces).closest(skin_points)
    known = interpolate(colors, scan.faces, skin.faces, skin.barycentric)
    seen = np.isfinite(known).all(axis=1)
    points, known = skin_points[seen], known[seen]
    if not len(points):
        return nothing
    nearest = cKDTree(points).query(scan.vertices, min(NEAREST, len(points)))[1].reshape(len(scan.vertices), -1)
    share = colors @ LUMA / np.maximum((known @ LUMA)[nearest].mean(axis=1), 1e-3)
    return np.nan_to_num(np.clip((HARDLY - share) / (HARDLY - SURELY), 0.0, 1.0))


def _colors(scan):
    """(n, 3) sRGB 0..1 around each vertex, nan where there is no colour; None without any."""
    colors = surface_colors(scan)
    if colors is None:
        return None
    places = WITHIN[:1] if len(scan.faces) > FINE else WITHIN
    m = len(scan.faces)
    seen = colors(np.repeat(np.arange(m), len(places)), np.tile(places, (m, 1)))
    face = seen.reshape(m, -1, 3).mean(axis=1)
    shown = np.isfinite(face).all(axis=1)
    weight = np.where(shown, face_areas(scan.vertices, scan.faces), 0.0)
    corners, n = scan.faces.ravel(), len(scan.vertices)
    total = [np.bincount(corners, np.repeat(np.where(shown, c, 0.0) * weight, 3), n) for c in face.T]
    area = np.bincount(corners, np.repeat(weight, 3), n)[:, None]
    return np.divide(np.stack(total, axis=1), area, out=np.full((n, 3), np.nan), where=area > 0)
