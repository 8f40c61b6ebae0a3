"""What a beholder sees of the eyeballs of a rig: between lids that should be shut, and through the skin of lids."""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import face_normals
from facewright.mesh.raster import Camera, RayScene

MM_PER_PX = 0.2
WIDTH_MM, HEIGHT_MM = 44.0, 34.0
# Slits between shut lids are 0.01 mm wide: at 0.2 mm a pixel 0.08 mm2 were found of one of 0.02 and nothing of others.
SLIT_MM_PER_PX, SLIT_WIDTH_MM, SLIT_HEIGHT_MM = 0.05, 40.0, 22.0
NEAR_MM = 70.0
BLINK_VIEWS = ((0.0, 0.0), (-30.0, 0.0), (30.0, 0.0), (0.0, -30.0))
SKIN_VIEWS = BLINK_VIEWS[:3]
_THICK_MM = 3.0  # lid skin farther inside the ball than this is not what a ray should have met
_EPSILON_MM = 1e-3


class EyeView:
    """One eye of a rig, looked at.

    skin, faces   neutral skin (n, 3) and its triangles; balls: list of (vertices, faces) of the ball and its parts
    socket        (n,) bool skin of the pocket behind the lids
    center        (3,) of the eyeball
    """

    def __init__(self, skin, faces, balls, socket, center):
        near = np.linalg.norm(skin - center, axis=1) < NEAR_MM
        self.faces = faces[near[faces].any(axis=1)]
        self.lid = ~socket[self.faces].any(axis=1)
        self.ball_faces, start = [], len(skin)
        for vertices, part in balls:
            self.ball_faces.append(part + start)
            start += len(vertices)
        self.center = center

    def visible_mm2(self, skin, balls, views=BLINK_VIEWS):
        """Largest area of the ball that is seen from one of the views (yaw, pitch), mm2 in the picture plane.

        skin (n, 3), balls list of (k, 3): the pose
        """
        scene = RayScene(np.vstack([skin, *balls]), np.concatenate([self.faces, *self.ball_faces]))
        most = 0
        for view in views:
            hits = scene.cast(*self._rays(view, SLIT_WIDTH_MM, SLIT_HEIGHT_MM, SLIT_MM_PER_PX))
            most = max(most, int((hits.face >= len(self.faces)).sum()))
        return most * SLIT_MM_PER_PX**2

    def through_lids_mm2(self, skin, balls, views=SKIN_VIEWS, lining=False):
        """Largest area where the ball stands before the lid skin that should hide it, from one of the views, mm2.

        lining: or the lining of the lids does
        """
        lid_faces = self.faces[self.lid]
        scene = RayScene(np.vstack([skin, *balls]), np.concatenate([self.faces, *self.ball_faces]))
        lids, normals = RayScene(skin, lid_faces), face_normals(skin, lid_faces)
        most = 0
        for view in views:
            origins, directions = self._rays(view, WIDTH_MM, HEIGHT_MM, MM_PER_PX)
            hits = scene.cast(origins, directions)
            seen = hits.face >= len(self.faces)
            if lining:
                skin_seen = np.flatnonzero((hits.face >= 0) & ~seen)
                seen[skin_seen] = ~self.lid[hits.face[skin_seen]]
            if not seen.any():
                continue
            reach = hits.distance[seen, None] + _EPSILON_MM
            behind = lids.cast(origins[seen] + reach * directions[seen], directions[seen], _THICK_MM)
            found = behind.face >= 0
            facing = (normals[behind.face[found]] * directions[seen][found]).sum(axis=1) < 0
            most = max(most, int(facing.sum()))
        return most * MM_PER_PX**2

    def _rays(self, view, width_mm, height_mm, mm_per_px):
        size = (round(height_mm / mm_per_px), round(width_mm / mm_per_px))
        return Camera.looking_at(self.center, *view, height_mm / 2, size).rays()
