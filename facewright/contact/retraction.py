"""How far eyeballs draw back in a blink, so that lids which move along straight lines pass before them.

A player of the plain shapes moves lids along chords, which would cut through the cornea half way. In life the eyeball
draws back by 1 to 2 mm in a blink (Evinger et al. 1984, "Blinking and associated eye movements"), so that is what it
does here, by as much as the head's lids need. With in-betweens lids keep to their arc and the ball draws back at last.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import face_cross, normalized
from facewright.mesh.raster import RayScene

MOST_MM = 2.0
STEP_MM = 0.1
_WEIGHTS = 0.25, 0.5, 0.75
_YAW_DEG = -30.0, 0.0, 30.0  # from where a blink is looked at
_BEFORE_MM = np.arange(0.0, 5.0, 0.25)  # places before the skin where the ball could show
_FACING = 0.05
_AWAY_MM = 0.02


def needed_retraction(vertices, faces, blink, ball):
    """mm by which a ball must draw back at weight 1 of a blink so that none of it shows before the skin on the way.

    vertices (n, 3) mm at rest, faces (m, 3) of the lids' outer skin, blink (n, 3) its delta; ball transfer's Eyeball
    returns a multiple of STEP_MM, MOST_MM at most
    """
    rays = [_open_rays(vertices + weight * blink, faces, weight) for weight in _WEIGHTS]
    points, weights = (np.concatenate(parts) for parts in zip(*rays))
    near = ball.gap(points) < 0.0
    points, weights = points[near], weights[near]
    back = 0.0
    while len(points) and back < MOST_MM:
        back += STEP_MM
        inside = ball.gap(points + (back * weights)[:, None] * [0.0, 0.0, 1.0]) < 0.0
        points, weights = points[inside], weights[inside]
    return round(back, 6)


def _open_rays(skin, faces, weight):
    """Places (k, 3) before what is seen of a posed skin, on the way to the beholder, and the weight (k,) of each."""
    corners = skin[faces]
    samples = np.concatenate([corners.mean(axis=1), 0.5 * (corners + np.roll(corners, -1, axis=1)).reshape(-1, 3)])
    normals = normalized(face_cross(skin, faces))
    normals = np.concatenate([normals, np.repeat(normals, 3, axis=0)])
    scene, places = RayScene(skin, faces), []
    for yaw in np.radians(_YAW_DEG):
        view = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
        facing = normals @ view > _FACING
        start = samples[facing]
        open_ = ~scene.occluded(start + _AWAY_MM * view, np.broadcast_to(view, start.shape))
        places.append((start[open_][:, None] + _BEFORE_MM[:, None] * view).reshape(-1, 3))
    places = np.concatenate(places)
    return places, np.full(len(places), weight)
