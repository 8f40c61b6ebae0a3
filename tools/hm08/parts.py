"""Eyeballs by rule; hm08's own strips of teeth and its tongue."""

from __future__ import annotations

import numpy as np

from hm08.neutral import EYE_RADIUS_MM
from hm08.subdivide import triangulate

CORNEA_RADIUS_MM = 7.8
LIMBUS_RADIUS_MM = 5.85
LIMBUS_SOFTNESS_MM = 0.35
EYE_COLUMNS = 32
UV_CENTER_GAIN = 1.6  # how much larger the iris is drawn than the back; 1.6 puts the limbus at radius 0.25
# Angles from the axis of the rings, degrees: even over the iris and the limbus, wide behind.
EYE_RINGS_DEG = (5, 10, 15, 19, 22.5, 25.5, 28, 30.5, 33.5, 37.5, 43, 50, 58, 67, 77, 88, 100, 114, 130, 147, 164)


def eyeball():
    """vertices (n, 3) about the centre, quads and triangles (p, 4), uv (n, 2): looks along +Z, open at the back.

    uv is an azimuthal map about the axis: (0.5, 0.5) is the pupil's centre, the limbus lies at radius 0.25 (half of the
    square's width is iris), the open edge behind at 0.5; u to the person's left.
    """
    angle = np.radians(EYE_RINGS_DEG)
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
    vertices = directions * eyeball_radius(directions[:, 2])[:, None]
    at = 1 + np.arange(len(angle) * EYE_COLUMNS).reshape(len(angle), EYE_COLUMNS)
    cap = np.stack([np.zeros(EYE_COLUMNS, int), at[0], np.roll(at[0], -1), np.full(EYE_COLUMNS, -1)], axis=1)
    bands = [np.stack([a, b, np.roll(b, -1), np.roll(a, -1)], axis=1) for a, b in zip(at[:-1], at[1:])]
    polar = np.concatenate([[0.0], np.repeat(angle, EYE_COLUMNS)])
    around = np.concatenate([[0.0], np.tile(turn, len(angle))])
    radius = 0.5 * np.arctan(UV_CENTER_GAIN * polar) / np.arctan(UV_CENTER_GAIN * angle[-1])
    uv = 0.5 + radius[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    return vertices, np.concatenate([cap, *bands]), uv


def eyeball_radius(cosine):
    """(n,) mm from the centre at the cosine of the angle to the axis: sphere and cornea, joined by a smooth maximum."""
    offset = np.sqrt(EYE_RADIUS_MM**2 - LIMBUS_RADIUS_MM**2) - np.sqrt(CORNEA_RADIUS_MM**2 - LIMBUS_RADIUS_MM**2)
    along = offset * cosine
    inside = CORNEA_RADIUS_MM**2 - offset**2 + along**2
    cornea = np.where(inside > 0, along + np.sqrt(np.maximum(inside, 0.0)), 0.0)
    softness = 0.5 * LIMBUS_SOFTNESS_MM
    both = softness * np.logaddexp(EYE_RADIUS_MM / softness, cornea / softness)
    return np.where(cosine > np.cos(np.radians(80)), both, EYE_RADIUS_MM)


def mirrored_polygons(polygons):
    """The same polygons wound the other way."""
    turned = polygons[:, [0, 2, 1, 3]].copy()
    quad = polygons[:, 3] >= 0
    turned[quad] = polygons[quad][:, [0, 3, 2, 1]]
    return turned


def eye_pair(center):
    """dict of the two eyes: name -> (vertices, polygons, uv); the right one is the left one's mirror image.

    Both textures stand upright: u grows to the person's left on both eyes.
    """
    vertices, polygons, uv = eyeball()
    left = vertices + center
    # Cut from corner 0 to 2; the mirrored winding keeps corners 0 and 2.
    return {
        "eye_left": (left, polygons, uv),
        "eye_right": (left * [-1, 1, 1], mirrored_polygons(polygons), uv * [-1, 1] + [1, 0]),
    }


def simple_part(control, name):
    """vertices, polygons, mirror (local) and control indices of teeth or tongue as hm08 has them."""
    quads = control.part_quads[name]
    index = np.unique(quads)
    local = np.full(len(control.vertices), -1)
    local[index] = np.arange(len(index))
    vertices, mirror = control.vertices[index], local[control.mirror[index]]
    _, polygons = triangulate(local[quads], vertices, np.append(mirror, -1))
    return vertices, polygons, mirror, index
