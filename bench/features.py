"""Where a template has the features that were picked on scans by hand: the same place on any fit of it."""

from __future__ import annotations

import numpy as np

from facewright.mesh.adjacency import vertex_adjacency
from facewright.mesh.closest import Surface
from facewright.mesh.normals import vertex_normals

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


def feature_vertices(template):
    """dict feature -> vertex index on the template's neutral: corners, lip contour, canthi, nose."""
    V, lines = template.vertices, template.lines
    upper, lower = lines["lip_outer_upper"], lines["lip_outer_lower"]
    features = {"mouth_corner_right": lines["lip_seam_upper"][0], "mouth_corner_left": lines["lip_seam_upper"][-1]}
    for side in ("right", "left"):
        features[f"canthus_inner_{side}"] = lines[f"lid_upper_{side}"][0]
        features[f"canthus_outer_{side}"] = lines[f"lid_upper_{side}"][-1]
        mine = upper[V[upper, 0] < 0] if side == "right" else upper[V[upper, 0] > 0]
        features[f"lip_peak_{side}"] = mine[V[mine, 1].argmax()]
    features["lip_upper_middle"] = upper[np.abs(V[upper, 0]).argmin()]
    features["lip_lower_middle"] = lower[np.abs(V[lower, 0]).argmin()]
    return {name: int(vertex) for name, vertex in (features | _nose(template, features["lip_upper_middle"])).items()}


def _nose(template, lip_middle):
    """Nose tip, subnasale and the widest points of the alar wings, from the shape of the neutral."""
    V = template.vertices
    face = np.flatnonzero(template.regions["face"] & ~template.regions["nostrils"])
    middle = face[(np.abs(V[face, 0]) < 2.0) & (V[face, 1] < -5.0) & (V[face, 1] > V[lip_middle, 1])]
    tip = middle[V[middle, 2].argmax()]
    # Subnasale: deepest behind the chord from the tip to the upper lip, seen from the side.
    a, b = V[tip, 1:], V[lip_middle, 1:]
    below = middle[V[middle, 1] < V[tip, 1] - 2.0]
    chord = (b - a) / np.linalg.norm(b - a)
    behind = chord[0] * (V[below, 2] - a[1]) - chord[1] * (V[below, 0 + 1] - a[0])
    subnasale = below[np.abs(behind).argmax()]
    normals = vertex_normals(V, template.faces[template.skin.face_slice])
    near = face[(V[face, 1] < V[tip, 1] + 8.0) & (V[face, 1] > V[subnasale, 1] - 3.0)]
    near = near[(np.abs(V[near, 0]) < 26.0) & (V[near, 2] > V[subnasale, 2] - 14.0)]
    result = {"nose_tip": tip, "subnasale": subnasale}
    # The wing is a bulge: behind its rim the groove to the cheek looks sideways too, out of the sight of who picks.
    bulges = near[_height_over_neighbours(template, normals)[near] > 0]
    for side, sign in (("right", -1.0), ("left", 1.0)):
        wing = bulges[sign * normals[bulges, 0] > 0.85]
        result[f"alar_wing_{side}"] = wing[(sign * V[wing, 0]).argmax()]
    return result


def _height_over_neighbours(template, normals):
    """(n,) mm by which a vertex stands over the mean of its neighbours: positive where the skin bulges."""
    V = template.vertices
    A = vertex_adjacency(template.faces[template.skin.face_slice], len(V))
    count = np.maximum(np.asarray(A.sum(axis=1)).ravel(), 1.0)
    return np.einsum("nc,nc->n", V - (A @ V) / count[:, None], normals)


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
