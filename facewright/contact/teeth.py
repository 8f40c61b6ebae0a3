"""Teeth as solids that skin must not enter."""

from __future__ import annotations

import igl
import numpy as np

from facewright.mesh.closest import Surface
from facewright.mesh.normals import vertex_normals

_BEHIND_MM = 0.2


class Teeth:
    """One row of teeth of a head: vertices (k, 3) mm at rest, faces (m, 3) of it.

    A pose of it is an affine image of the row at rest (a jaw that turns, or a chord of that turn), so points are
    brought back to rest and asked there.
    """

    def __init__(self, vertices, faces):
        self.vertices = np.ascontiguousarray(vertices)
        self._faces = np.ascontiguousarray(faces)
        self._surface = Surface(self.vertices, self._faces)
        self._low, self._high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        ones = np.column_stack([self.vertices, np.ones(len(vertices))])
        self.solid = self._is_solid()
        self._to_affine = np.linalg.pinv(ones)

    def way_out(self, points, moved):
        """(k, 3) shortest ways out of the teeth for points (k, 3), zero outside; moved (v, 3): the row in its pose."""
        affine = self._to_affine @ moved
        A, t = affine[:3].T, affine[3]
        back = np.linalg.solve(A, (points - t).T).T
        result = np.zeros_like(points)
        if not self.solid:
            return result
        near = np.flatnonzero(((back > self._low) & (back < self._high)).all(axis=1))
        if not len(near):
            return result
        asked = np.ascontiguousarray(back[near])
        inside = self._winding(asked) > 0.5
        at = near[inside]
        result[at] = (self._surface.closest(back[at]).points - back[at]) @ A.T
        return result

    def _winding(self, points):
        return np.asarray(igl.fast_winding_number(self.vertices, self._faces, np.ascontiguousarray(points))).reshape(-1)

    def _is_solid(self):
        """Whether the faces enclose flesh: what lies just behind most of them is inside (strips are all front)."""
        behind = self.vertices - _BEHIND_MM * vertex_normals(self.vertices, self._faces)
        return bool(np.median(self._winding(behind)) > 0.8)
