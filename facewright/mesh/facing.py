"""Faces of a fitted mesh that look away from the surface they were fitted to."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import face_normals, vertex_normals
from facewright.mesh.sampling import on_border

SURFACE_NEARBY_MM, ABOUT_AS_NEAR_MM = 3.0, 0.6


def folded_faces(surface, fit, faces, mask, *, nearby_mm=SURFACE_NEARBY_MM):
    """Indices of faces whose normal is more than 90 degrees from the scan's there.

    surface the scan's mesh.closest.Surface; fit (n, 3); faces (m, 3); mask (m,) bool: the faces asked about
    Only where the scan has surface within nearby_mm that is no border. In a crease (lips, lids, alar grooves) the
    nearest point may lie on the far wall; so a face counts only if no face of the scan about as near faces its way.
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
    corners, scan_normals = vertices[scan_faces], face_normals(vertices, scan_faces)
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max()
    limits = nearest.distance[suspects] + ABOUT_AS_NEAR_MM
    around = cKDTree(middles).query_ball_point(centers[suspects], limits + reach, return_sorted=True)
    folded = []
    for suspect, limit, near in zip(suspects, limits, around):
        its_way = np.array(near)[scan_normals[near] @ normals[suspect] > 0]
        if len(its_way):
            alone = Surface(corners[its_way].reshape(-1, 3), np.arange(3 * len(its_way)).reshape(-1, 3))
            if alone.nearest(centers[suspect][None])[2][0] <= limit:
                continue
        folded.append(suspect)
    return asked[np.array(folded, np.int64)]
