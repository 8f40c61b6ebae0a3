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
    frame = _planes(direction)
    (p, up), (q, uq) = (_seen(triangle, *frame, direction) for triangle in (one, other))
    at, there, valid = (np.concatenate(parts, axis=1) for parts in zip(_corners_over(p, q), _edges_over(p, q)))
    height = np.where(valid, (at * up[:, None]).sum(axis=2) - (there * uq[:, None]).sum(axis=2), -np.inf)
    best, each = height.argmax(axis=1), np.arange(len(one))
    over = valid.any(axis=1)[:, None]
    return height[each, best], np.where(over, at[each, best], 0.0), np.where(over, there[each, best], 0.0)


def _corners_over(p, q):
    """Places where a corner of one triangle lies over the other, p, q (k, 3, 2): barycentric (k, 6, 3) of both and
    (k, 6) bool: so it does."""
    corner = np.broadcast_to(np.eye(3), (len(p), 3, 3))
    of_q, of_p = barycentric(q, p), barycentric(p, q)
    at, there = np.stack([corner, of_p], axis=2), np.stack([of_q, corner], axis=2)
    inside = np.minimum(at, there).min(axis=3) >= -_ON_EDGE
    return at.reshape(-1, 6, 3), there.reshape(-1, 6, 3), inside.reshape(-1, 6)


def _edges_over(p, q):
    """The same where edges of the two pass each other: (k, 9, 3) twice and (k, 9)."""
    i, j = np.divmod(np.arange(9), 3)
    t, s = where_edges_pass(p[:, i], p[:, i - 2], q[:, j], q[:, j - 2])
    at, there = np.zeros((len(p), 9, 3)), np.zeros((len(p), 9, 3))
    edge = np.arange(9)
    at[:, edge, i], at[:, edge, i - 2] = 1.0 - t, t
    there[:, edge, j], there[:, edge, j - 2] = 1.0 - s, s
    return at, there, (t >= 0.0) & (t <= 1.0) & (s >= 0.0) & (s <= 1.0)


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
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def barycentric(triangle, points):
    """(k, c, 3) of points (k, c, 2) in triangles (k, 3, 2); those of no area hold nothing."""
    a = triangle[:, :1]
    e, f, to = triangle[:, 1:2] - a, triangle[:, 2:] - a, points - a
    area = _cross(e, f)
    flat = np.abs(area) < _NOTHING
    area = np.where(flat, 1.0, area)
    second, third = _cross(to, f) / area, _cross(e, to) / area
    return np.where(flat[..., None], -1.0, np.stack([1.0 - second - third, second, third], axis=-1))


def where_edges_pass(a, b, c, d):
    """Shares (...), (...) of edges a-b and c-d (..., 2) at which they pass each other; -1 where they are parallel."""
    r, s, to = b - a, d - c, c - a
    turn = _cross(r, s)
    parallel = np.abs(turn) < _NOTHING
    turn = np.where(parallel, 1.0, turn)
    return np.where(parallel, -1.0, _cross(to, s) / turn), np.where(parallel, -1.0, _cross(to, r) / turn)
