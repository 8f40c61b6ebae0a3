"""How far triangles reach past each other along a direction, and where two that cross do so."""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import cross, normalized

_ON_EDGE = 1e-9  # of a triangle: as near to its border as this counts as on it
_NOTHING = 1e-15


def overlap_along(one, other, direction):
    """How far triangles reach past others where they lie over each other along a direction.

    one, other (k, 3, 3) corners; direction (k, 3) unit
    returns    (k,) greatest height of the first less that of the second over the same place, -inf where they do not lie
               over each other; where that is: barycentric (k, 3) of the first and of the second
    """
    k = len(one)
    frame = _planes(direction)
    (p, up), (q, uq) = (_seen(triangle, *frame, direction) for triangle in (one, other))
    best, a, b = np.full(k, -np.inf), np.zeros((k, 3)), np.zeros((k, 3))

    def offer(at, there, valid):
        height = np.einsum("ki,ki->k", at, up) - np.einsum("ki,ki->k", there, uq)
        better = valid & (height > best)
        best[better], a[better], b[better] = height[better], at[better], there[better]

    for i in range(3):
        corner = np.broadcast_to(np.eye(3)[i], (k, 3))
        for under, mine, points in ((True, q, p[:, i]), (False, p, q[:, i])):
            share = _barycentric(mine, points)
            offer(*((corner, share) if under else (share, corner)), (share >= -_ON_EDGE).all(axis=1))
    for i in range(3):
        for j in range(3):
            t, s = _where_edges_pass(p[:, i], p[:, i - 2], q[:, j], q[:, j - 2])
            at, there = np.zeros((k, 3)), np.zeros((k, 3))
            at[:, i], at[:, i - 2] = 1.0 - t, t
            there[:, j], there[:, j - 2] = 1.0 - s, s
            offer(at, there, (t >= 0.0) & (t <= 1.0) & (s >= 0.0) & (s <= 1.0))
    return best, a, b


def crossing_points(one, other):
    """(k, 3) a point on the line in which triangles one, other (k, 3, 3) cross; their middles where they do not."""
    total, count = np.zeros((len(one), 3)), np.zeros(len(one))
    for a, b in ((one, other), (other, one)):
        normal = cross(b[:, 1] - b[:, 0], b[:, 2] - b[:, 0])
        height = np.einsum("kij,kj->ki", a - b[:, :1], normal)
        for i in range(3):
            fall = height[:, i] - height[:, i - 2]
            t = height[:, i] / np.where(fall == 0.0, 1.0, fall)
            point = a[:, i] + t[:, None] * (a[:, i - 2] - a[:, i])
            pierced = height[:, i] * height[:, i - 2] < 0.0
            for j in range(3):
                side = cross(b[:, j - 2] - b[:, j], point - b[:, j])
                pierced &= np.einsum("kj,kj->k", side, normal) >= 0.0
            total[pierced] += point[pierced]
            count += pierced
    middle = 0.5 * (one.mean(axis=1) + other.mean(axis=1))
    return np.where(count[:, None] > 0, total / np.maximum(count, 1.0)[:, None], middle)


def _planes(direction):
    """Two unit vectors (k, 3) across each direction (k, 3)."""
    least = np.eye(3)[np.abs(direction).argmin(axis=1)]
    u = normalized(cross(direction, least))
    return u, cross(direction, u)


def _seen(triangle, u, v, direction):
    """Corners (k, 3, 2) across a direction, and their heights (k, 3) along it."""
    x, y, height = (np.einsum("kij,kj->ki", triangle, axis) for axis in (u, v, direction))
    return np.stack([x, y], axis=-1), height


def _cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _barycentric(triangle, points):
    """(k, 3) of points (k, 2) in triangles (k, 3, 2); those of no area hold nothing."""
    e, f, to = triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0], points - triangle[:, 0]
    area = _cross(e, f)
    flat = np.abs(area) < _NOTHING
    area = np.where(flat, 1.0, area)
    second, third = _cross(to, f) / area, _cross(e, to) / area
    return np.where(flat[:, None], -1.0, np.stack([1.0 - second - third, second, third], axis=1))


def _where_edges_pass(a, b, c, d):
    """Shares (k,), (k,) of the edges a-b and c-d (k, 2) at which they pass each other; -1 where they are parallel."""
    r, s, to = b - a, d - c, c - a
    turn = _cross(r, s)
    parallel = np.abs(turn) < _NOTHING
    turn = np.where(parallel, 1.0, turn)
    return np.where(parallel, -1.0, _cross(to, s) / turn), np.where(parallel, -1.0, _cross(to, r) / turn)
