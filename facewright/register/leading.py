"""What leads the skin beside the surface: points placed by hand, the crease between the lips, the line of shut lids."""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import vertex_normals
from facewright.mesh.render import sample_texture
from facewright.register.lines import DEEP_MM, CreaseOptions, arc_fractions, trace_crease
from facewright.register.nonrigid import Rows
from facewright.register.skin import contact_rows, line_rows

LID_LANDMARKS = {
    "left": (362, 382, 381, 380, 374, 373, 390, 249, 263),
    "right": (133, 155, 154, 153, 145, 144, 163, 7, 33),
}
LID_CREASE = CreaseOptions(half_band_mm=3.0, overshoot_mm=2.0, prior_sigma_mm=1.5)
# Against the surface's weight of one per mm2. More draws the skin off the surface where the crease is faint, less
# leaves the seam beside it (0.5, 2, 6, 20, 60 tried on a real scan: p95 of the seam 0.41, 0.29, 0.30, 0.35, 0.36 mm).
LINE_WEIGHT, CONTACT_WEIGHT, LID_CONTACT_WEIGHT, PLACED_ROW_WEIGHT = 2.0, 200.0, 10.0, 40.0
LANDMARK_SLACK_MM, LANDMARK_WEIGHT, CONTACT_SHARE = 1.5, 5.0, 0.2


def leading_lines(scan, template, model, pairs, closed):
    """The rows that lead the skin to feature lines found on the scan, and what to report."""
    stop = template.skin.vertices[1]
    normals = vertex_normals(model.vertices[:stop], template.faces[template.skin.face_slice])
    darkness = texture_darkness(scan)
    leading, stats = [], {}
    if pairs.by_hand.any():
        rows = Rows(
            pairs.rows[pairs.by_hand][:, :stop],
            pairs.points[pairs.by_hand],
            np.full(pairs.by_hand.sum(), PLACED_ROW_WEIGHT),
        )
        leading.append(_always(rows))
    leading.append(_landmark_rows(pairs, stop))
    rows, found = _lip_rows(scan, template, model, normals, darkness)
    leading, stats = leading + rows, stats | found
    for side in closed:
        if closed[side]:
            rows, found = _lid_rows(scan, template, model, pairs, normals, darkness, side)
            leading, stats = leading + rows, stats | found
    return tuple(leading), stats


def _landmark_rows(pairs, stop):
    """Function of the current vertices: Rows that pull in landmarks by what they are off beyond LANDMARK_SLACK_MM.

    A landmark is right to a millimetre or two: held to the point it would bend a good fit (heads with known truth say
    so), but a border of the lips or a wing of the nose that is 5 mm off leaves no trace in the surface's distance.
    """
    matrix = pairs.rows[:, :stop].tocsr()

    def rows(vertices):
        here = matrix @ vertices
        gap = pairs.points - here
        length = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
        share = np.clip(1.0 - LANDMARK_SLACK_MM / length, 0.0, 1.0)
        return [Rows(matrix, here + share[:, None] * gap, np.where(share > 0, LANDMARK_WEIGHT * pairs.weights, 0.0))]

    return rows


def _lip_rows(scan, template, model, normals, darkness):
    """Rows that draw the lip seam onto the crease and keep the lips in contact, if there is one; and its figures."""
    stop = len(normals)
    upper, lower = template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]
    middle = 0.5 * (model.vertices[upper] + model.vertices[lower])
    forward = normals[template.regions["lips"][:stop]].mean(axis=0)
    crease = trace_crease(scan.vertices, scan.faces, middle, forward, CreaseOptions(), darkness)
    stats = {"lips_closed": crease.found, "lip_crease_mm": float(np.median(crease.strength))}
    if not crease.found:
        return [], stats
    trust = LINE_WEIGHT * crease_trust(crease)
    # Closer than the template's lips rest, or one sees between them; at 0 they cross.
    rest = CONTACT_SHARE * (template.vertices[upper] - template.vertices[lower])
    contact = contact_rows(upper[1:-1], lower[1:-1], rest[1:-1], CONTACT_WEIGHT, stop)
    return [line_rows(upper, crease, trust, stop), line_rows(lower, crease, trust, stop), _always(contact)], stats


def _lid_rows(scan, template, model, pairs, normals, darkness, side):
    """Rows that draw both margins of a shut eye onto the crease between the lids; and its figures."""
    stop = len(normals)
    upper, lower = template.lines[f"lid_upper_{side}"], template.lines[f"lid_lower_{side}"]
    line = _lid_line(pairs, side, model.vertices[lower])
    lid = template.regions["eyes"][:stop] & (np.sign(template.vertices[:stop, 0]) == (1 if side == "left" else -1))
    crease = trace_crease(scan.vertices, scan.faces, _from_right(line), normals[lid].mean(axis=0), LID_CREASE, darkness)
    stats = {f"lid_crease_{side}_mm": float(np.median(crease.strength))}
    if not crease.found:
        return [], stats
    trust = LINE_WEIGHT * crease_trust(crease)
    paired = _paired(upper, lower, model.vertices)
    contact = contact_rows(*paired, np.zeros((len(paired[0]), 3)), LID_CONTACT_WEIGHT, stop)
    return [line_rows(upper, crease, trust, stop), line_rows(lower, crease, trust, stop), _always(contact)], stats


def _always(rows):
    return lambda _vertices: [rows]


def crease_trust(crease):
    """(k,) in 0.1..1: how far each point of a crease is believed, less towards its ends, which are hard to tell."""
    fractions = np.linspace(0, 1, len(crease.points))
    ends = np.clip(np.minimum(fractions, 1 - fractions) / 0.08, 0.25, 1.0)
    return ends * np.clip(crease.strength / DEEP_MM, 0.1, 1.0)


def _lid_line(pairs, side, otherwise):
    """(k, 3) where shut lids meet by the landmarks, inner to outer canthus; the model's line without landmarks."""
    index = {name: i for i, name in enumerate(pairs.names)}
    rows = [index[f"mp{i}"] for i in LID_LANDMARKS[side] if f"mp{i}" in index]
    return pairs.points[rows] if len(rows) >= 5 else otherwise


def _paired(upper, lower, vertices):
    """Two margins of different counts as pairs: each inner vertex of the upper with the lower's nearest by arc."""
    at, over = arc_fractions(vertices[upper]), arc_fractions(vertices[lower])
    nearest = np.abs(at[1:-1, None] - over[None, :]).argmin(axis=1)
    return upper[1:-1], lower[nearest]


def _from_right(line):
    return line if line[0, 0] < line[-1, 0] else line[::-1]


def texture_darkness(scan):
    """Function (faces, barycentric) -> darkness 0..1 of a textured scan, or None."""
    if not scan.has_texture:
        return None

    def darkness(faces, barycentric):
        uv = np.einsum("kc,kcd->kd", barycentric, scan.uv[scan.uv_faces[faces]])
        result = np.zeros(len(faces))
        which = scan.face_texture[faces] if scan.face_texture is not None else np.zeros(len(faces), np.int64)
        for i, image in enumerate(scan.textures):
            mine = which == i
            if mine.any():
                result[mine] = 1.0 - sample_texture(image, uv[mine])[:, :3].mean(axis=1) / 255.0
        return result

    return darkness
