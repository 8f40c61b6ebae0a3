"""Rays against a triangle mesh (Embree), and pictures made of them: orthographic views and UV-space rasters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh


@dataclass(frozen=True)
class Hits:
    """face (k,) int, -1 where nothing was hit; barycentric (k, 3); distance (k,), inf where nothing was hit."""

    face: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray


class RayScene:
    """A triangle mesh ready for rays. Embree works in float32: keep coordinates near the origin, in millimetres."""

    def __init__(self, vertices, faces):
        vertices, faces = np.asarray(vertices), np.asarray(faces)
        used = np.zeros(len(vertices), bool)
        used[faces] = True
        if not used.all():  # a vertex takes the library as long as a face does
            vertices, faces = vertices[used], (np.cumsum(used) - 1)[faces]
        self._scene = rtcore_scene.EmbreeScene(robust=True)
        # With indices it is ready in half the time that a list of triangles takes.
        TriangleMesh(
            self._scene,
            np.ascontiguousarray(vertices, dtype=np.float32),
            np.ascontiguousarray(faces, dtype=np.int32),
        )

    def cast(self, origins, directions, max_distance=None):
        """First hits of rays: origins (k, 3), directions (k, 3) of any length (distances count in that length).

        max_distance  where the rays end, in the same measure; short rays are a third faster
        """
        ends = None if max_distance is None else np.full(len(origins), max_distance, np.float32)
        result = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            dists=ends,
            query="INTERSECT",
            output=True,
        )
        face = result["primID"].astype(np.int64)
        hit = face >= 0
        u, v = result["u"].astype(np.float64), result["v"].astype(np.float64)
        barycentric = np.empty((len(face), 3))
        barycentric[:, 0], barycentric[:, 1], barycentric[:, 2] = 1 - u - v, u, v
        barycentric[~hit] = 0.0
        distance = np.where(hit, result["tfar"].astype(np.float64), np.inf)
        return Hits(face, barycentric, distance)

    def occluded(self, origins, directions):
        """(k,) bool: the ray hits anything."""
        result = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            query="OCCLUDED",
        )
        return np.asarray(result) >= 0


@dataclass(frozen=True)
class Camera:
    """An orthographic camera. R (3, 3) rows: right, up, backward (towards the viewer); center (3,) mm.

    half_height  half of the visible height, mm
    size         (height, width) in pixels
    window       (top, bottom, left, right): the rows and columns of the picture that are looked at; default: all
    """

    R: np.ndarray
    center: np.ndarray
    half_height: float
    size: tuple[int, int]
    window: tuple[int, int, int, int] | None = None

    @property
    def looked_at(self):
        """(top, bottom, left, right) rows and columns of the picture that are looked at."""
        return self.window or (0, self.size[0], 0, self.size[1])

    @staticmethod
    def looking_at(center, yaw_deg=0.0, pitch_deg=0.0, half_height=140.0, size=(640, 640)):
        """yaw > 0 moves the camera to +X (the person's left), pitch > 0 above; 0, 0 looks from the front."""
        yaw, pitch = np.radians(yaw_deg), np.radians(pitch_deg)
        backward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
        up = np.cross(backward, right)
        return Camera(np.stack([right, up, backward]), np.asarray(center, float), float(half_height), tuple(size))

    def rays(self):
        """origins, directions (h*w, 3) of what is looked at, row by row from the top left."""
        height, width = self.size
        top, bottom, left, right = self.looked_at
        scale = 2 * self.half_height / height
        x = (np.arange(left, right) - width / 2 + 0.5) * scale
        y = -(np.arange(top, bottom) - height / 2 + 0.5) * scale
        grid_x, grid_y = np.meshgrid(x, y)
        offsets = grid_x.reshape(-1, 1) * self.R[0] + grid_y.reshape(-1, 1) * self.R[1]
        origins = self.center + offsets + 1000.0 * self.R[2]
        return origins, np.broadcast_to(-self.R[2], origins.shape)

    def in_picture(self, vertices, faces):
        """Indices of faces (m, 3) whose outline on the picture's plane comes into what is looked at."""
        pixels = self.project(vertices)[0].T  # (2, n)
        corners = pixels[:, faces.T]  # (2, 3, m)
        least, most = corners.min(axis=1), corners.max(axis=1)
        top, bottom, left, right = self.looked_at
        beyond = (most[0] < left) | (most[1] < top) | (least[0] > right) | (least[1] > bottom)
        return np.flatnonzero(~beyond)

    def project(self, points):
        """(k, 3) mm -> (k, 2) pixels (x right, y down) and (k,) height towards the viewer."""
        local = (points - self.center) @ self.R.T
        scale = self.size[0] / (2 * self.half_height)
        pixels = np.stack([local[:, 0] * scale + self.size[1] / 2, -local[:, 1] * scale + self.size[0] / 2], axis=1)
        return pixels, local[:, 2]


def raster_uv(uv, uv_faces, size, chunk=1 << 20):
    """Which triangle covers each texel of a (size, size) map in UV space.

    returns face (size, size) int, -1 where none, and barycentric (size, size, 3); row 0 is v = 1
    """
    flat = np.column_stack([uv * 1000.0, np.zeros(len(uv))])
    scene = RayScene(flat, uv_faces)
    center = (np.arange(size) + 0.5) / size * 1000.0
    face = np.empty(size * size, np.int64)
    barycentric = np.empty((size * size, 3))
    rows = max(1, chunk // size)
    for start in range(0, size, rows):
        stop = min(size, start + rows)
        grid_u, grid_v = np.meshgrid(center, 1000.0 - center[start:stop])
        origins = np.stack([grid_u.ravel(), grid_v.ravel(), np.full(grid_u.size, 10.0)], axis=1)
        hits = scene.cast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
        face[start * size : stop * size] = hits.face
        barycentric[start * size : stop * size] = hits.barycentric
    return face.reshape(size, size), barycentric.reshape(size, size, 3)
