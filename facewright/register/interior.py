"""The inside of mouth, sockets and nostrils: carried along by the fit, and kept behind the skin."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import dilate, vertex_adjacency
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import vertex_normals
from facewright.solve.quadratic import Factorization

CLEARANCE_MM = 0.4
REACH_MM = 5.0


def tuck_interior(vertices, faces, interior, outer, lines, rounds=4):
    """Vertices (n, 3) with those of the interior that came through the skin moved back behind it.

    interior, outer (n,) bool; lines (k,) feature-line vertices, which stay. An interior vertex in front of the nearest
    outer face, or nearer than CLEARANCE_MM behind it, is pushed back; its neighbours follow smoothly; outer vertices do
    not move. The ring behind a rim is left alone: there inside and outside meet.
    """
    seam = dilate(outer, faces, 1)
    loose = np.flatnonzero(interior & ~seam)
    if not len(loose):
        return vertices
    skin_faces = faces[outer[faces].all(axis=1)]
    movable = interior & ~outer
    movable[lines] = False
    smoother = _spread(faces, movable, len(vertices))
    vertices = vertices.copy()
    for _ in range(rounds):
        normals = vertex_normals(vertices, skin_faces)
        nearest = Surface(vertices, skin_faces).closest(vertices[loose])
        out = interpolate(normals, skin_faces, nearest.faces, nearest.barycentric)
        height = np.einsum("kc,kc->k", out, vertices[loose] - nearest.points)
        depth = np.where(nearest.distance < REACH_MM, height + CLEARANCE_MM, 0.0)
        wrong = depth > 0.02
        if not wrong.any():
            break
        push = np.zeros_like(vertices)
        push[loose[wrong]] = -depth[wrong, None] * out[wrong]
        hold = np.zeros(len(vertices))
        hold[loose[wrong]] = 1.0
        vertices = vertices + smoother(push, hold)
    return vertices


def _spread(faces, movable, n):
    """Function (push (n, 3), hold (n,)) -> smooth field that follows push where hold is 1 and is 0 outside movable."""
    rows = np.flatnonzero(movable)
    A = vertex_adjacency(faces, n)
    L = (sp.diags(np.asarray(A.sum(axis=1)).ravel()) - A)[rows][:, rows]

    def field(push, hold):
        weight = 50.0 * hold[rows]
        system = (L + sp.diags(weight + 0.02)).tocsr()
        result = np.zeros((n, 3))
        result[rows] = Factorization(system).solve(weight[:, None] * push[rows])
        return result

    return field
