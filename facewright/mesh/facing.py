"""Faces of a fitted mesh that look away from the surface they were fitted to."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.closest import interpolate
from facewright.mesh.normals import face_normals, vertex_normals
from facewright.mesh.sampling import on_border, sample_surface

SURFACE_NEARBY_MM = 3.0


def folded_faces(surface, fit, faces, mask, *, nearby_mm=SURFACE_NEARBY_MM, count=120000):
    """Indices of faces whose normal is more than 90 degrees from the scan's there.

    surface the scan's mesh.closest.Surface; fit (n, 3); faces (m, 3); mask (m,) bool: the faces asked about
    Only where the scan has surface within nearby_mm that is no border. In a crease (lips, lids, alar grooves) the
    nearest point may lie on the far wall; so a face counts only if no scan point about as near faces its way.
    """
    asked = np.flatnonzero(mask)
    vertices, scan_faces = surface.vertices, surface.faces
    centers, normals = fit[faces[asked]].mean(axis=1), face_normals(fit, faces[asked])
    nearest = surface.closest(centers)
    scan_normals = vertex_normals(vertices, scan_faces)
    there = interpolate(scan_normals, scan_faces, nearest.faces, nearest.barycentric)
    present = (nearest.distance < nearby_mm) & ~on_border(scan_faces, nearest.faces, nearest.barycentric)
    suspects = np.flatnonzero(present & ((normals * there).sum(axis=1) < 0))
    if not len(suspects):
        return asked[suspects]
    samples = sample_surface(vertices, scan_faces, count, _near_box(vertices, scan_faces, centers[suspects]))
    sample_normals = face_normals(vertices, scan_faces)[samples.faces]
    tree = cKDTree(samples.points)
    folded = []
    for suspect in suspects:
        around = tree.query_ball_point(centers[suspect], nearest.distance[suspect] + 0.6)
        if not len(around) or (sample_normals[around] @ normals[suspect]).max() < 0:
            folded.append(suspect)
    return asked[np.array(folded, np.int64)]


def _near_box(vertices, faces, points, margin_mm=5.0):
    """(m,) bool: faces in the box around points (k, 3)."""
    centers = vertices[faces].mean(axis=1)
    return ((centers > points.min(axis=0) - margin_mm) & (centers < points.max(axis=0) + margin_mm)).all(axis=1)
