"""Winding numbers of a triangle mesh about a few points: how often the surface goes round each.

A tree over the faces (Barill et al. 2018, "Fast Winding Numbers for Soups and Clouds", as libigl has it) takes longer
to build than a few dozen points take to be asked about all faces of a patch at once, and a skin that moves would need
a new one for every pose. Here the same far field is taken without a tree.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import cross, dot, face_corners, lengths

_FAR = 4.0  # sizes of a face: from there on it counts as a dipole at its middle; a head's skin errs by 0.005 at most
_AT_ONCE = 1 << 17  # faces times points


def winding_numbers(vertices, faces, points):
    """(k,) turns of a mesh's surface about points (k, 3): 1 inside a closed one, 0 outside.

    vertices (n, 3), faces (m, 3). Quick where points are few; time grows as m times k.
    """
    if not len(points):
        return np.zeros(0)
    a, b, c = corners = face_corners(vertices, faces)
    area, middle = 0.5 * cross(b - a, c - a), (a + b + c) / 3.0
    size = np.zeros(len(faces))
    for corner in corners:
        arm = corner - middle
        np.maximum(size, dot(arm, arm), out=size)
    origin = middle.mean(axis=0)
    # Rows whose product with a point's (x, y, z, 1) is half of what its squared distance lacks of |x|^2, and how far
    # the point lies beneath the face, times its area. Single precision errs by 1e-6 of a turn.
    middle = middle - origin
    about = np.empty((2, len(faces), 4), np.float32)
    about[0, :, :3], about[0, :, 3] = -middle, 0.5 * dot(middle, middle)
    about[1, :, :3], about[1, :, 3] = -area, dot(area, middle)
    far = (_FAR**2 * size).astype(np.float32)
    step = max(1, _AT_ONCE // max(len(faces), 1))
    pieces = [points[start : start + step] for start in range(0, len(points), step)]
    return np.concatenate([_turns(corners, origin, about, far, piece) for piece in pieces])


def _turns(corners, origin, about, far, points):
    """As winding_numbers; corners 3 x (m, 3), about (2, m, 4) with respect to an origin (3,), far (m,) squared distance
    from which on a face is a dipole."""
    there = np.ones((len(points), 4), np.float32)
    there[:, :3] = points - origin
    squared, beneath = there @ about[0].T, there @ about[1].T  # (k, m) each
    squared *= 2.0
    squared += dot(there, there)[:, None]
    near = np.flatnonzero(squared < far)
    squared.ravel()[near] = np.inf
    squared *= np.sqrt(squared)
    beneath /= squared
    who, face = np.divmod(near, len(far))
    angles = _solid_angles(*(corner.take(face, axis=0) - points[who] for corner in corners))
    return (beneath.sum(axis=1, dtype=float) + np.bincount(who, angles, len(points))) / (4.0 * np.pi)


def _solid_angles(a, b, c):
    """(k,) of triangles as seen from the origin, corners (k, 3) (van Oosterom and Strackee 1983)."""
    la, lb, lc = lengths(a), lengths(b), lengths(c)
    under = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    return 2.0 * np.arctan2(dot(a, cross(b, c)), under)
