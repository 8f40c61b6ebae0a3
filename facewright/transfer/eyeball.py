"""An eyeball as a surface that lids must clear: a ball with a bulge about its axis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from facewright.solve.procrustes import best_similarity

_LEAST_BULGE = 0.02  # of the radius: an eye that bulges less than this has no cornea
_LID_SLOPE = 0.3  # how quickly a lid gains thickness away from its margin


@dataclass(frozen=True)
class Eyeball:
    """A ball with a cornea. center (3,) mm, radius of the sclera, axis (3,) unit through the pupil.

    angles (a,) radians from the axis and radii (a,) mm there: the profile, round about the axis
    """

    center: np.ndarray
    radius: float
    axis: np.ndarray
    angles: np.ndarray
    radii: np.ndarray

    def surface_radius(self, points):
        """(k,) distance of the eye's surface from its centre in the direction of points (k, 3)."""
        return np.interp(angle_from(self.axis, points - self.center), self.angles, self.radii)

    def gap(self, points):
        """(k,) mm from the surface to points, negative inside."""
        return np.linalg.norm(points - self.center, axis=1) - self.surface_radius(points)

    def pushed_to(self, points, gap):
        """Points (k, 3) moved along the ray from the centre until they lie gap (k,) mm off the surface."""
        offset = points - self.center
        length = np.linalg.norm(offset, axis=1)
        return self.center + offset * ((self.surface_radius(points) + gap) / length)[:, None]


def angle_from(axis, directions):
    """(k,) radians between a unit axis (3,) and directions (k, 3)."""
    along = directions @ axis
    across = np.linalg.norm(directions - along[:, None] * axis, axis=1)
    return np.arctan2(across, along)


def eye_parts(template, side):
    """The parts that turn with an eye: the ball itself, and iris and cornea where they are separate."""
    return [part for part in template.parts if part.attach == f"eye_{side}"]


def measure_eyeball(template, side):
    """The Eyeball of a template.

    The radius is that of the ball's back half, where no cornea is. The axis goes through the middle of what bulges out
    most, which is the cornea. The profile takes the outermost vertex of any of the eye's parts in each 3 degrees.
    """
    center = template.skeleton.positions[template.skeleton.names.index(f"eye_{side}")]
    ball = template.vertices[template.part(f"eye_{side}").vertex_slice] - center
    radius = float(np.median(np.linalg.norm(ball[ball[:, 2] < 0], axis=1)))
    offset = np.concatenate([template.vertices[part.vertex_slice] for part in eye_parts(template, side)]) - center
    distance = np.linalg.norm(offset, axis=1)
    bulge = np.maximum(distance - radius, 0.0) * (offset[:, 2] > 0)
    axis = (bulge**2) @ (offset / distance[:, None])
    axis = axis / np.linalg.norm(axis) if bulge.max() > _LEAST_BULGE * radius else np.array([0.0, 0.0, 1.0])
    angle = angle_from(axis, offset)
    edges = np.radians(np.arange(0, 181, 3) - 1e-3)  # rings of vertices at whole degrees must not lie on an edge
    bins = np.clip(np.digitize(angle, edges) - 1, 0, len(edges) - 2)
    outermost = np.zeros(len(edges) - 1)
    np.maximum.at(outermost, bins, distance)
    seen = outermost > 0
    middles = 0.5 * (edges[:-1] + edges[1:])
    return Eyeball(center, radius, axis, middles[seen], np.maximum(outermost[seen], radius))


def carried_eyeball(template, vertices, side):
    """The Eyeball of a person, whose eye parts are the template's, moved, turned and scaled (n, 3)."""
    own = measure_eyeball(template, side)
    part = template.part(f"eye_{side}").vertex_slice
    R, scale, t = best_similarity(template.vertices[part], vertices[part])
    return replace(
        own,
        center=scale * R @ own.center + t,
        radius=scale * own.radius,
        axis=R @ own.axis,
        radii=scale * own.radii,
    )


def lid_clearance(points, margin, gap_mm, most_mm):
    """(k,) least distance from the ball of lid skin (k, 3): gap_mm at the margin (h, 3), growing to most_mm."""
    distance = cKDTree(margin).query(points)[0]
    return np.minimum(gap_mm + _LID_SLOPE * distance, most_mm)
