"""The eyeball by rule: a 12 mm ball with an iris set back behind a clear cornea, as radius and as meshes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

EYE_RADIUS_MM = 12.0
CORNEA_RADIUS_MM = 7.8
LIMBUS_RADIUS_MM = 5.85
LIMBUS_SOFTNESS_MM = 0.35
EYE_COLUMNS = 32
UV_CENTER_GAIN = 1.6  # how much larger the iris is drawn than the back; 1.6 puts the limbus at radius 0.25
# Angles from the axis of the rings, degrees: even over the iris and the limbus, wide behind.
EYE_RINGS_DEG = (5, 10, 15, 19, 22.5, 25.5, 28, 30.5, 33.5, 37.5, 43, 50, 58, 67, 77, 88, 100, 114, 130, 147, 164)
# The cornea takes the ball's columns, so that lids lie on it as they would on one surface.
CORNEA_RINGS_DEG = (6, 12, 17, 21.5, 25.5, 28, 30.5, 34)
CORNEA_SUNK_MM = 0.05  # its edge lies under the white: two surfaces at one depth would flicker
IRIS_END_DEG = 32.0  # the rings within are the iris and the slope down to it
IRIS_DEPTH_MM = 2.5  # from the cornea's apex to the iris's edge: deeper, from the side a white rim shows behind it
# Towards the pupil it goes back: in a hollow disc light from above brightens the lower half, as a lens does in life.
IRIS_SLOPE = 0.08
IRIS_SOFTNESS_MM = 0.1  # how softly the white bends down to it


def eyeball():
    """vertices (n, 3) about the centre, quads and triangles (p, 4), uv (n, 2): looks along +Z, open at the back.

    The iris is a shallow hollow behind the cornea's place; seen from in front each of its rings lies where it would on
    a ball. uv is an azimuthal map about the axis: (0.5, 0.5) is the pupil's centre, the limbus lies at radius 0.25
    (half of the square's width is iris), the open edge behind at 0.5; u to the person's left.
    """
    directions, polygons, uv = _dome(EYE_RINGS_DEG)
    vertices = directions * eyeball_radius(directions[:, 2])[:, None]
    iris = directions[:, 2] > np.cos(np.radians(IRIS_END_DEG))
    vertices[iris] = EYE_RADIUS_MM * directions[iris]
    across = np.hypot(*vertices[iris, :2].T)
    depth = eyeball_radius(np.ones(1)) - IRIS_DEPTH_MM - IRIS_SLOPE * (LIMBUS_RADIUS_MM - across)
    vertices[iris, 2] = -IRIS_SOFTNESS_MM * np.logaddexp(
        -vertices[iris, 2] / IRIS_SOFTNESS_MM, -depth / IRIS_SOFTNESS_MM
    )
    return vertices, polygons, uv


def cornea():
    """vertices, polygons, uv as of eyeball: the clear bulge before the iris, its edge a little under the white."""
    directions, polygons, uv = _dome(CORNEA_RINGS_DEG)
    radius = eyeball_radius(directions[:, 2])
    radius[-EYE_COLUMNS:] -= CORNEA_SUNK_MM
    return directions * radius[:, None], polygons, uv


def outermost():
    """(n, 3) the vertices of eyeball raised to the cornea: the eye as lids and scanners meet it."""
    directions = _dome(EYE_RINGS_DEG)[0]
    return directions * eyeball_radius(directions[:, 2])[:, None]


def _dome(degrees):
    """Unit directions (n, 3) of a pole at +Z and rings at degrees from it, polygons (p, 4) between them, uv (n, 2)."""
    angle = np.radians(degrees)
    turn = 2 * np.pi * np.arange(EYE_COLUMNS) / EYE_COLUMNS
    directions = np.stack(
        [
            np.outer(np.sin(angle), np.cos(turn)),
            np.outer(np.sin(angle), np.sin(turn)),
            np.outer(np.cos(angle), np.ones_like(turn)),
        ],
        axis=2,
    ).reshape(-1, 3)
    directions = np.concatenate([[[0.0, 0.0, 1.0]], directions])
    at = 1 + np.arange(len(angle) * EYE_COLUMNS).reshape(len(angle), EYE_COLUMNS)
    cap = np.stack([np.zeros(EYE_COLUMNS, int), at[0], np.roll(at[0], -1), np.full(EYE_COLUMNS, -1)], axis=1)
    bands = [np.stack([a, b, np.roll(b, -1), np.roll(a, -1)], axis=1) for a, b in pairwise(at)]
    polar = np.concatenate([[0.0], np.repeat(angle, EYE_COLUMNS)])
    around = np.concatenate([[0.0], np.tile(turn, len(angle))])
    radius = 0.5 * np.arctan(UV_CENTER_GAIN * polar) / np.arctan(UV_CENTER_GAIN * np.radians(EYE_RINGS_DEG[-1]))
    uv = 0.5 + radius[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    return directions, np.concatenate([cap, *bands]), uv


def eyeball_radius(cosine):
    """(n,) mm from the centre to the outermost surface at the cosine of the angle to the axis.

    Sphere and cornea, joined by a smooth maximum.
    """
    offset = np.sqrt(EYE_RADIUS_MM**2 - LIMBUS_RADIUS_MM**2) - np.sqrt(CORNEA_RADIUS_MM**2 - LIMBUS_RADIUS_MM**2)
    along = offset * cosine
    inside = CORNEA_RADIUS_MM**2 - offset**2 + along**2
    cornea = np.where(inside > 0, along + np.sqrt(np.maximum(inside, 0.0)), 0.0)
    softness = 0.5 * LIMBUS_SOFTNESS_MM
    both = softness * np.logaddexp(EYE_RADIUS_MM / softness, cornea / softness)
    return np.where(cosine > np.cos(np.radians(80)), both, EYE_RADIUS_MM)


def height_above(points, center):
    """(k,) mm by which points (k, 3) stand off the surface of a ball at center that looks along +Z."""
    offset = points - center
    distance = np.maximum(np.linalg.norm(offset, axis=-1), 1e-9)
    return distance - eyeball_radius(offset[..., 2] / distance)


def at_height(points, center, height):
    """points (k, 3) moved along their rays from the centre to a height above the ball's surface."""
    offset = points - center
    distance = np.maximum(np.linalg.norm(offset, axis=-1), 1e-9)
    radius = eyeball_radius(offset[..., 2] / distance) + height
    return center + offset * (radius / distance)[..., None]
