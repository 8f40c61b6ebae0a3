"""Winding numbers of a triangle mesh about a few points: how often the surface goes round each.

A tree over the faces (Barill et al. 2018, "Fast Winding Numbers for Soups and Clouds", as libigl has it) takes longer
to build than a few dozen points take to be asked about all faces of a patch at once, and a skin that moves would need
a new one for every pose. Here the same far field is taken without a tree.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import cross, dot, lengths

_FAR = 4.0  # sizes of a face: from there on it counts as a dipole at its middle; a head's skin errs by 0.005 at most
_AT_ONCE = 1 << 17  # faces times points


def winding_numbers(vertices, faces, points):
    """(k,) turns of a mesh's surface about points (k, 3): 1 inside a closed one, 0 outside.

    vertices (n, 3), faces (m, 3). Quick where points are few; time grows as m times k.
    """
    if not len(points):
        return np.zeros(0)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area, middle = 0.5 * cross(b - a, c - a), (a + b + c) / 3.0
    size = np.max([lengths(corner - middle) for corner in (a, b, c)], axis=0)
    # Rows whose product with a point's (x, y, z, 1) is half of what its squared distance lacks of |x|^2, and how far
    # the point lies beneath the face, times its area.
    rows = (-middle, 0.5 * dot(middle, middle)), (-area, dot(area, middle))
    about = np.stack([np.column_stack(row) for row in rows])
    step = max(1, _AT_ONCE // max(len(faces), 1))
    pieces = [points[start : start + step] for start in range(0, len(points), step)]
    return np.concatenate([_turns((a, b, c), about, (_FAR * size) ** 2, piece) for piece in pieces])


def _turns(corners, about, far, points):
    """As winding_numbers; corners 3 x (m, 3), about (2, m, 4), far (m,) squared distance of what is a dipole."""
    half, beneath = np.column_stack([points, np.ones(len(points))]) @ about.transpose(0, 2, 1)  # (k, m) each
    squared = 2.0 * half + dot(points, points)[:, None]
    near = np.flatnonzero(squared < far)
    squared.ravel()[near] = np.inf
    beneath /= squared * np.sqrt(squared)
    who, face = np.divmod(near, len(far))
    angles = _solid_angles(*(corner[face] - points[who] for corner in corners))
    return (beneath.sum(axis=1) + np.bincount(who, angles, len(points))) / (4.0 * np.pi)


def _solid_angles(a, b, c):
    """(k,) of triangles as seen from the origin, corners (k, 3) (van Oosterom and Strackee 1983)."""
    la, lb, lc = lengths(a), lengths(b), lengths(c)
    under = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    return 2.0 * np.arctan2(dot(a, cross(b, c)), under)
