"""The border of a head, which a body may be sewn to: it moves under no shape."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.fade import smooth_step

FADE_MM = 25.0


def hold_neck(face, deltas):
    """Shapes (s, n, 3) mm of a data.Face that come to rest towards its neck ring, smoothly over 25 mm."""
    ring = face.lines.get("neck_ring")
    if ring is None or not np.abs(deltas[:, ring]).max(initial=0.0) > 0.0:
        return deltas
    skin = face.template.skin.vertex_slice
    away = cKDTree(face.vertices[ring]).query(face.vertices[skin])[0]
    result = np.array(deltas)
    result[:, skin] *= smooth_step(away / FADE_MM)[:, None]
    return result
