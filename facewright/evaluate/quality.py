"""Is a fitted or moved mesh sound: folds, tears, self-intersections, lips that part, an inner mouth that shows."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import touching, unique_edges
from facewright.mesh.closest import Surface
from facewright.mesh.facing import folded_faces
from facewright.mesh.intersect import self_intersections
from facewright.mesh.normals import face_cross, lengths
from facewright.mesh.raster import Camera, RayScene

VIEWS_OF_MOUTH = ((0.0, 0.0), (-35.0, 0.0), (35.0, 0.0), (0.0, 20.0), (0.0, -20.0))
RIM_MM, LIP_RIM_MM = 2.0, 1.0
FINE = 5  # rays along the side of a pixel that is looked at closely
CANTHI, CORNERS = ("mp133", "mp33", "mp362", "mp263"), ("mp61", "mp291")


def torn_edges(neutral, moved, faces, mask=None, *, edges=None, grow_mm=4.0, factor=3.0):
    """(k, 2) edges that grow by more than 4 mm and to over 3 times their length; mask (n,) bool limits the vertices.

    edges  unique_edges(faces), if they are known already
    """
    edges = unique_edges(faces) if edges is None else edges
    if mask is not None:
        edges = edges[mask[edges[:, 0]] & mask[edges[:, 1]]]
    rest, now = (lengths(points[edges[:, 0]] - points[edges[:, 1]]) for points in (neutral, moved))
    return edges[(now - rest > grow_mm) & (now > factor * rest)]


def new_self_intersections(vertices, reference, faces, among, region):
    """(k, 2) crossing pairs of faces that the reference (n, 3) of the same topology does not have.

    among (m,) bool: the faces tested against each other; region (m,) bool: at least one of a pair lies there
    """
    now = self_intersections(vertices, faces, among)
    before = self_intersections(reference, faces, among)
    keys = [pairs[:, 0] * len(faces) + pairs[:, 1] for pairs in (now, before)]
    return now[region[now].any(axis=1) & ~np.isin(*keys)]


def lip_gaps_mm(vertices, lines):
    """(k,) distances between paired points of the two lip seams."""
    return np.linalg.norm(vertices[lines["lip_seam_upper"]] - vertices[lines["lip_seam_lower"]], axis=1)


def visible_interior_mm2(vertices, faces, interior, center, *, width_mm=80.0, mm_per_px=0.2, views=VIEWS_OF_MOUTH):
    """Largest area of interior faces that is seen through the lips from one of the views, mm2 in the picture plane.

    interior (m,) bool: faces of the mouth bag, teeth and tongue; center (3,) the middle of the mouth
    A pixel counts if most of it shows the inside: lips that touch leave a slit of a few hundredths of a millimetre,
    through which single rays pass and which no picture shows.
    """
    scene, pixels = RayScene(vertices, faces), round(width_mm / mm_per_px)
    shifts = (np.arange(FINE) + 0.5) / FINE - 0.5
    most = 0.0
    for yaw, pitch in views:
        camera = Camera.looking_at(center, yaw, pitch, width_mm / 2, (pixels, pixels))
        origins, directions = camera.rays()
        face = scene.cast(origins, directions).face
        suspects = np.flatnonzero((face >= 0) & interior[face])
        x, y = (shifts * mm_per_px)[:, None, None] * camera.R[0], (shifts * mm_per_px)[None, :, None] * camera.R[1]
        fine = (origins[suspects, None, None] + x + y).reshape(-1, 3)
        face = scene.cast(fine, np.repeat(directions[suspects], FINE**2, axis=0)).face
        inside = ((face >= 0) & interior[face]).reshape(-1, FINE**2).mean(axis=1) > 0.5
        most = max(most, float(inside.sum()) * mm_per_px**2)
    return most


def degenerate_faces(vertices, faces, area_mm2=1e-8):
    """Indices of faces without area."""
    return np.flatnonzero(0.5 * np.linalg.norm(face_cross(vertices, faces), axis=1) < area_mm2)


def region_faces(mask, faces):
    """(m,) bool: faces with all corners in a vertex region (n,)."""
    return mask[faces].all(axis=1)


def rim_faces(vertices, faces, lines, ends, rim_mm):
    """(m,) bool: faces within rim_mm of lines of contact (each (k,)): the thickness of lids and lips.

    ends (c, 3): canthi or corners; between a line's end and the corner before it, the groove is part of the opening
    """
    margins = [vertices[line] for line in lines]
    tips = np.array([tip for margin in margins for tip in margin[[0, -1]]])
    for end in ends:
        tip = tips[np.linalg.norm(tips - end, axis=1).argmin()]
        margins.append(np.linspace(tip, end, 9))
    return cKDTree(np.concatenate(margins)).query(vertices[faces].mean(axis=1))[0] < rim_mm


def _rims(template, fit, lines):
    """(m,) bool of the rims of lids, and of lips without them."""

    def rim(prefix, landmarks, rim_mm):
        known = [i for i, name in enumerate(template.landmarks.names) if name in landmarks]
        ends = template.landmarks.positions(fit, template.faces)[known]
        mine = [line for name, line in lines.items() if name.startswith(prefix)]
        return rim_faces(fit, template.faces, mine, ends, rim_mm)

    lids = rim("lid_", CANTHI, RIM_MM)
    return lids, rim("lip_seam_", CORNERS, LIP_RIM_MM) & ~lids


def measure_quality(scan, fit, template, regions=None, lines=None):
    """Soundness of a fit, as report.json has it under `registration`.

    scan a data.Scan in the fit's frame; fit (n, 3) fitted vertices of the Template
    returns dict folded, folded_lid_rims and folded_lip_rims (apart: a scan shows a bump or the other lid or lip where
    the template has its thickness, so its normal there says nothing), folded_hidden (those of folded where hair hides
    the face: there the hair's underside may lie next to it), self_intersections (pairs with a face in region `face`
    that the neutral has not), lip_gap_mm (largest), visible_mouth_mm2
    """
    regions = template.regions if regions is None else regions
    lines = template.lines if lines is None else lines
    faces = template.faces
    in_face = region_faces(regions["face"], faces)
    skin = np.zeros(len(faces), bool)
    skin[template.skin.face_slice] = True
    folded = folded_faces(Surface(scan.vertices, scan.faces), fit, faces, in_face & skin)
    hidden = touching(regions.get("hidden", np.zeros(len(fit), bool)), faces)
    lid_rim, lip_rim = _rims(template, fit, lines)
    gaps = lip_gaps_mm(fit, lines)
    middle = fit[lines["lip_seam_upper"]].mean(axis=0)
    inside = region_faces(regions["mouth_interior"], faces)
    for part in template.parts:
        if part.name in ("teeth_upper", "teeth_lower", "tongue"):
            inside[part.face_slice] = True
    return {
        "folded": int((~(lid_rim | lip_rim)[folded]).sum()),
        "folded_hidden": int((hidden & ~(lid_rim | lip_rim))[folded].sum()),
        "folded_lid_rims": int(lid_rim[folded].sum()),
        "folded_lip_rims": int(lip_rim[folded].sum()),
        "self_intersections": len(new_self_intersections(fit, template.vertices, faces, skin, in_face)),
        "lip_gap_mm": float(gaps.max()),
        "visible_mouth_mm2": visible_interior_mm2(fit, faces, inside, middle),
    }
