"""What is wrong in a fitted skin made good: faces that look away from the scan, and knots of faces that cross."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import dilate
from facewright.mesh.facing import folded_faces
from facewright.mesh.intersect import self_intersections
from facewright.mesh.normals import normalized
from facewright.mesh.untangle import reshaped, unfolded, untangled

# Rings of vertices around a knot in which everything gives way, or takes the template's shape, tried in turn.
GIVING_WAY, RESHAPED = (0, 1, 2, 3), (2, 3, 4, 5)
FOLD_MM = 3.0  # a face is only held to look as the scan does where the scan is this near
# Lines that the scan's own lead, and how far from them a scan shows a bump, or the other lid or lip, where the template
# has the thickness of lids and lips.
RIMS_MM = {"lip_seam": 1.0, "lid_": 2.0}
KNOTTY = ("eyes", "lips", "socket_left", "socket_right")
FLATTENED = (0, 1, 2, 3)  # rings around a fold that take the template's shape, tried in turn


def facing_the_scan(template, skin, faces, matches, region):
    """Skin (n, 3) without faces of a region that look away from the scan, as in the groove at a corner of the mouth."""
    n = len(skin)
    asked = (template.regions[region] & template.regions["outer"])[:n] & (matches.distance < FOLD_MM)
    expected = normalized(matches.normals[faces].sum(axis=1)) * asked[faces].all(axis=1)[:, None]
    return unfolded(skin, faces, expected, _led(template, n))


def without_knots(template, skin, faces):
    """Skin (n, 3) with the knots of lips and lids smoothed away.

    The lip seam and the skin beside them hold; what lies around a knot gives way only where it does not come loose, and
    what smoothing does not loosen takes the template's shape.
    """
    n = len(skin)
    knotty = np.any([template.regions[name][:n] for name in KNOTTY], axis=0)
    seam = np.zeros(n, bool)
    seam[[template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]]] = True
    in_face = template.regions["face"][:n][faces].all(axis=1)

    def crossing(vertices):
        pairs = self_intersections(vertices, faces)
        return np.unique(pairs[in_face[pairs].any(axis=1)])

    best = untangled(skin, faces, ~knotty | seam)
    left = crossing(best)
    knot = np.zeros(n, bool)
    knot[faces[left].ravel()] = True
    for rings in GIVING_WAY:
        if not len(left):
            break
        tried = _closed_as(skin, untangled(skin, faces, (~knotty | seam) & ~dilate(knot, faces, rings)), template)
        remaining = crossing(tried)
        if len(remaining) < len(left):
            best, left = tried, remaining
    for rings in RESHAPED:
        if not len(left):
            break
        knot[:] = False
        knot[faces[left].ravel()] = True
        shape = reshaped(best, template.vertices[:n], faces, dilate(knot, faces, rings) & knotty)
        tried = _closed_as(skin, shape, template)
        remaining = crossing(tried)
        if len(remaining) < len(left):
            best, left = tried, remaining
    return best


def _closed_as(before, after, template):
    """Skin (n, 3) after smoothing, with paired lip points as far apart as they were before."""
    upper, lower = template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]
    half = (before[upper] - before[lower]) / 2
    middle = (after[upper] + after[lower]) / 2
    closed = after.copy()
    closed[upper], closed[lower] = middle + half, middle - half
    return closed


def without_folds(template, skin, faces, surface):
    """Skin (n, 3) with fewer faces that look away from a scan's Surface, rims of lids and lips apart.

    What smoothing turns to the scan in a groove may turn a face beside it away. Such faces take the template's shape
    where that leaves fewer of them, and no more that cross.
    """
    n = len(skin)
    outer = (template.regions["face"] & template.regions["outer"])[:n][faces].all(axis=1)
    lines = {start: _line_vertices(template, start) for start in RIMS_MM}

    def folded(vertices, asked):
        found = folded_faces(surface, vertices, faces, asked)
        middles, apart = vertices[faces[found]].mean(axis=1), np.ones(len(found), bool)
        for start, line in lines.items():
            apart &= cKDTree(vertices[line]).query(middles)[0] > RIMS_MM[start]
        return found[apart]

    def nearest_shape(best, left):
        """The first trial with fewer folds and no more crossings, and its folds; None if there is none."""
        knot = np.zeros(n, bool)
        knot[faces[left].ravel()] = True
        around = outer & dilate(knot, faces, max(FLATTENED) + 2)[faces].any(axis=1)
        for rings in FLATTENED:
            free = dilate(knot, faces, rings) & ~_led(template, n)
            if not free.any():
                continue
            tried = reshaped(best, template.vertices[:n], faces, free)
            remaining = folded(tried, around)
            if len(remaining) < len(left) and _crossings(tried, faces, around) <= _crossings(best, faces, around):
                return tried, remaining
        return None

    best, left = skin, folded(skin, outer)
    while len(left) and (found := nearest_shape(best, left)) is not None:
        best, left = found
    return best


def _crossings(vertices, faces, among):
    return len(self_intersections(vertices, faces, among))


def _led(template, n):
    """(n,) bool: vertices of lines that the scan's own lead."""
    keep = np.zeros(n, bool)
    for start in RIMS_MM:
        keep[_line_vertices(template, start)] = True
    return keep


def _line_vertices(template, start):
    """Indices of all vertices of the lines whose names start so."""
    return np.concatenate([line for name, line in template.lines.items() if name.startswith(start)])
