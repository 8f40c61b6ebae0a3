"""The axes of one eye that its lids turn about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EyeAxes:
    """center (3,) mm of the eye; unit vectors (3,): axis from canthus to canthus towards +X, forward, up."""

    center: np.ndarray
    axis: np.ndarray
    forward: np.ndarray
    up: np.ndarray

    @classmethod
    def of(cls, upper, lower, center):
        """Of margins (u, 3), (l, 3), which run from one canthus to the other, about a centre (3,)."""
        ends = np.array([0.5 * (upper[0] + lower[0]), 0.5 * (upper[-1] + lower[-1])])
        axis = ends[1] - ends[0] if ends[1, 0] > ends[0, 0] else ends[0] - ends[1]
        axis = axis / np.linalg.norm(axis)
        middle = np.concatenate([upper, lower]).mean(axis=0) - center
        forward = middle - (middle @ axis) * axis
        forward /= np.linalg.norm(forward)
        return cls(center, axis, forward, np.cross(forward, axis))

    def angles(self, points):
        """(k,) radians of elevation of points (k, 3) about the axis, 0 straight ahead."""
        offset = points - self.center
        return np.arctan2(offset @ self.up, offset @ self.forward)

    def cylindrical(self, points):
        """Of points (k, 3): mm (k,) along the axis from the centre, mm (k,) away from it, angles (k,)."""
        offset = points - self.center
        return offset @ self.axis, np.hypot(offset @ self.up, offset @ self.forward), self.angles(points)

    def tangents(self, points):
        """(k, 3) mm by which points (k, 3) move for a radian upwards about the axis."""
        return np.cross(points - self.center, self.axis)

    def turned(self, points, field):
        """Points (k, 3), each turned by its angle (k,) about the axis; positive raises what is ahead."""
        offset = points - self.center
        c, s = np.cos(field)[:, None], np.sin(field)[:, None]
        along = (offset @ self.axis)[:, None] * self.axis
        return self.center + along + c * (offset - along) + s * np.cross(offset, self.axis)
