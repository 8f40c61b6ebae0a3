"""How far a fitted template and its scan lie apart: the definitions of every distance in reports and benchmarks.

scan_to_face: points sampled evenly by area on the scan whose nearest point on the template lies in a region; shoulders
below a chin and inner walls of a hollow scan, which are nearest to a face that the scan has elsewhere, are none of it.
face_to_scan: points sampled evenly by area on that region of the template; one whose nearest scan point lies on a
border of the scan is left out and counted, since there the scan has no surface. The template's surface is its skin with
the inside of mouth, sockets and nostrils, and its eyeballs: a scan point on an eye or in a nostril is not called skin.
"""

from __future__ import annotations

import numpy as np

from facewright.conventions import INTERPUPILLARY_MM
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import vertex_normals
from facewright.mesh.openness import vertex_openness
from facewright.mesh.sampling import on_border, sample_surface

HIDDEN = 0.03  # openness under which a scan's face lies in a pocket of its own
# A scan point this far from the face is another thing than the face if the scan comes so much nearer to the same place.
ELSEWHERE_MM, NEARER_SHARE = 10.0, 0.5


def summary(distances, left_out=0.0):
    """dict of mean, rms, p95, max (mm) and the share left out; figures are None without a sample."""
    if not len(distances):
        return {"mean": None, "rms": None, "p95": None, "max": None, "left_out": float(left_out), "count": 0}
    return {
        "mean": float(np.mean(distances)),
        "rms": float(np.sqrt(np.mean(np.square(distances)))),
        "p95": float(np.percentile(distances, 95)),
        "max": float(np.max(distances)),
        "left_out": float(left_out),
        "count": len(distances),
    }


def in_region(mask, faces, samples_faces, barycentric):
    """(k,) bool: the template vertex that weighs most at each point belongs to the region (n,)."""
    corners = faces[samples_faces]
    return mask[corners[np.arange(len(corners)), barycentric.argmax(axis=1)]]


def surface_faces(template):
    """(m,) bool: the faces of a Template that distances are measured on: the skin, the eyeballs and corneas."""
    mask = np.zeros(len(template.faces), bool)
    for part in template.parts:
        if part.name == "skin" or part.name.startswith(("eye_", "cornea_")):
            mask[part.face_slice] = True
    return mask


def interpupillary_mm(vertices, template):
    """Distance between the centres of the two eyeballs of a fit (n, 3), or None where the template has none."""
    names = [part.name for part in template.parts]
    if "eye_left" not in names or "eye_right" not in names:
        return None
    left, right = (vertices[template.part(name).vertex_slice] for name in ("eye_left", "eye_right"))
    middle = [(eye.max(axis=0) + eye.min(axis=0)) / 2 for eye in (left, right)]
    return float(np.linalg.norm(middle[0] - middle[1]))


def benchmark_scale(interpupillary):
    """Factor that brings a distance to a head with 63 mm between the pupils; 1 where that is unknown."""
    return INTERPUPILLARY_MM / interpupillary if interpupillary else 1.0


def scan_to_face(scan, fit, faces, regions, *, subset=None, hidden=None, painted=False, count=40000):
    """Distances of area-even scan samples to the fit, by region of the nearest fit point.

    scan     (vertices (s, 3), faces (t, 3)); subset (t,) bool limits the samples to some of its faces
    hidden   (t,) bool: faces in a pocket of the scan (its own mouth bag): left out and counted
    fit      (n, 3), faces (m, 3) the template's surface; regions dict name -> (n,) bool
    painted  the subset was painted for the region: a sample whose nearest point is not in it is left out and counted
    returns  dict name -> summary, each with the mean angle between the normals as "normal_deg_mean"
    """
    vertices, scan_faces = scan
    samples = sample_surface(vertices, scan_faces, count, subset)
    nearest = Surface(fit, faces).closest(samples.points)
    angles = _angles_deg(
        interpolate(vertex_normals(vertices, scan_faces), scan_faces, samples.faces, samples.barycentric),
        interpolate(vertex_normals(fit, faces), faces, nearest.faces, nearest.barycentric),
    )
    seen = np.ones(len(samples.faces), bool) if hidden is None else ~hidden[samples.faces]
    far = np.flatnonzero(nearest.distance > ELSEWHERE_MM)
    here = np.ones(len(samples.faces), bool)
    if len(far):
        there = Surface(vertices, scan_faces).closest(nearest.points[far]).distance
        here[far] = there >= NEARER_SHARE * nearest.distance[far]
    result = {}
    for name, mask in regions.items():
        inside = in_region(mask, faces, nearest.faces, nearest.barycentric) & here
        counted = inside & seen
        asked = len(inside) if painted else inside.sum()
        result[name] = summary(nearest.distance[counted], 1.0 - counted.sum() / max(asked, 1))
        result[name]["normal_deg_mean"] = float(angles[counted].mean()) if counted.any() else None
    return result


def face_to_scan(scan, fit, faces, regions, *, count=40000):
    """Distances of area-even samples of each region of the fit to the scan; arguments as in scan_to_face."""
    vertices, scan_faces = scan
    surface = Surface(vertices, scan_faces)
    result = {}
    for name, mask in regions.items():
        samples = sample_surface(fit, faces, count, mask[faces].all(axis=1))
        if not len(samples.points):
            result[name] = summary(np.empty(0), 1.0)
            continue
        nearest = surface.closest(samples.points)
        border = on_border(scan_faces, nearest.faces, nearest.barycentric)
        result[name] = summary(nearest.distance[~border], border.mean())
    return result


def measure_distances(scan, fit, template, regions=None, *, subset=None, count=40000, scale=1.0):
    """All distance figures of a fit, as report.json has them under `registration`.

    scan     a data.Scan in the fit's frame; fit (n, 3) fitted vertices of the Template; regions default the template's
    subset   (t,) bool: only these faces of the scan are asked (a painted skin mask)
    scale    factor on every distance (benchmark_scale), 1 for plain millimetres
    returns  dict scan_to_face_mm, face_to_scan_mm (region `face`, nostrils apart), the same under lips and nostrils,
             normal_deg_mean
    """
    regions = template.regions if regions is None else regions
    faces = template.faces[surface_faces(template)]
    asked = {
        "face": regions["face"] & ~regions["nostrils"],
        "lips": regions["lips"],
        "nostrils": regions["nostrils"],
    }
    surface = (scan.vertices * scale, scan.faces)
    hidden = _pockets(scan, _faces_near(scan, fit[asked["face"]], 5.0))
    to_face, to_scan = {}, {}
    for name, samples, margin_mm in (("face", count, 40.0), ("lips", count // 4, 10.0), ("nostrils", count // 4, 10.0)):
        one = {name: asked[name]}
        painted = subset is not None and name == "face"
        near = subset if painted else _faces_near(scan, fit[asked[name]], margin_mm)
        options = {"subset": near, "painted": painted, "count": samples}
        if name != "nostrils":
            options["hidden"] = hidden
        to_face |= scan_to_face(surface, fit * scale, faces, one, **options)
        to_scan |= face_to_scan(surface, fit * scale, faces, one, count=samples // 2)
    normal_deg = to_face["face"]["normal_deg_mean"]
    for figures in to_face.values():
        del figures["normal_deg_mean"]
    return {
        "scan_to_face_mm": to_face["face"],
        "face_to_scan_mm": to_scan["face"],
        "lips": {"scan_to_face_mm": to_face["lips"], "face_to_scan_mm": to_scan["lips"]},
        "nostrils": {"scan_to_face_mm": to_face["nostrils"], "face_to_scan_mm": to_scan["nostrils"]},
        "normal_deg_mean": normal_deg,
    }


def _pockets(scan, near):
    """(t,) bool: faces among `near` (t,) in a pocket of the scan: what no camera sees is no skin to compare."""
    used, local = np.unique(scan.faces[near], return_inverse=True)
    openness = vertex_openness(scan.vertices, scan.faces, n_directions=64, subset=used)
    hidden = np.zeros(len(scan.faces), bool)
    hidden[near] = openness[local.reshape(-1, 3)].mean(axis=1) <= HIDDEN
    return hidden


def _faces_near(scan, points, margin_mm):
    """(t,) bool: scan faces within the box of points (k, 3) and a margin, so that samples go where they count."""
    if not len(points):
        return np.zeros(len(scan.faces), bool)
    centers = scan.vertices[scan.faces].mean(axis=1)
    return ((centers > points.min(axis=0) - margin_mm) & (centers < points.max(axis=0) + margin_mm)).all(axis=1)


def _angles_deg(a, b):
    """(k,) angles between rows; neither needs unit length."""
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    cosine = np.divide((a * b).sum(axis=1), lengths, out=np.ones(len(a)), where=lengths > 0)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
