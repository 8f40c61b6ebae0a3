"""Painted eyes: sclera, limbus, iris and pupil as a function of the angle from the eye's axis, for any eye's UVs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from facewright.mesh.closest import interpolate
from facewright.mesh.fade import smooth_step
from facewright.mesh.normals import normalized, vertex_normals
from facewright.mesh.raster import RayScene, raster_uv
from facewright.mesh.render import linear_to_srgb
from facewright.mesh.tangents import corner_tangents, to_tangent_space
from facewright.transfer.eyeball import angle_from

_RIM_DEG = 16.0
_FADE_MM = 0.1  # height of a cornea above the white from which on it alone says how light falls
BROWN, WHITE = (0.16, 0.115, 0.07), (0.78, 0.74, 0.70)
_VEINS, _VEINS_DEG, _SECTOR = 34, (34.0, 100.0), 0.45
_DARK = 0.004  # linear: what is seen through a pupil


@dataclass(frozen=True)
class EyeLook:
    """What an eye looks like. Angles in degrees from the axis, seen from the centre of a 12 mm ball.

    iris_deg     edge of the iris (5.9 mm on a 12 mm ball); pupil_deg edge of the pupil (1.9 mm)
    iris_color   mean linear RGB of the ring between pupil and limbus; None: the scan's where it shows, else brown
    sclera_color linear RGB, towards the back it reddens
    pattern      one of PATTERNS
    size         side of the texture in pixels
    """

    iris_deg: float = 29.5
    pupil_deg: float = 9.5
    iris_color: tuple[float, float, float] | None = None
    sclera_color: tuple[float, float, float] = WHITE
    pattern: str = "fibres"
    size: int = 512

    def __post_init__(self):
        if self.pattern not in PATTERNS:
            raise ValueError(f"an iris pattern is one of {', '.join(PATTERNS)}, got {self.pattern!r}")


def eye_colors(directions, axis=(0.0, 0.0, 1.0), look=None):
    """Linear RGB (k, 3) of the eye's surface seen from its centre in directions (k, 3); axis (3,) unit."""
    look = look or EyeLook()
    axis = np.asarray(axis, float)
    angle = np.degrees(angle_from(axis, directions))
    right = np.cross([0.0, 1.0, 0.0], axis)
    around = np.arctan2(directions @ np.cross(axis, right), directions @ right)
    color = _sclera(angle, around, look)
    # The limbus is a soft dark ring 1 mm wide: a sharp one is what makes eyes look like buttons.
    front = np.flatnonzero(angle < look.iris_deg + 1.5)
    edge = smooth_step(angle[front], look.iris_deg - 2.5, look.iris_deg + 1.5)[:, None]
    color[front] = _iris(angle[front], around[front], look) * (1 - edge) + color[front] * edge
    return color


def _sclera(angle, around, look):
    """(k, 3) the white: warmer and redder towards the back, with veins that thin out towards the limbus."""
    back = np.clip((angle - 40.0) / 50.0, 0.0, 1.0)[:, None]
    color = np.array(look.sclera_color) * (1 - back) + np.array([0.62, 0.42, 0.38]) * back
    shown = np.flatnonzero((angle > _VEINS_DEG[0]) & (angle < _VEINS_DEG[1]))
    veins = _veins(angle[shown].astype(np.float32), around[shown].astype(np.float32))
    # They show at the sides, where lids do not cover the white.
    veins = veins * (0.35 + 0.65 * np.cos(around[shown]) ** 2)
    color[shown] *= 1 - veins[:, None] * [0.10, 0.34, 0.34]
    return color


def _veins(angle, around):
    """(k,) 0 to 1: forked lines that wander outwards."""
    rng = np.random.default_rng(5)
    veins = np.zeros_like(angle)
    order = np.argsort(around)  # each vein touches a narrow sector
    angle, around = angle[order], around[order]
    for start in np.linspace(-np.pi, np.pi, _VEINS, endpoint=False) + rng.normal(0, 0.08, _VEINS):
        waves = rng.uniform(0, 2 * np.pi, 3)
        fork_at, first, most = rng.uniform(45, 65), rng.uniform(36, 52), rng.uniform(0.3, 1.0)
        start = (start + np.pi) % (2 * np.pi) - np.pi
        sector = slice(*np.searchsorted(around, [start - _SECTOR, start + _SECTOR]))
        a = angle[sector]
        wander = 0.05 * np.sin(0.16 * a + waves[0]) + 0.025 * np.sin(0.45 * a + waves[1])
        fork = 0.012 * np.maximum(a - fork_at, 0)
        strength, width = most * smooth_step(a, first, first + 24), 0.004 + 0.005 * smooth_step(a, 45, 80)
        for branch in (-0.5, 0.5):
            off = around[sector] - np.float32(start) - wander - branch * fork
            veins[sector] = np.maximum(veins[sector], strength * np.exp(-((off / width) ** 2)))
    result = np.empty_like(veins)
    result[order] = veins
    return result


def _iris(angle, around, look):
    """(k, 3) iris and pupil. The pattern changes the light from place to place, not the mean over the ring."""
    radius = np.clip((angle - look.pupil_deg) / (look.iris_deg - look.pupil_deg), 0.0, 1.0)
    light, warmth = PATTERNS[look.pattern](radius, around)
    ring = (radius > 0.15) & (radius < 0.85)
    if ring.any():
        light = light / light[ring].mean()
        warmth = warmth - warmth[ring].mean()
    tint = np.exp(warmth[:, None] * [0.35, 0.05, -0.5])
    if ring.any():
        tint = tint / (light[ring, None] * tint[ring]).mean(axis=0)
    rim = 1 - 0.75 * smooth_step(radius, 0.80, 1.0)
    color = np.array(look.iris_color or BROWN) * np.maximum(light * rim, 0.0)[:, None] * tint
    open_ = smooth_step(angle, look.pupil_deg - 1.0, look.pupil_deg + 0.7)[:, None]
    return color * open_ + _DARK * (1 - open_)


def _threads(around, radius, count, seed, wander=1.0):
    """(k,) about -1 to 1: threads that run outwards, bending as they go."""
    waves = np.random.default_rng(seed).uniform(0, 2 * np.pi, 4)
    bend = wander * (0.05 * np.sin(5 * around + waves[0]) + 0.03 * np.sin(9 * around + 4 * radius + waves[1]))
    fine = np.sin(count * (around + bend) + waves[2])
    coarse = np.sin(round(0.37 * count) * (around + 1.6 * bend) + 5 * radius + waves[3])
    return (fine + 0.7 * coarse) / 1.7


def _collarette(around, radius, at=0.30, teeth=11, deep=0.035, width=0.09):
    """(k,) 0 to 1: the ragged ring where the pupil's zone ends."""
    line = at + deep * np.sin(teeth * around) + 0.5 * deep * np.sin(2 * teeth * around + 1.3)
    return np.exp(-(((radius - line) / width) ** 2))


def _cells(around, radius, count, rings, seed):
    """(k,) 0 to 1: hollows in rings, of uneven size."""
    rng = np.random.default_rng(seed)
    hollow = np.zeros(len(radius))
    for middle in rings:
        for place in (np.arange(count) + rng.uniform(-0.3, 0.3, count)) * 2 * np.pi / count:
            wide, high, shift = rng.uniform(0.05, 0.13), rng.uniform(0.05, 0.11), rng.normal(0, 0.04)
            off = np.abs((around - place + np.pi) % (2 * np.pi) - np.pi)
            at = np.flatnonzero((off < 2 * wide) & (np.abs(radius - middle - shift) < 2 * high))
            depth = np.exp(-(((off[at] / wide) ** 2 + ((radius[at] - middle - shift) / high) ** 2) ** 1.5))
            hollow[at] = np.maximum(hollow[at], depth)
    return hollow


def _fibres(radius, around):
    ring = _collarette(around, radius, 0.26, 11, 0.03, 0.15)
    return 1.0 + 0.28 * _threads(around, radius, 96, 1) * np.sqrt(radius * (1 - radius) * 4) + 0.4 * ring, 0.6 * ring


def _crypts(radius, around):
    hollow = np.maximum(_cells(around, radius, 13, (0.42, 0.62), 2), 0.7 * _cells(around, radius, 17, (0.24,), 3))
    ring = _collarette(around, radius, 0.34, 9, 0.05)
    return 1.0 + 0.22 * _threads(around, radius, 80, 4) - 0.5 * hollow + 0.4 * ring, 0.7 * ring


def _furrows(radius, around):
    circles = np.cos(2 * np.pi * 5.5 * (radius + 0.015 * np.sin(4 * around) + 0.01 * np.sin(7 * around)))
    folds = np.clip(circles - 0.5, 0, 1) * smooth_step(radius, 0.42, 0.6)
    ring = _collarette(around, radius, 0.28, 13, 0.02)
    return 1.0 + 0.15 * _threads(around, radius, 110, 5) - 0.5 * folds + 0.35 * ring, 0.8 * ring


def _flower(radius, around):
    petals = np.abs(np.sin(4.5 * around + 0.5 * np.sin(3 * around))) ** 0.6
    body = petals * np.exp(-(((radius - 0.55) / 0.28) ** 2))
    ring = _collarette(around, radius, 0.26, 9, 0.05)
    return 0.85 + 0.5 * body + 0.14 * _threads(around, radius, 70, 6, 1.6) + 0.3 * ring, ring


def _burst(radius, around):
    rays = _threads(around, radius, 64, 7, 1.8)
    core = np.exp(-((radius / (0.34 + 0.10 * rays)) ** 2))
    return 1.0 + 0.26 * rays + 0.35 * core, 1.5 * core


def _speckled(radius, around):
    spots = _cells(around, radius, 7, (0.45, 0.72), 8) ** 4
    ring = _collarette(around, radius, 0.31, 12, 0.03)
    return 1.0 + 0.2 * _threads(around, radius, 90, 9) + 0.35 * ring - 0.35 * spots, 0.8 * ring + 0.9 * spots


PATTERNS = {
    "fibres": _fibres,
    "crypts": _crypts,
    "furrows": _furrows,
    "flower": _flower,
    "burst": _burst,
    "speckled": _speckled,
}
"""name -> function of radius (k,), 0 at the pupil and 1 at the limbus, and the angle around (k,): light and warmth."""


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
    if not inner:
        directions = _raised(directions, ball, look.iris_deg + _RIM_DEG)
    colors = eye_colors(directions, ball.axis, look)
    if inner:
        colors[np.degrees(angle_from(ball.axis, directions)) > look.iris_deg + _RIM_DEG] = _DARK
    image = np.empty((look.size, look.size, 3))
    image[seen] = colors
    rows, columns = distance_transform_edt(~seen, return_distances=False, return_indices=True)
    return (linear_to_srgb(np.clip(image[rows, columns], 0, 1)) * 255 + 0.5).astype(np.uint8)


def paint_bulge(vertices, faces, uv, uv_faces, ball, cornea, size=256):
    """A tangent-space normal map (size, size, 3) uint8 that lights an eye part as the cornea before it bulges.

    cornea  (vertices, faces) of the clear part. Viewers fade what a clear surface mirrors, so the catch light has to be
            the iris's own: on a flat one it would be all or nothing, and a bright ring where the white bends down to it
    """
    face, barycentric = raster_uv(uv, uv_faces, size)
    seen = face >= 0
    face, barycentric = face[seen], barycentric[seen]
    own = vertex_normals(vertices, faces)
    tangents, signs = corner_tangents(vertices, faces, own, uv, uv_faces)
    tangent = normalized(np.einsum("kc,kcd->kd", barycentric, tangents[face]))
    normal = normalized(interpolate(own, faces, face, barycentric))
    points = interpolate(vertices, faces, face, barycentric)
    start = 2.0 * ball.radius
    hits = RayScene(*cornea).cast(points + start * ball.axis, np.broadcast_to(-ball.axis, points.shape), start)
    met = (hits.face >= 0) & ((points - ball.center) @ ball.axis > 0.0)
    bulge = interpolate(vertex_normals(*cornea), cornea[1], hits.face[met], hits.barycentric[met])
    share = smooth_step(start - hits.distance[met], 0.0, _FADE_MM)[:, None]
    wanted = normal.copy()
    wanted[met] = normalized(share * bulge + (1.0 - share) * normal[met])
    bend = normalized(to_tangent_space(wanted, normal, tangent, signs[face]))
    image = np.full((size, size, 3), (128, 128, 255), np.uint8)
    image[seen] = np.clip(np.rint(127.0 * bend + 128.0), 0, 255)
    return image


def _raised(offsets, ball, degrees):
    """Points (k, 3) from the eye's centre; those of a hollow (an iris set back) within degrees of the axis brought to
    the ball's surface along it: so they are as large as on a ball, seen from in front."""
    along, length = offsets @ ball.axis, np.linalg.norm(offsets, axis=1)
    short = (length < ball.radius) & (along > np.cos(np.radians(degrees)) * length)
    across = offsets[short] - along[short, None] * ball.axis
    height = np.sqrt(ball.radius**2 - (across**2).sum(axis=1))
    raised = offsets.copy()
    raised[short] = across + height[:, None] * ball.axis
    return raised
