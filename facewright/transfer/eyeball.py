"""An eyeball as a surface that lids must clear: a ball with a bulge about its axis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import cKDTree

from facewright.data import Template
from facewright.mesh.radial import RadialTable, radial_table
from facewright.solve.procrustes import best_similarity

_LEAST_BULGE = 0.02  # of the radius: an eye that bulges less than this has no cornea
_MEASURED: WeakKeyDictionary[Template, dict[str, Eyeball]] = WeakKeyDictionary()
_LID_SLOPE = 0.3  # how quickly a lid gains thickness away from its margin


@dataclass(frozen=True)
class Eyeball:
    """A ball with a cornea. center (3,) mm, radius of the sclera.

    rotation (3, 3): its own axes, as columns; the last goes through the pupil
    surface  RadialTable in these axes: no template's eye is quite round about its pupil
    """

    center: np.ndarray
    radius: float
    rotation: np.ndarray
    surface: RadialTable

    @property
    def axis(self):
        """(3,) unit through the pupil."""
        return self.rotation[:, 2]

    def turned(self, rotation):
        """The Eyeball turned about its centre by (3, 3)."""
        return replace(self, rotation=rotation @ self.rotation)

    def surface_radius(self, points):
        """(k,) distance of the eye's surface from its centre in the direction of points (k, 3)."""
        return self.surface((points - self.center) @ self.rotation)

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
    most, which is the cornea. The surface is the outermost of the eye's parts; both eyes' quads count, however they are
    cut. The left eye is measured, once for a template; the right one is its mirror image to the last bit.
    """
    if template not in _MEASURED:
        left = _left_eyeball(template)
        _MEASURED[template] = {"left": left, "right": _mirrored(left)}
    return _MEASURED[template][side]


def _left_eyeball(template):
    center = template.skeleton.positions[template.skeleton.names.index("eye_left")]
    ball = template.vertices[template.part("eye_left").vertex_slice] - center
    radius = float(np.median(np.linalg.norm(ball[ball[:, 2] < 0], axis=1)))
    offset = np.concatenate([template.vertices[part.vertex_slice] for part in eye_parts(template, "left")]) - center
    distance = np.linalg.norm(offset, axis=1)
    bulge = np.maximum(distance - radius, 0.0) * (offset[:, 2] > 0)
    axis = (bulge**2) @ (offset / distance[:, None])
    axis = axis / np.linalg.norm(axis) if bulge.max() > _LEAST_BULGE * radius else np.array([0.0, 0.0, 1.0])
    right = np.cross([0.0, 1.0, 0.0], axis)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(axis, right), axis], axis=1)
    faces = [template.faces[part.face_slice] for part in eye_parts(template, "left")]
    faces += [template.mirror[template.faces[part.face_slice]] for part in eye_parts(template, "right")]
    surface = radial_table((template.vertices - center) @ rotation, np.concatenate(faces), radius)
    return Eyeball(center, radius, rotation, surface)


def _mirrored(ball):
    """The Eyeball on the other side of x = 0."""
    flip = np.array([-1.0, 1.0, 1.0])
    rotation = flip[:, None] * ball.rotation * flip
    return replace(ball, center=flip * ball.center, rotation=rotation, surface=ball.surface.mirrored())


def carried_eyeball(template, vertices, side):
    """The Eyeball of a person, whose eye parts are the template's, moved, turned and scaled (n, 3)."""
    own = measure_eyeball(template, side)
    part = template.part(f"eye_{side}").vertex_slice
    R, scale, t = best_similarity(template.vertices[part], vertices[part])
    return replace(
        own.turned(R), center=scale * R @ own.center + t, radius=scale * own.radius, surface=own.surface.scaled(scale)
    )


def lid_clearance(points, margin, gap_mm, most_mm):
    """(k,) least distance from the ball of lid skin (k, 3): gap_mm at the margin (h, 3), growing to most_mm."""
    distance = cKDTree(margin).query(points)[0]
    return np.minimum(gap_mm + _LID_SLOPE * distance, most_mm)
