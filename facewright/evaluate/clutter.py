"""What a scan shows beside the face: hair that stands off the head, loose strands, a collar."""

from __future__ import annotations

import numpy as np

from facewright.evaluate.procedural import fractal_noise
from facewright.mesh.fade import smooth_step
from facewright.mesh.normals import vertex_normals
from facewright.mesh.raster import RayScene


def hair_height(points, scalp_depth, seed, *, thickness=9.0):
    """(k,) mm that hair stands off the head at points (k, 3); scalp_depth (k,) mm inside the hairline, < 0 outside."""
    lumps = 0.65 + 0.6 * fractal_noise(points, 16.0, seed, 3)
    return thickness * smooth_step(scalp_depth, 0.0, 14.0) * np.clip(lumps, 0.15, None)


def strands(surface, starts, directions, rng, *, length=45.0, width=4.0, height=3.0):
    """Ribbons that run over a surface: V (k, 3), F (m, 3), roots (s,) index of the vertex where each begins.

    surface a Surface; starts (s, 3) points on it, directions (s, 3) to run in; height mm above it, curling
    """
    normals = vertex_normals(surface.vertices, surface.faces)
    points, faces, roots, offset = [], [], [], 0
    for start, direction in zip(starts, directions):
        steps = rng.integers(8, 15)
        ribbon = _ribbon(surface, normals, start, direction, rng, steps, length / 12, width, height)
        quads = offset + 2 * np.arange(steps - 1)[:, None] + np.array([[0, 1, 3, 2]])
        points.append(ribbon)
        roots.append(offset)
        faces += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        offset += len(ribbon)
    if not points:
        return np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty(0, np.int64)
    return np.vstack(points), np.vstack(faces), np.array(roots)


def _ribbon(surface, normals, start, direction, rng, steps, stride, width, height):
    """(2 * steps, 3) left and right border of one strand."""
    at, curl, phase = start, rng.uniform(-0.35, 0.35), rng.uniform(0, 6.3)
    border = []
    for step in range(steps):
        nearest = surface.closest(at[None])
        normal = normals[surface.faces[nearest.faces[0]]].mean(axis=0)
        normal = normal / max(np.linalg.norm(normal), 1e-9)
        direction = direction - normal * (direction @ normal)
        direction = direction / max(np.linalg.norm(direction), 1e-9)
        side = np.cross(normal, direction)
        lifted = nearest.points[0] + normal * (height * (0.5 + 0.5 * np.sin(0.7 * step + phase)) + 0.8)
        half = width / 2 * (1 - 0.6 * step / steps)
        border += [lifted + half * side, lifted - half * side]
        direction = direction + curl * side
        at = nearest.points[0] + stride * direction / np.linalg.norm(direction)
    return np.array(border)


def collar(V, F, y_bottom, rng, *, opening_deg=28.0, columns=96):
    """A folded collar around the neck, open in front: V (k, 3), F (m, 3). y_bottom: height of its lower edge, mm."""
    scene = RayScene(V, F)
    axis = np.array([0.0, y_bottom + 12.0, V[np.abs(V[:, 1] - y_bottom) < 15.0, 2].mean()])
    angle = np.radians(np.linspace(opening_deg, 360 - opening_deg, columns))
    outward = np.stack([np.sin(angle), np.zeros(columns), np.cos(angle)], axis=1)
    distance = scene.cast(np.broadcast_to(axis, outward.shape), outward).distance
    radius = np.where(np.isfinite(distance), distance, np.median(distance[np.isfinite(distance)]))
    radius = np.minimum(
        np.maximum(np.convolve(np.pad(radius, 6, mode="edge"), np.ones(13) / 13, mode="valid"), radius), 72.0
    )
    wave = 1.5 * np.sin(3 * angle + rng.uniform(0, 6.3))
    rows = ((0.0, 4.0), (15.0, 5.0), (30.0, 7.0), (33.0, 10.0), (29.0, 14.0), (16.0, 19.0), (4.0, 24.0))
    points = [axis * [0, 0, 1] + (radius + off + wave)[:, None] * outward + [0, y_bottom + up, 0] for up, off in rows]
    grid = np.arange(len(rows) * columns).reshape(len(rows), columns)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    quads = np.stack([a, b, c, d], axis=2).reshape(-1, 4)
    return np.vstack(points), np.vstack([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]])
