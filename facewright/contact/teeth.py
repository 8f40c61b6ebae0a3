"""Teeth as solids that skin must not enter."""

from __future__ import annotations

import igl
import numpy as np

from facewright.mesh.adjacency import touching
from facewright.mesh.closest import Surface
from facewright.mesh.normals import dot, face_normals, lengths, vertex_normals

_BEHIND_MM, _OFF_MM = 0.2, 0.02
_MOST_MM = 8.0  # skin this deep in a tooth has come from elsewhere
_FACING = 0.2  # cosine with the way out of the arch, above which a face belongs to its outer side


class Teeth:
    """One row of teeth of a head: vertices (k, 3) mm at rest, faces (m, 3) of it.

    A pose of it is an affine image of the row at rest (a jaw that turns, or a chord of that turn), so points are
    brought back to rest and asked there. Lips and cheeks come from outside the arch and leave on that side, however
    near the inner side may be.
    """

    def __init__(self, vertices, faces):
        self.vertices, self.faces = np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
        self._low, self._high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        outer = self.faces[_outer_side(self.vertices, self.faces)]
        self._outside = Surface(self.vertices, outer)
        self._surface = Surface(self.vertices, self.faces)
        self._surface_normals = face_normals(self.vertices, self.faces)
        self._tree = igl.FastWindingNumberBVH()
        self._tree.init(self.vertices, self.faces)
        self._to_affine = np.linalg.pinv(np.column_stack([self.vertices, np.ones(len(vertices))]))
        self.solid = self._is_solid()
        # Teeth that touch reach into each other: what lies before a wall that a neighbour hides is in that neighbour.
        before = self.vertices + _OFF_MM * vertex_normals(self.vertices, self.faces)
        self._bare = ~touching(self._winding(before) > 0.5, self.faces)

    def way_out(self, points, moved):
        """Ways out of the teeth (k, 3) for points (k, 3), zero outside, and (k,) clearances.

        moved (v, 3): the row in its pose; a clearance is how far a point may move before it can be in a tooth
        """
        result, clearance = np.zeros_like(points), np.full(len(points), np.inf)
        if not self.solid:
            return result, clearance
        affine = self._to_affine @ moved
        A, t = affine[:3].T, affine[3]
        back = np.linalg.solve(A, (points - t).T).T
        clearance = lengths(np.maximum(np.maximum(self._low - back, back - self._high), 0.0))
        near = np.flatnonzero(clearance == 0.0)
        if len(near):
            # Most points lie before the nearest face: only the rest need the dear question.
            clearance[near] = self._before_all(back[near])
            near = near[clearance[near] == 0.0]
            near = near[self._winding(back[near]) > 0.5]
            points, _, distance = self._outside.nearest(back[near])
            way, out = points - back[near], distance < _MOST_MM
            result[near[out]] = way[out] @ A.T
        return result, clearance * _least_stretch(A)

    def _before_all(self, points):
        """(k,) distance of points (k, 3) to the row, 0 for those behind its nearest face or near one that is hidden."""
        nearest, faces, distance = self._surface.nearest(points)
        before = (dot(nearest - points, self._surface_normals[faces]) <= 0) & self._bare[faces]
        return np.where(before, distance, 0.0)

    def _winding(self, points):
        if not len(points):
            return np.zeros(0)
        return np.asarray(self._tree.winding_number(np.ascontiguousarray(points))).reshape(-1)

    def _is_solid(self):
        """Whether the faces enclose something: what lies just behind most of them is inside. Strips are all front."""
        behind = self.vertices - _BEHIND_MM * vertex_normals(self.vertices, self.faces)
        return bool(np.median(self._winding(behind)) > 0.8)


def rows_of_teeth(template, vertices):
    """[(slice of vertices, Teeth)] of a head's rows of teeth; vertices (n, 3) at rest in the Template's topology."""
    rows = [part for part in template.parts if part.name.startswith("teeth")]
    faces = [template.faces[part.face_slice] - part.vertices[0] for part in rows]
    return [(part.vertex_slice, Teeth(vertices[part.vertex_slice], row)) for part, row in zip(rows, faces)]


def out_of_teeth(rows, head, points):
    """(k, 3) ways out of the rows_of_teeth for points (k, 3), zero outside; head (n, 3) in its pose."""
    return sum((row.way_out(points, head[place])[0] for place, row in rows), np.zeros_like(points))


def _least_stretch(A):
    """What a map (3, 3) leaves of a length, at least: by Gershgorin's circles, exact for turns and chords of one."""
    squares = A.T @ A
    least = 2.0 * np.diagonal(squares) - np.abs(squares).sum(axis=1)
    return np.sqrt(max(least.min(), 0.0))


def _outer_side(vertices, faces):
    """(m,) bool: faces of an arch that look away from its middle; the arch lies flat along its two longer axes."""
    middle = vertices.mean(axis=0)
    up = np.linalg.svd(vertices - middle, full_matrices=False)[2][2]
    away = vertices[faces].mean(axis=1) - middle
    away -= (away @ up)[:, None] * up
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    return (face_normals(vertices, faces) * away).sum(axis=1) > _FACING
