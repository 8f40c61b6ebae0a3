"""Where a template has the features that were picked on scans by hand: the same place on any fit of it."""

from __future__ import annotations

import numpy as np
from common import read_json

from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.raster import RayScene

# james.ljson keeps its points label by label; iBUG-68 numbers of each block of 68, in its own order.
LJSON_TO_IBUG = (
    *range(1, 18),  # chin
    *range(37, 43),  # the person's right eye
    *range(43, 49),
    *range(18, 23),  # the person's right brow
    *range(28, 37),  # nose
    *range(23, 28),
    *range(49, 69),  # mouth
)


def feature_points(template, vertices):
    """dict feature -> (3,) on a fit (n, 3): corners, lip contour, canthi, nose.

    The border of the red is the template's line. Mouth corners, canthi and alar wings were picked by hand on close-ups
    of the template's neutral as they were on the scans (data/templates.features.json): the ends of the lines of contact
    lie out of sight in the folds.
    """
    V, lines = template.vertices, template.lines
    upper, lower = lines["lip_outer_upper"], lines["lip_outer_lower"]
    features = {}
    for side in ("right", "left"):
        mine = upper[V[upper, 0] < 0] if side == "right" else upper[V[upper, 0] > 0]
        features[f"lip_peak_{side}"] = mine[V[mine, 1].argmax()]
    features["lip_upper_middle"] = upper[np.abs(V[upper, 0]).argmin()]
    features["lip_lower_middle"] = lower[np.abs(V[lower, 0]).argmin()]
    features |= _nose(template, features["lip_upper_middle"])
    return {name: vertices[vertex] for name, vertex in features.items()} | _picked(template, vertices)


def _picked(template, vertices):
    """Features picked on the template's left half and mirrored, carried to a fit (n, 3)."""
    stop = template.skin.vertices[1]
    faces = template.faces[template.skin.face_slice]
    scene = RayScene(template.vertices[:stop], faces)
    result = {}
    for name, (x, y) in read_json("templates.features.json")[template.info["name"]].items():
        for side, sign in (("left", 1.0), ("right", -1.0)):
            hit = scene.cast(np.array([[sign * x, y, 500.0]]), np.array([[0.0, 0.0, -1.0]]))
            result[f"{name}_{side}"] = interpolate(vertices[:stop], faces, hit.face, hit.barycentric)[0]
    return result


def off_by_mm(name, fitted, picked):
    """mm between a feature on a fit and its picking, (3,) each.

    An alar wing is picked at the nose's outline from in front, where the surface runs along the line of sight: the
    picking says nothing about its depth.
    """
    seen = [1.0, 1.0, 0.0] if name.startswith("alar_wing") else [1.0, 1.0, 1.0]
    return float(np.linalg.norm((fitted - picked) * seen))


def _nose(template, lip_middle):
    """Vertices of nose tip and subnasale, from the shape of the neutral."""
    V = template.vertices
    face = np.flatnonzero(template.regions["face"] & ~template.regions["nostrils"])
    middle = face[(np.abs(V[face, 0]) < 2.0) & (V[face, 1] < -5.0) & (V[face, 1] > V[lip_middle, 1])]
    tip = middle[V[middle, 2].argmax()]
    # Subnasale: deepest behind the chord from the tip to the upper lip, seen from the side.
    a, b = V[tip, 1:], V[lip_middle, 1:]
    below = middle[V[middle, 1] < V[tip, 1] - 2.0]
    chord = (b - a) / np.linalg.norm(b - a)
    behind = chord[0] * (V[below, 2] - a[1]) - chord[1] * (V[below, 1] - a[0])
    return {"nose_tip": tip, "subnasale": below[np.abs(behind).argmax()]}


def ibug_positions(template, vertices):
    """dict "p1".."p68" -> (3,) points on a fit (n, 3), for the landmarks that the template trusts."""
    marks = template.landmarks
    positions = marks.positions(vertices, template.faces)
    return {
        name: positions[i]
        for i, name in enumerate(marks.names)
        if name.startswith("p") and name[1:].isdigit() and marks.weights[i] > 0
    }


def polyline_distance(points, line):
    """(k,) distances of points (k, 3) from a polyline (s, 3)."""
    doubled = np.vstack([line, line[1:] * 0.5 + line[:-1] * 0.5])
    n = len(line)
    steps = np.arange(n - 1)
    return Surface(doubled, np.stack([steps, steps + 1, n + steps], axis=1)).closest(points).distance
