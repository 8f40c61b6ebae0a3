"""Winding numbers of a triangle mesh about a few points: how often the surface goes round each.

A tree over the faces (Barill et al. 2018, "Fast Winding Numbers for Soups and Clouds", as libigl has it) takes longer to
build than it takes to ask a few dozen points about all faces of a patch at once, and a skin that moves would need a new
one for every pose. Here the same far field is taken without a tree.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import cross, lengths

_FAR = 4.0  # sizes of a face: from there on it counts as one dipole at its middle, which errs by under 0.001 of a turn
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
    step = max(1, _AT_ONCE // max(len(faces), 1))
    pieces = [points[start : start + step] for start in range(0, len(points), step)]
    return np.concatenate([_turns((a, b, c), area, middle, size, piece) for piece in pieces])


def _turns(corners, area, middle, size, points):
    """As winding_numbers; area vectors (m, 3), middles (m, 3) and sizes (m,) of faces with corners three times (m, 3)."""
    squared = (middle**2).sum(axis=1)[:, None] - 2.0 * (middle @ points.T) + (points**2).sum(axis=1)
    near = squared < (_FAR * size[:, None]) ** 2
    toward = (area * middle).sum(axis=1)[:, None] - area @ points.T
    squared[near] = np.inf
    solid = (toward / (squared * np.sqrt(squared))).sum(axis=0)
    face, who = np.nonzero(near)
    solid += np.bincount(who, _solid_angles(*(corner[face] - points[who] for corner in corners)), len(points))
    return solid / (4.0 * np.pi)


def _solid_angles(a, b, c):
    """(k,) of triangles as seen from the origin, corners (k, 3) (van Oosterom and Strackee 1983)."""
    la, lb, lc = lengths(a), lengths(b), lengths(c)
    over = (a * cross(b, c)).sum(axis=1)
    under = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return 2.0 * np.arctan2(over, under)
