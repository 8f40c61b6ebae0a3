"""How far a surface lies from a point inside it, in every direction: a table that is quick to ask and to turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.mesh.raster import RayScene

_ANGLES, _TURNS = 121, 96  # 1.5 degrees from pole to pole, 3.75 around


@dataclass(frozen=True)
class RadialTable:
    """radii (a, t): distance in mm at even angles from +Z, 0 to 180 degrees, and even turns about it from +X."""

    radii: np.ndarray

    def __call__(self, directions):
        """(k,) mm in directions (k, 3) of any length, bilinear in angle and turn."""
        x, y, z = directions.T
        a, t = self.radii.shape
        angle = np.arctan2(np.hypot(x, y), z) * ((a - 1) / np.pi)
        turn = np.arctan2(y, x) * (t / (2 * np.pi)) % t
        i, j = np.minimum(angle.astype(int), a - 2), turn.astype(int) % t
        u, v = angle - i, turn - np.floor(turn)
        k = (j + 1) % t
        near = (1 - v) * self.radii[i, j] + v * self.radii[i, k]
        far = (1 - v) * self.radii[i + 1, j] + v * self.radii[i + 1, k]
        return (1 - u) * near + u * far

    def mirrored(self):
        """The table of the mirror image in x."""
        t = self.radii.shape[1]
        return RadialTable(self.radii[:, (t // 2 - np.arange(t)) % t])

    def scaled(self, by):
        """The table of the surface scaled about its centre."""
        return RadialTable(by * self.radii)


def radial_table(vertices, faces, otherwise):
    """The RadialTable of a mesh about the origin: its outermost surface; `otherwise` mm where there is none.

    vertices (n, 3) mm, faces (m, 3)
    """
    angle = np.linspace(0.0, np.pi, _ANGLES)
    turn = 2 * np.pi * np.arange(_TURNS) / _TURNS
    across = np.sin(angle)[:, None]
    directions = [
        across * np.cos(turn),
        across * np.sin(turn),
        np.broadcast_to(np.cos(angle)[:, None], (_ANGLES, _TURNS)),
    ]
    directions = np.stack(directions, axis=2).reshape(-1, 3)
    start = 1.1 * float(np.linalg.norm(vertices, axis=1).max())
    distance = RayScene(vertices, faces).cast(start * directions, -directions, start).distance
    radii = np.where(np.isfinite(distance), start - distance, otherwise).reshape(_ANGLES, _TURNS)
    radii[[0, -1]] = radii[[0, -1]].mean(axis=1, keepdims=True)
    return RadialTable(radii)
