"""A scan's colours at places of its surface."""

from __future__ import annotations

import numpy as np

from facewright.mesh.closest import interpolate
from facewright.mesh.render import sample_texture


def surface_colors(scan):
    """Function (faces (k,), barycentric (k, 3)) -> (k, 3) sRGB 0..1 of a scan with textures or colours, or None.

    nan where a face of a textured scan has no texture
    """
    if not scan.has_texture:
        return None if scan.colors is None else lambda faces, at: interpolate(scan.colors, scan.faces, faces, at)

    def colors(faces, barycentric):
        uv = np.einsum("kc,kcd->kd", barycentric, scan.uv[scan.uv_faces[faces]])
        result = np.full((len(faces), 3), np.nan)
        which = scan.face_texture[faces] if scan.face_texture is not None else np.zeros(len(faces), np.int64)
        for i, image in enumerate(scan.textures):
            mine = which == i
            if mine.any():
                result[mine] = sample_texture(image, uv[mine])[:, :3] / 255.0
        return result

    return colors


def texture_darkness(scan):
    """Function (faces (k,), barycentric (k, 3)) -> darkness (k,) in 0..1 of a textured scan, or None."""
    if not scan.has_texture:
        return None
    colors = surface_colors(scan)

    def darkness(faces, barycentric):
        dark = 1.0 - colors(faces, barycentric).mean(axis=1)
        return np.where(np.isfinite(dark), dark, 0.0)

    return darkness
