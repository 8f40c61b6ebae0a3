"""How far eyeballs draw back in a blink, so that lids which move along straight lines pass before them.

A player of the plain shapes moves lids along chords, which would cut through the cornea half way. In life the eyeball
draws back by a millimetre or more in a blink (Evinger et al. 1984, "Blinking and associated eye movements in humans,
guinea pigs, and rabbits"), so that is what it does here, by as much as the head's lids need. With in-betweens lids keep
to their arc and the ball draws back at last.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import face_cross, normalized
from facewright.mesh.raster import RayScene

MOST_MM = 5.0
STEP_MM = 0.1
_WEIGHTS = 0.25, 0.5, 0.75
_YAW_DEG = -30.0, 0.0, 30.0  # from where a blink is looked at
_FACING = 0.05
_AWAY_MM = 0.02


def needed_retraction(vertices, faces, blink, ball):
    """mm by which a ball must draw back at weight 1 of a blink so that none of it shows before the skin on the way.

    vertices (n, 3) mm at rest, faces (m, 3) of the lids' outer skin, blink (n, 3) its delta; ball transfer's Eyeball
    returns a multiple of STEP_MM, MOST_MM at most
    """
    found = [_pierced(vertices + weight * blink, faces, ball) for weight in _WEIGHTS]
    points, weights = np.concatenate(found), np.repeat(_WEIGHTS, [len(points) for points in found])
    back = 0.0
    while len(points) and back < MOST_MM - 0.5 * STEP_MM:
        back += STEP_MM
        inside = ball.gap(points + (back * weights)[:, None] * [0.0, 0.0, 1.0]) < 0.0
        points, weights = points[inside], weights[inside]
    return round(back, 6)


def _pierced(skin, faces, ball):
    """(k, 3) middles of faces and edges of a posed skin that lie in the ball, with no other skin before them."""
    corners = skin[faces]
    points = np.concatenate([corners.mean(axis=1), 0.5 * (corners + np.roll(corners, -1, axis=1)).reshape(-1, 3)])
    normals = normalized(face_cross(skin, faces))
    normals = np.concatenate([normals, np.repeat(normals, 3, axis=0)])
    inside = ball.gap(points) < 0.0
    points, normals = points[inside], normals[inside]
    scene, seen = RayScene(skin, faces), np.zeros(len(points), bool)
    for yaw in np.radians(_YAW_DEG):
        view = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
        facing = np.flatnonzero(normals @ view > _FACING)
        rays = np.broadcast_to(view, (len(facing), 3))
        seen[facing[~scene.occluded(points[facing] + _AWAY_MM * view, rays)]] = True
    return points[seen]
