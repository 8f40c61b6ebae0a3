"""Where each texel of a fitted head meets the scan: short rays both ways along the normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.bake.texels import at_points, dots, in_chunks, unit_rows
from facewright.mesh.closest import Surface
from facewright.mesh.normals import face_normals
from facewright.mesh.raster import RayScene

OVERLAP_MM = 0.05
"""Rays start this far behind the surface, so that a scan that coincides with it is hit by both."""
MAX_ANGLE_DEG = 75.0
PROBE_STRIDE = 61


@dataclass(frozen=True)
class ScanHits:
    """face (k,) int32 of the scan, -1 where a texel met nothing; barycentric (k, 3) float32; offset (k,) float32 mm,
    the signed distance from the fit along its normal, positive outside.
    """

    face: np.ndarray
    barycentric: np.ndarray
    offset: np.ndarray


def project_to_scan(scan, V, F, N, texels, wanted, max_distance_mm=3.0, jobs=1):
    """ScanHits of the wanted texels (k,) bool.

    V (n, 3) the fit, F (m, 3), N (n, 3) directions of the rays. Of the first hits outwards and inwards, those whose
    face turns by less than 75 degrees from the normal count, and the nearer one is taken. The longest ray adapts to
    how closely the fit lies on the scan: four times the 90th percentile of a probe, between 1 mm and max_distance_mm.
    Texels that miss (a crease that no normal reaches) take the scan's nearest point within a third of that.
    """
    scene = RayScene(scan.vertices, scan.faces)
    scan_normals = face_normals(scan.vertices, scan.faces).astype(np.float32)
    cos_limit = np.float32(np.cos(np.radians(MAX_ANGLE_DEG)))

    def points_and_normals(which):
        face, barycentric = texels.face[which], texels.barycentric[which]
        return at_points(V, F, face, barycentric), unit_rows(at_points(N, F, face, barycentric))

    def nearest_hit(which, reach):
        points, normals = points_and_normals(which)
        chosen = ScanHits(
            np.full(len(which), -1, np.int32),
            np.zeros((len(which), 3), np.float32),
            np.full(len(which), np.inf, np.float32),
        )
        for side in (np.float32(1.0), np.float32(-1.0)):
            rays = normals * side
            hits = scene.cast(points - rays * np.float32(OVERLAP_MM), rays, reach + OVERLAP_MM)
            offset = (side * (hits.distance - OVERLAP_MM)).astype(np.float32)
            agrees = (hits.face >= 0) & (dots(scan_normals[hits.face], normals) > cos_limit)
            better = agrees & (np.abs(offset) < np.abs(chosen.offset))
            chosen.face[better] = hits.face[better]
            chosen.barycentric[better] = hits.barycentric[better]
            chosen.offset[better] = offset[better]
        return chosen

    wanted_at = np.flatnonzero(wanted)
    probe = nearest_hit(wanted_at[::PROBE_STRIDE], max_distance_mm)
    reach = _reach(np.abs(probe.offset[probe.face >= 0]), max_distance_mm)
    parts = in_chunks(lambda piece: nearest_hit(wanted_at[piece], reach), len(wanted_at), jobs)
    k = len(texels)
    result = ScanHits(np.full(k, -1, np.int32), np.zeros((k, 3), np.float32), np.zeros(k, np.float32))
    if parts:
        result.face[wanted_at] = np.concatenate([part.face for part in parts])
        result.barycentric[wanted_at] = np.concatenate([part.barycentric for part in parts])
        offset = np.concatenate([part.offset for part in parts])
        result.offset[wanted_at] = np.where(np.isfinite(offset), offset, 0.0)
    missed = wanted_at[result.face[wanted_at] < 0]
    _take_nearest(result, scan, scan_normals, missed, points_and_normals, reach / 3.0, cos_limit)
    return result


def _reach(distances, max_distance_mm):
    """The longest ray, mm, for distances (k,) of a probe."""
    if not len(distances):
        return max_distance_mm
    return float(np.clip(4.0 * np.percentile(distances, 90), min(1.0, max_distance_mm), max_distance_mm))


def _take_nearest(result, scan, scan_normals, missed, points_and_normals, reach, cos_limit):
    """Give the missed texels the scan's nearest point within reach whose normal agrees."""
    if not len(missed):
        return
    points, normals = points_and_normals(missed)
    found = Surface(scan.vertices, scan.faces).closest(points)
    agrees = (found.distance < reach) & (dots(scan_normals[found.faces], normals) > cos_limit)
    taken = missed[agrees]
    result.face[taken] = found.faces[agrees]
    result.barycentric[taken] = found.barycentric[agrees]
    away = found.points[agrees] - points[agrees]
    result.offset[taken] = dots(away, normals[agrees])
