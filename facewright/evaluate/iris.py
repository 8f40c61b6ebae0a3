"""Irises of a rig: where they are, which colour they have, and how far that is from the truth or the scan."""

from __future__ import annotations

import numpy as np

from facewright.mesh.closest import interpolate
from facewright.mesh.raster import Camera, RayScene
from facewright.mesh.render import sample_texture, srgb_to_linear

COLOR_BAR, CENTER_BAR_MM = 6.0, 1.0
RING_SHARE = (0.42, 0.80)  # of the iris's radius
IRIS_RADIUS_SHARE = 5.9 / 12.0  # of the eyeball's


def measure_irises(rig):
    """side -> {"center_mm": (x, y), "color": mean linear RGB of the iris's ring} as seen from the front, lids away."""
    result = {}
    for side in ("left", "right"):
        mesh = next((mesh for mesh in rig.meshes if mesh.name == f"eye_{side}"), None)
        if mesh is None or mesh.material.albedo not in rig.maps:
            continue
        center = rig.skeleton.positions[rig.skeleton.names.index(f"eye_{side}")]
        radius = float(np.median(np.linalg.norm(mesh.vertices - center, axis=1)))
        camera = Camera.looking_at(center, 0.0, 0.0, radius, (240, 240))
        origins, directions = camera.rays()
        hits = RayScene(mesh.vertices, mesh.faces).cast(origins, directions)
        at = np.flatnonzero(hits.face >= 0)
        uv = interpolate(mesh.uv, mesh.uv_faces, hits.face[at], hits.barycentric[at])
        colors = srgb_to_linear(sample_texture(rig.maps[mesh.material.albedo], uv)[:, :3] / 255.0)
        points = origins[at, :2]
        middle = _pupil(points, colors)
        share = np.linalg.norm(points - middle, axis=1) / (IRIS_RADIUS_SHARE * radius)
        ring = (share > RING_SHARE[0]) & (share < RING_SHARE[1])
        result[side] = {"center_mm": tuple(middle), "color": tuple(colors[ring].mean(axis=0))}
    return result


def _pupil(points, colors):
    """(2,) middle of the darkest spot."""
    light = colors.mean(axis=1)
    return points[light <= light.min() + 0.01].mean(axis=0)


def color_difference(one, other):
    """CIEDE2000 between two linear RGB colours (3,), D65 (Sharma, Wu and Dalal 2005)."""
    (L1, a1, b1), (L2, a2, b2) = _lab(one), _lab(other)
    C = 0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))
    G = 0.5 * (1 - np.sqrt(C**7 / (C**7 + 25.0**7)))
    a1, a2 = (1 + G) * a1, (1 + G) * a2
    C1, C2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360
    turn = (h2 - h1 + 180) % 360 - 180 if C1 * C2 else 0.0
    dL, dC, dH = L2 - L1, C2 - C1, 2 * np.sqrt(C1 * C2) * np.sin(np.radians(turn) / 2)
    L, C = 0.5 * (L1 + L2), 0.5 * (C1 + C2)
    h = (h1 + turn / 2) % 360 if C1 * C2 else h1 + h2
    T = (
        1
        - 0.17 * np.cos(np.radians(h - 30))
        + 0.24 * np.cos(np.radians(2 * h))
        + 0.32 * np.cos(np.radians(3 * h + 6))
        - 0.20 * np.cos(np.radians(4 * h - 63))
    )
    SL = 1 + 0.015 * (L - 50) ** 2 / np.sqrt(20 + (L - 50) ** 2)
    SC, SH = 1 + 0.045 * C, 1 + 0.015 * C * T
    RT = -np.sin(np.radians(60 * np.exp(-(((h - 275) / 25) ** 2)))) * 2 * np.sqrt(C**7 / (C**7 + 25.0**7))
    return float(np.sqrt((dL / SL) ** 2 + (dC / SC) ** 2 + (dH / SH) ** 2 + RT * dC / SC * dH / SH))


def _lab(rgb):
    matrix = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    )
    xyz = matrix @ np.asarray(rgb, float) / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return 116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])
