"""Procedural colour for made heads: skin, lips, brows, eyes, hair and cloth, enough for a landmarker to see a face."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from facewright.evaluate.procedural import fractal_noise, speckles, value_noise
from facewright.evaluate.scanner import eyeball
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.fade import smooth_step

BROW_POINTS = {"right": (70, 63, 105, 66, 107), "left": (300, 293, 334, 296, 336)}
"""Landmarks along each brow, from its outer end to the nose."""


@dataclass(frozen=True)
class Complexion:
    """Colours of one person, sRGB 0..1."""

    skin: tuple[float, float, float] = (0.80, 0.62, 0.53)
    lips: tuple[float, float, float] = (0.69, 0.38, 0.37)
    brows: tuple[float, float, float] = (0.25, 0.18, 0.14)
    hair: tuple[float, float, float] = (0.20, 0.14, 0.10)
    iris: tuple[float, float, float] = (0.30, 0.38, 0.33)
    cloth: tuple[float, float, float] = (0.50, 0.57, 0.66)
    freckles: float = 0.3


def random_complexion(rng):
    """A Complexion drawn from light to dark skin."""
    light, dark = np.array([0.88, 0.71, 0.62]), np.array([0.42, 0.28, 0.21])
    tone = rng.uniform(0, 1) ** 1.3
    skin = light * (1 - tone) + dark * tone
    hair = np.array([0.10, 0.08, 0.07]) + rng.uniform(0, 0.35) * (1 - tone) * np.array([1.0, 0.72, 0.45])
    iris = np.array([0.25, 0.17, 0.11]) + rng.uniform(0, 1) * (1 - tone) * np.array([0.05, 0.22, 0.26])
    lips = skin * np.array([0.86, 0.62, 0.68])
    cloth = rng.uniform(0.2, 0.8, 3)
    return Complexion(
        tuple(skin), tuple(lips), tuple(hair * 1.05), tuple(hair), tuple(iris), tuple(cloth), rng.uniform(0, 0.8)
    )


class HeadPaint:
    """Colours for points on one head. template and its true vertices (n, 3) say where lips, brows and eyes are."""

    def __init__(self, template, vertices, complexion, seed=0):
        self.complexion, self.seed = complexion, seed
        self.vertices = vertices
        skin_faces = template.faces[template.skin.face_slice]
        self.faces = skin_faces[template.regions["outer"][skin_faces].all(axis=1)]
        self.surface = Surface(vertices, self.faces)
        regions = template.regions
        self.lips = (regions["lip_upper"] | regions["lip_lower"]).astype(float)
        lids = ("lid_upper_left", "lid_lower_left", "lid_upper_right", "lid_lower_right")
        self.lids = cKDTree(_dense(vertices, [template.lines[name] for name in lids]))
        self.seam = cKDTree(_dense(vertices, [template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]]))
        brows, self.brow_width = _brow_points(template, vertices)
        self.brows = cKDTree(self.surface.closest(brows).points)
        nostrils = vertices[regions["nostrils"] & ~regions["outer"]]
        self.nostrils = cKDTree(nostrils) if len(nostrils) else None
        self.eyes = [eyeball(vertices[template.part(name).vertex_slice]) for name in ("eye_left", "eye_right")]

    def skin(self, points):
        """(k, 3) sRGB colours of points on skin and lips."""
        look, seed = self.complexion, self.seed
        nearest = self.surface.closest(points)
        lips = interpolate(self.lips, self.faces, nearest.faces, nearest.barycentric)
        shade = 1 + 0.05 * fractal_noise(points, 25.0, seed) + 0.04 * fractal_noise(points, 1.6, seed + 1, 2)
        color = np.asarray(look.skin) * shade[:, None]
        flush = smooth_step(fractal_noise(points, 30.0, seed + 2), -0.2, 0.7)[:, None]
        color = color * (1 - flush * [0.0, 0.09, 0.09])
        spots = look.freckles * speckles(points, 4.0, 0.7, seed + 3, share=0.5)[:, None]
        color = color * (1 - spots * [0.25, 0.35, 0.4])
        wrinkles = 1 + 0.07 * value_noise(points * [3.0, 0.4, 0.4], 1.5, seed + 4)
        color = _mix(color, np.asarray(look.lips) * wrinkles[:, None], smooth_step(lips, 0.25, 0.85))
        color = self._brow(color, points)
        color = color * (1 - 0.55 * smooth_step(self.seam.query(points)[0], 1.6, 0.2))[:, None]
        color = color * (1 - 0.65 * smooth_step(self.lids.query(points)[0], 1.5, 0.3))[:, None]
        if self.nostrils is not None:
            color = color * (1 - 0.75 * smooth_step(self.nostrils.query(points)[0], 2.0, 0.5))[:, None]
        return np.clip(color, 0, 1)

    def _brow(self, color, points):
        distance, nearest = self.brows.query(points)
        hairs = 0.5 + 0.5 * value_noise(points * [1.0, 0.35, 1.0], 0.7, self.seed + 5)
        width = self.brow_width[nearest]
        amount = smooth_step(distance / width, 1.25, 0.4) * (0.4 + 0.5 * hairs)
        return _mix(color, self.complexion.brows, amount)

    def eye(self, points):
        """(k, 3) sRGB colours of points on the bump between the lids."""
        distances = np.stack([np.linalg.norm(points - center, axis=1) for center, _ in self.eyes])
        which = distances.argmin(axis=0)
        centers = np.stack([center for center, _ in self.eyes])[which]
        radius = np.array([r for _, r in self.eyes])[which]
        direction = points - centers
        off_axis = np.linalg.norm(direction[:, :2], axis=1) / radius
        streaks = 1 + 0.25 * value_noise(direction * 1.0, 0.9, self.seed + 6)
        white = np.array([0.88, 0.85, 0.83]) * (1 - 0.05 * smooth_step(off_axis, 0.5, 0.9))[:, None]
        iris = np.asarray(self.complexion.iris) * streaks[:, None]
        color = _mix(white, np.asarray(self.complexion.iris) * 0.35, smooth_step(off_axis, 0.53, 0.47))
        color = _mix(color, iris, smooth_step(off_axis, 0.46, 0.42))
        color = _mix(color, (0.03, 0.03, 0.03), smooth_step(off_axis, 0.19, 0.15))
        return np.clip(color * (1 - 0.6 * smooth_step(self.lids.query(points)[0], 1.2, 0.2))[:, None], 0, 1)

    def hair(self, points):
        """(k, 3) sRGB colours of hair: streaks along the strands."""
        streaks = 1 + 0.5 * value_noise(points * [1.0, 0.15, 0.3], 1.2, self.seed + 7)
        return np.clip(np.asarray(self.complexion.hair) * streaks[:, None], 0, 1)

    def cloth(self, points):
        """(k, 3) sRGB colours of a woven collar."""
        weave = 1 + 0.12 * np.sin(points[:, 1] * 4.0) * np.sin(points[:, 0] * 4.0)
        return np.clip(np.asarray(self.complexion.cloth) * weave[:, None], 0, 1)


def _mix(a, b, amount):
    """Rows of a towards colour b by amount (k,)."""
    return a + (np.asarray(b) - a) * np.asarray(amount)[:, None]


def _dense(vertices, lines, step=0.4):
    """Points every `step` mm along polylines of vertex indices."""
    pieces = []
    for line in lines:
        points = vertices[line]
        for a, b in pairwise(points):
            count = max(1, int(np.linalg.norm(b - a) / step))
            pieces.append(a + (b - a) * (np.arange(count)[:, None] / count))
    return np.vstack(pieces)


def _brow_points(template, vertices):
    """Points (k, 3) along both brows and half their width (k,): by landmarks, or an arc above each eye without them."""
    marks = template.landmarks
    place = {name: i for i, name in enumerate(marks.names) if marks.weights[i] > 0}
    positions = marks.positions(vertices, template.faces)
    pieces, widths = [], []
    for side, numbers in BROW_POINTS.items():
        names = [f"mp{number}" for number in numbers]
        if all(name in place for name in names):
            points = positions[[place[name] for name in names]]
        else:
            center, radius = eyeball(vertices[template.part(f"eye_{side}").vertex_slice])
            outward = 1.0 if side == "left" else -1.0
            t = np.linspace(-1, 1, 9)[:, None]
            points = center - t * [outward * 20.0, 0, 0] + (1 - t**2) * [0, 4.0, 0] + [0, 1.6 * radius, 1.2 * radius]
        steps = np.linspace(0, len(points) - 1, 60)
        low = np.minimum(steps.astype(int), len(points) - 2)
        pieces.append(points[low] + (steps - low)[:, None] * (points[low + 1] - points[low]))
        outer_to_inner = np.linspace(0, 1, 60)
        widths.append(1.2 + 2.8 * smooth_step(outer_to_inner, -0.1, 0.6) * smooth_step(outer_to_inner, 1.25, 0.85))
    return np.vstack(pieces), np.concatenate(widths)
