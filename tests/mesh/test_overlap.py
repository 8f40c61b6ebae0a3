"""How far triangles reach past each other, and where they cross."""

import numpy as np

from facewright.mesh.normals import cross, normalized
from facewright.mesh.overlap import crossing_points, overlap_along

UP = np.array([[0.0, 0.0, 1.0]])
FLAT = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]])


def lifted(triangle, by):
    return triangle + np.array([0.0, 0.0, by])


def test_parallel_triangles_overlap_by_their_distance():
    depth, one, other = overlap_along(lifted(FLAT, 0.3), FLAT, UP)
    assert np.isclose(depth, 0.3)
    assert np.allclose([one.sum(axis=1), other.sum(axis=1)], 1.0)


def test_the_deepest_place_is_the_same_on_both():
    rng = np.random.default_rng(4)
    one, other = rng.normal(size=(2, 200, 3, 3))
    way = normalized(rng.normal(size=(200, 3)))
    depth, a, b = overlap_along(one, other, way)
    met = np.isfinite(depth)
    assert met.sum() > 20
    apart = np.einsum("kc,kcd->kd", a, one)[met] - np.einsum("kc,kcd->kd", b, other)[met]
    assert np.allclose(apart, depth[met, None] * way[met], atol=1e-9)
    assert (a[met] >= -1e-6).all() and (b[met] >= -1e-6).all()


def test_moving_by_the_overlap_leaves_nothing():
    rng = np.random.default_rng(5)
    one, other = rng.normal(size=(2, 200, 3, 3))
    way = normalized(rng.normal(size=(200, 3)))
    depth = overlap_along(one, other, way)[0]
    met = np.isfinite(depth)
    moved = one[met] - (depth[met, None] * way[met])[:, None]
    assert np.allclose(overlap_along(moved, other[met], way[met])[0], 0.0, atol=1e-9)


def test_triangles_side_by_side_do_not_overlap():
    assert np.isneginf(overlap_along(FLAT + [10.0, 0.0, 0.0], FLAT, UP)[0])


def test_a_crossing_lies_in_both_planes():
    post = np.array([[[1.0, 1.0, -1.0], [1.2, 1.0, 1.0], [0.8, 1.0, 1.0]]])
    point = crossing_points(FLAT, post)[0]
    assert np.isclose(point[2], 0.0) and np.isclose(point[1], 1.0) and 0.8 < point[0] < 1.2


def test_cross_is_numpys():
    rng = np.random.default_rng(6)
    a, b = rng.normal(size=(2, 50, 3))
    assert np.array_equal(cross(a, b), np.cross(a, b))
