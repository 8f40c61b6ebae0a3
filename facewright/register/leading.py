"""What leads the skin beside the surface: points placed by hand, the crease between the lips, the line of shut lids."""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import vertex_normals
from facewright.register.colors import texture_darkness
from facewright.register.lines import DEEP_MM, CreaseOptions, arc_fractions, trace_crease
from facewright.register.nonrigid import Rows
from facewright.register.pairs import LIDS
from facewright.register.skin import aside_rows, border_rows, contact_rows, line_rows
from facewright.scan.landmarks import EYE_LEFT, EYE_RIGHT, LIPS_INNER

EYES = {"left": EYE_LEFT, "right": EYE_RIGHT}
CANTHI = ("mp133", "mp33", "mp362", "mp263")
LID_CREASE = CreaseOptions(half_band_mm=3.0, overshoot_mm=4.0, prior_sigma_mm=1.5)
# Against the surface's weight of one per mm2. More draws the skin off the surface where the crease is faint, less
# leaves the seam beside it (0.5, 2, 6, 20, 60 tried on a real scan: p95 of the seam 0.41, 0.29, 0.30, 0.35, 0.36 mm).
# With the skin held to the model, 3 and 4: seam of a coarse scan 0.72, 0.69 mm, lips of known truth 0.52, 0.55.
LINE_WEIGHT, CONTACT_WEIGHT, LID_CONTACT_WEIGHT, PLACED_ROW_WEIGHT = 4.0, 200.0, 10.0, 40.0
# A border that colours show is right to a few tenths of a millimetre: without slack it bends lids that the shape has
# right (0.29 mm off in height instead of 0.21 on heads with known truth).
BORDER_WEIGHT, BORDER_SLACK_MM = 12.0, 0.3
# Corners of eyes in clay (28 eyes of made heads): 1.27 mm off across the view by landmarks, 0.91 with the ends of lids.
# On eight of these eyes 1.05, 0.99 and 0.94 with weights of 1, 2 and 5.
END_WEIGHT = 2.0
CONTACT_SHARE = 0.2
SLACK_MM, LANDMARK_WEIGHT, CANTHUS_WEIGHT = 1.5, 5.0, 15.0


def leading_lines(scan, template, model, pairs, closed, borders):
    """The rows that lead the skin to feature lines found on the scan, and what to report.

    borders dict side -> (upper, lower) lids.Border of open eyes, None where neither colours nor relief show one
    """
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
    rows, found = _lip_rows(scan, template, model, pairs, normals, darkness)
    leading, stats = leading + rows, stats | found
    led = set(LIPS_INNER) if found["lips_closed"] else set()
    for side in closed:
        if closed[side]:
            crease, found = _lid_crease(scan, template, model, pairs, normals, darkness, side)
            stats |= found
            if crease.found:
                leading += _lid_rows(template, model, pairs, crease, side, stop)
                led |= set(EYES[side])
    for side, lids in borders.items():
        for border, which, numbers in zip(lids, ("upper", "lower"), LIDS[side]):
            if border is None:
                continue
            line = template.lines[f"lid_{which}_{side}"]
            leading.append(border_rows(line, border, BORDER_WEIGHT, BORDER_SLACK_MM, stop))
            led |= set(numbers[1:-1])
            corners = {numbers[0], numbers[-1]}
            if border.ends is not None and not _placed(pairs, corners):
                places, points = border.ends
                leading.append(aside_rows(line[places], points, border.forward, END_WEIGHT, BORDER_SLACK_MM, stop))
                led |= corners
    leading.append(_landmark_rows(pairs, stop, led))
    return tuple(leading), stats


def _placed(pairs, numbers):
    """Whether a person placed any landmark of these numbers."""
    return bool((pairs.by_hand & np.isin(pairs.names, [f"mp{number}" for number in numbers])).any())


def _landmark_rows(pairs, stop, led):
    """Function of the current vertices: Rows that pull in landmarks by what they are off beyond SLACK_MM.

    led: numbers of landmarks that a crease leads better

    A landmark is right to a millimetre or two: held to the point it would bend a good fit (heads with known truth say
    so), but a border of the lips or a wing of the nose that is 5 mm off leaves no trace in the surface's distance.
    """
    free = ~np.isin(pairs.names, [f"mp{number}" for number in led])
    matrix, points, weights = pairs.rows[free][:, :stop].tocsr(), pairs.points[free], pairs.weights[free]

    def rows(vertices):
        here = matrix @ vertices
        gap = points - here
        length = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
        share = np.clip(1.0 - SLACK_MM / length, 0.0, 1.0)
        return [Rows(matrix, here + share[:, None] * gap, np.where(share > 0, LANDMARK_WEIGHT * weights, 0.0))]

    return rows


def _lip_rows(scan, template, model, pairs, normals, darkness):
    """Rows that draw the lip seam onto the crease and keep the lips in contact, if there is one; and its figures."""
    stop = len(normals)
    upper, lower = template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]
    middle = 0.5 * (model.vertices[upper] + model.vertices[lower])
    forward = normals[template.regions["lips"][:stop]].mean(axis=0)
    line = _led_by_lips(middle, model, pairs)
    crease = trace_crease(scan.vertices, scan.faces, line, forward, CreaseOptions(), darkness)
    stats = {"lips_closed": crease.found, "lip_crease_mm": float(np.median(crease.strength))}
    if not crease.found:
        return [], stats
    trust = LINE_WEIGHT * crease_trust(crease)
    # Closer than the template's lips rest, or one sees between them; at 0 they cross.
    rest = CONTACT_SHARE * (template.vertices[upper] - template.vertices[lower])
    contact = contact_rows(upper[1:-1], lower[1:-1], rest[1:-1], CONTACT_WEIGHT, stop)
    return [line_rows(upper, crease, trust, stop), line_rows(lower, crease, trust, stop), _always(contact)], stats


def _led_by_lips(line, model, pairs):
    """The model's line between the lips (k, 3), moved across and tilted by what the landmarks along it are off.

    On a coarse scan with hair the model's was 4 mm below the crease at one end, and the crease found 0.9 mm off.
    """
    inner = np.isin(pairs.names, [f"mp{number}" for number in LIPS_INNER])
    if inner.sum() < 4:
        return line
    here = pairs.rows[inner] @ model.vertices
    tilt, shift = np.polyfit(here[:, 0], (pairs.points[inner] - here) * [0.0, 1.0, 1.0], 1)
    return line + line[:, :1] * tilt + shift


def _lid_crease(scan, template, model, pairs, normals, darkness, side):
    """The crease between the lids of a shut eye, and its figures."""
    line = _lid_line(pairs, side, model.vertices[template.lines[f"lid_lower_{side}"]])
    here = template.regions["eyes"] & (np.sign(template.vertices[:, 0]) == (1 if side == "left" else -1))
    forward = normals[here[: len(normals)]].mean(axis=0)
    crease = trace_crease(scan.vertices, scan.faces, _from_right(line), forward, LID_CREASE, darkness)
    return crease, {f"lid_crease_{side}_mm": float(np.median(crease.strength))}


def _lid_rows(template, model, pairs, crease, side, stop):
    """Rows that draw both margins of a shut eye onto the crease between the lids, and the canthi to its ends.

    A crease between lids is as deep at its ends as elsewhere: on a scan they lay within 1 mm of the canthi that a hand
    picked, where the network's were 2 to 3 mm off.
    """
    upper, lower = template.lines[f"lid_upper_{side}"], template.lines[f"lid_lower_{side}"]
    trust = LINE_WEIGHT * crease_trust(crease)
    paired = _paired(upper, lower, model.vertices)
    contact = contact_rows(*paired, np.zeros((len(paired[0]), 3)), LID_CONTACT_WEIGHT, stop)
    lines = [line_rows(upper, crease, trust, stop), line_rows(lower, crease, trust, stop), _always(contact)]
    canthi = [i for i, name in enumerate(pairs.names) if name in CANTHI and name[2:] in map(str, EYES[side])]
    if not canthi:
        return lines
    points = crease.points[[0, -1]]
    nearest = np.linalg.norm(pairs.points[canthi][:, None] - points, axis=2).argmin(axis=1)
    ends = Rows(pairs.rows[canthi][:, :stop], points[nearest], np.full(len(canthi), CANTHUS_WEIGHT))
    return [*lines, _always(ends)]


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
    rows = [index[f"mp{i}"] for i in LIDS[side][1] if f"mp{i}" in index]
    return pairs.points[rows] if len(rows) >= 5 else otherwise


def _paired(upper, lower, vertices):
    """Two margins of different counts as pairs: each inner vertex of the upper with the lower's nearest by arc."""
    at, over = arc_fractions(vertices[upper]), arc_fractions(vertices[lower])
    nearest = np.abs(at[1:-1, None] - over[None, :]).argmin(axis=1)
    return upper[1:-1], lower[nearest]


def _from_right(line):
    return line if line[0, 0] < line[-1, 0] else line[::-1]
