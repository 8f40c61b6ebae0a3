"""A row of teeth as a solid: what is inside leaves on the outer side, whatever pose the row is in."""

import igl
import numpy as np
import pytest

from facewright.contact.teeth import Teeth, rows_of_teeth
from facewright.solve.procrustes import best_rotation


def arch(radius=20.0, depth=6.0, height=8.0, n=60):
    """A closed half ring of rectangular section around the origin, open to -z, outward faces."""
    angle = np.linspace(0, np.pi, n)
    ring = np.stack([np.cos(angle), np.zeros(n), np.sin(angle)], axis=1)
    inner, outer = radius * ring, (radius + depth) * ring
    up = np.array([0, height / 2, 0])
    V = np.concatenate([outer - up, outer + up, inner + up, inner - up])
    faces = []
    for i in range(n - 1):
        for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
            p, q, r, s = a * n + i, b * n + i, b * n + i + 1, a * n + i + 1
            faces += [[p, q, r], [p, r, s]]
    for i, flip in ((0, 1), (n - 1, -1)):
        corners = [i, n + i, 2 * n + i, 3 * n + i][::flip]
        faces += [[corners[0], corners[2], corners[1]], [corners[0], corners[3], corners[2]]]
    F = np.array(faces)
    normals = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    volume = (V[F].mean(axis=1) * normals).sum()
    return V, F if volume > 0 else F[:, [0, 2, 1]]


@pytest.fixture(scope="module")
def row():
    return Teeth(*arch())


def test_inside_leaves_forwards_even_when_the_back_is_nearer(row):
    points = np.array([[0.0, 0.0, 21.0], [0.0, 0.0, 27.0], [0.0, 0.0, 15.0]])
    way, _ = row.way_out(points, row.vertices)
    assert np.allclose(way[0], [0, 0, 5], atol=0.1)
    assert not way[1:].any()


def test_a_turned_row_answers_the_same(row):
    rng = np.random.default_rng(0)
    R = best_rotation(*rng.normal(size=(2, 6, 3)))
    points = rng.uniform([-25, -4, 0], [25, 4, 26], (200, 3))
    shift = np.array([3.0, -40.0, 7.0])
    way, _ = row.way_out(points, row.vertices)
    turned, _ = row.way_out(points @ R.T + shift, row.vertices @ R.T + shift)
    assert way.any() and np.abs(turned - way @ R.T).max() < 1e-9


def test_what_is_inside_has_a_way_out_and_nothing_else(hm08):
    rng = np.random.default_rng(1)
    for place, row in rows_of_teeth(hm08, hm08.vertices):
        V = hm08.vertices[place]
        points = rng.uniform(V.min(axis=0), V.max(axis=0), (4000, 3))
        inside = igl.fast_winding_number(row.vertices, row.faces, points) > 0.5
        way, _ = row.way_out(points, V)
        leaves = way.any(axis=1)
        assert not leaves[~inside].any()
        assert leaves[inside].all()  # where two teeth of the row stand in each other too


def test_a_strip_is_no_solid():
    V, F = arch()
    n = len(V) // 4
    front = F[(2 * n > F).all(axis=1)]
    strip = Teeth(V[: 2 * n], front)
    assert not strip.solid and not strip.way_out(np.array([[0.0, 0.0, 21.0]]), strip.vertices)[0].any()


def test_who_moves_less_than_its_clearance_stays_out(row):
    rng = np.random.default_rng(1)
    points = rng.uniform([-30, -6, -4], [30, 6, 30], (2000, 3))
    way, clearance = row.way_out(points, row.vertices)
    assert not clearance[way.any(axis=1)].any() and (clearance > 1.0).any()
    step = rng.normal(size=points.shape)
    step *= 0.999 * (clearance / np.linalg.norm(step, axis=1))[:, None]
    outside = ~way.any(axis=1)
    assert not row.way_out((points + step)[outside], row.vertices)[0].any()
