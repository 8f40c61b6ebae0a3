"""Folds: what the eye reads as a smile or a sneer is a line where the cheek's mass meets the lip, not the motion."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from facewright.mesh.normals import vertex_normals
from facewright.mesh.polyline import arc_lengths

MIDDLE_MM = 4.0  # half the width over which the fold of one side hands over to that of the other


class Fold:
    """A line over the left side of the face, from places, with a bulge on one side and a groove on the other.

    canvas Canvas; through: names of places in order
    """

    def __init__(self, canvas, through):
        points = np.array([canvas.place(name) for name in through])
        steps = arc_lengths(points)
        share = np.linspace(0.0, 1.0, 200)
        if not canvas.off_middle(through[0]):  # goes on to the right, else it would have a kink in the middle
            points = np.concatenate([points[:0:-1] * [-1, 1, 1], points])
            steps = np.concatenate([-steps[:0:-1], steps])
            share = np.linspace(-0.5, 1.0, 300)
        line = CubicSpline(steps / steps[-1], points, axis=0)
        samples, tangents = line(share), line(share, 1)
        V = canvas.V
        distance = np.linalg.norm(V[:, None, :2] - samples[None, :, :2], axis=2)
        nearest = distance.argmin(axis=1)
        offset, along = (V - samples[nearest])[:, :2], tangents[nearest][:, :2]
        side = along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0]
        self.signed = np.where(side > 0, 1.0, -1.0) * distance[np.arange(len(V)), nearest]
        ends = (0, len(share) - 1)
        beyond = np.where(np.isin(nearest, ends), np.abs((offset * along).sum(axis=1)), 0.0)
        beyond /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)
        self.share, self.beyond = share[nearest], beyond
        self.here = canvas.regions["outer"] & (V[:, 2] > samples[:, 2].min() - 60.0)  # not the back of the head

    def __call__(self, V, F, *, bulge_mm, bulge_width_mm, groove_mm, groove_width_mm, ends=(0.15, 0.15)):
        """(n, 3) displacement of a pose V (n, 3) along its normals; the bulge lies left of the line's direction.

        The fold deepens over the first share ends[0] of the line (0: it is there from the start) and fades over the
        last ends[1].
        """
        rise = _smooth(np.abs(self.share) / ends[0]) if ends[0] > 0 else 1.0
        along = rise * _smooth((1 - self.share) / max(ends[1], 1e-3))
        along = along * np.exp(-((self.beyond / 4.0) ** 2)) * self.here * _smooth(0.5 + V[:, 0] / (2 * MIDDLE_MM))
        d = self.signed
        away = np.maximum(d, 0.0) / bulge_width_mm
        bulge = bulge_mm * away * np.exp(0.5 * (1.0 - away**2))
        center = -0.3 * groove_width_mm
        groove = -groove_mm * np.exp(-(((d - center) / groove_width_mm) ** 2))
        return vertex_normals(V, F) * (along * (bulge + groove))[:, None]


def _smooth(x):
    t = np.clip(x, 0.0, 1.0)
    return t * t * (3 - 2 * t)
