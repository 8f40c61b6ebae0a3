"""Pictures of meshes, by rays: clay or textured, for landmarks, previews and whoever wants to look."""

from __future__ import annotations

import numpy as np

from facewright.mesh.closest import interpolate
from facewright.mesh.normals import vertex_normals
from facewright.mesh.raster import RayScene

CLAY = (0.80, 0.66, 0.57)
BACKGROUND = (0.13, 0.13, 0.15)
# Key, fill and rim light in camera space (right, up, towards the viewer), with strength.
LIGHTS = ((-0.45, 0.55, 0.70, 0.85), (0.75, 0.10, 0.55, 0.30), (0.0, -0.8, 0.3, 0.12))
LUMA = np.array([0.299, 0.587, 0.114])
"""Shares of sRGB channels in brightness (ITU-R BT.601)."""


def sample_texture(image, uv):
    """Bilinear samples (k, c) float in 0..255 of image (h, w, c) at uv (k, 2); v up, repeats outside 0..1."""
    height, width = image.shape[:2]
    x = (uv[:, 0] % 1.0) * width - 0.5
    y = (1.0 - uv[:, 1] % 1.0) * height - 0.5
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    left, right = x0 % width, (x0 + 1) % width
    top, bottom = np.clip(y0, 0, height - 1), np.clip(y0 + 1, 0, height - 1)
    upper = image[top, left] * (1 - fx) + image[top, right] * fx
    lower = image[bottom, left] * (1 - fx) + image[bottom, right] * fx
    return upper * (1 - fy) + lower * fy


def srgb_to_linear(srgb):
    """0..1 -> 0..1, IEC 61966-2-1."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((np.maximum(srgb, 0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear):
    """0..1 -> 0..1, IEC 61966-2-1."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def shade(normals, albedo, R, flat=False):
    """Linear colours (k, 3) of normals (k, 3) with linear albedo (k, 3) under the lights, seen by a camera with R."""
    if flat:
        return albedo
    local = normals @ R.T
    light = np.full(len(normals), 0.16)
    for x, y, z, strength in LIGHTS:
        direction = np.array([x, y, z]) / np.linalg.norm([x, y, z])
        light = light + strength * np.maximum(local @ direction, 0.0)
    return albedo * light[:, None]


def render(vertices, faces, camera, *, colors=None, texture=None, uv=None, uv_faces=None, normals=None, unlit=False):
    """A picture (h, w, 3) uint8 sRGB of a mesh.

    vertices (n, 3) mm, faces (m, 3), camera a raster.Camera
    colors   (n, 3) or (m, 3) linear 0..1 albedo per vertex or face; default clay
    texture  (h, w, 3) uint8 sRGB with uv (t, 2), uv_faces (m, 3): takes the place of colors
    normals  (n, 3), default area-weighted vertex normals
    unlit    show the albedo as it is
    """
    image, _ = render_with_hits(
        vertices,
        faces,
        camera,
        colors=colors,
        texture=texture,
        uv=uv,
        uv_faces=uv_faces,
        normals=normals,
        unlit=unlit,
    )
    return image


def render_with_hits(
    vertices, faces, camera, *, colors=None, texture=None, uv=None, uv_faces=None, normals=None, unlit=False, hits=None
):
    """As render, and the Hits of the camera's rays, row by row. hits, if known already, are not cast again."""
    hits = RayScene(vertices, faces).cast(*camera.rays()) if hits is None else hits
    seen = hits.face >= 0
    face, barycentric = hits.face[seen], hits.barycentric[seen]
    normals = vertex_normals(vertices, faces) if normals is None else normals
    normal = interpolate(normals, faces, face, barycentric)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    if texture is not None:
        albedo = srgb_to_linear(sample_texture(texture, interpolate(uv, uv_faces, face, barycentric)) / 255.0)
    elif colors is None:
        albedo = np.broadcast_to(srgb_to_linear(np.array(CLAY)), (len(face), 3))
    elif len(colors) == len(vertices):
        albedo = interpolate(colors, faces, face, barycentric)
    else:
        albedo = colors[face]
    height, width = camera.size
    image = np.empty((height * width, 3))
    image[:] = BACKGROUND
    image[seen] = linear_to_srgb(shade(normal, albedo, camera.R, flat=unlit))
    return (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8).reshape(height, width, 3), hits
