"""Painted eyes: sclera, limbus, iris and pupil as a function of the angle from the eye's axis, for any eye's UVs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from facewright.mesh.closest import interpolate
from facewright.mesh.raster import raster_uv
from facewright.mesh.render import linear_to_srgb
from facewright.transfer.eyeball import angle_from

_RIM_DEG = 16.0
_DARK = 0.004  # linear: what is seen through a pupil


@dataclass(frozen=True)
class EyeLook:
    """What an eye looks like. Angles in degrees from the axis, seen from the centre of a 12 mm ball.

    iris_deg     edge of the iris (5.9 mm on a 12 mm ball); pupil_deg edge of the pupil (1.9 mm)
    iris_color   linear RGB of the iris at mid radius; lighter towards the pupil, darker at the limbus
    sclera_color linear RGB, towards the back it reddens
    fibres       number of waves around the iris
    size         side of the texture in pixels
    """

    iris_deg: float = 29.5
    pupil_deg: float = 9.5
    iris_color: tuple[float, float, float] = (0.16, 0.115, 0.07)
    sclera_color: tuple[float, float, float] = (0.78, 0.74, 0.70)
    fibres: int = 90
    size: int = 512


def eye_colors(directions, axis=(0.0, 0.0, 1.0), look=None):
    """Linear RGB (k, 3) of the eye's surface seen from its centre in directions (k, 3); axis (3,) unit."""
    look = look or EyeLook()
    axis = np.asarray(axis, float)
    angle = np.degrees(angle_from(axis, directions))
    right = np.cross([0.0, 1.0, 0.0], axis)
    around = np.arctan2(directions @ np.cross(axis, right), directions @ right)
    iris = _iris(angle, around, look)
    back = np.clip((angle - 40.0) / 50.0, 0.0, 1.0)[:, None]
    sclera = np.array(look.sclera_color) * (1 - back) + np.array([0.62, 0.42, 0.38]) * back
    # The limbus is a soft dark ring 1 mm wide: a sharp one is what makes eyes look like buttons.
    edge = _step(angle, look.iris_deg - 2.5, look.iris_deg + 1.5)[:, None]
    return iris * (1 - edge) + sclera * edge


def _iris(angle, around, look):
    """(k, 3) iris and pupil: radial fibres, a lighter collarette, a darker rim."""
    radius = np.clip((angle - look.pupil_deg) / (look.iris_deg - look.pupil_deg), 0.0, 1.0)
    wave = np.sin(look.fibres * around + 3.0 * np.sin(5 * around)) + 0.6 * np.sin(
        0.37 * look.fibres * around + 7.0 * radius + 2.0 * np.sin(3 * around)
    )
    collarette = np.exp(-(((radius - 0.28 - 0.04 * np.sin(11 * around)) / 0.12) ** 2))
    light = 1.0 + 0.16 * wave * radius * (1 - radius) * 4 + 0.7 * collarette - 0.75 * radius**4
    warm = np.array([1.15, 1.0, 0.75]) * collarette[:, None] + (1 - collarette[:, None])
    color = np.array(look.iris_color) * light[:, None] * warm
    open_ = _step(angle, look.pupil_deg - 1.0, look.pupil_deg + 0.7)[:, None]
    return np.maximum(color, 0.0) * open_ + _DARK * (1 - open_)


def _step(value, low, high):
    """Smooth step from 0 at low to 1 at high."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def paint_eye(vertices, faces, uv, uv_faces, ball, look=None, inner=False):
    """A texture (size, size, 3) uint8 sRGB for one eye part in its own UVs; beyond its charts the nearest texel.

    vertices (n, 3), faces (m, 3), uv (t, 2), uv_faces (m, 3); ball eyes.Eyeball at rest
    inner  the part lies inside the ball (a separate iris): what is behind its rim is seen through the pupil, dark
    """
    look = look or EyeLook()
    face, barycentric = raster_uv(uv, uv_faces, look.size)
    seen = face >= 0
    if not seen.any():
        raise ValueError("paint_eye: the part's UVs cover no texel")
    directions = interpolate(vertices, faces, face[seen], barycentric[seen]) - ball.center
    colors = eye_colors(directions, ball.axis, look)
    if inner:
        colors[np.degrees(angle_from(ball.axis, directions)) > look.iris_deg + _RIM_DEG] = _DARK
    image = np.empty((look.size, look.size, 3))
    image[seen] = colors
    rows, columns = distance_transform_edt(~seen, return_distances=False, return_indices=True)
    return (linear_to_srgb(np.clip(image[rows, columns], 0, 1)) * 255 + 0.5).astype(np.uint8)
