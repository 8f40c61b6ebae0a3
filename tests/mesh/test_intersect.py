"""Triangles that cross, and triangles that only touch."""

import numpy as np

from facewright.mesh.intersect import intersections_of, self_intersections

FLAT = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]


def test_crossing_pair_is_found():
    through = [[1, 1, -1], [1.2, 1, 1], [1, 1.2, 1]]
    V, F = np.array(FLAT + through, float), np.array([[0, 1, 2], [3, 4, 5]])
    assert self_intersections(V, F).tolist() == [[0, 1]]
    assert len(self_intersections(V, F, np.array([True, False]))) == 0


def test_neighbours_and_distant_triangles_do_not_cross():
    V = np.array(FLAT + [[4, 4, 0], [0, 0, 1], [4, 0, 1], [0, 4, 1]], float)
    F = np.array([[0, 1, 2], [1, 3, 2], [4, 5, 6]])
    assert len(self_intersections(V, F)) == 0
    assert len(self_intersections(V, F[:0])) == 0


def test_pairs_of_a_few_faces_are_those_of_all():
    rng = np.random.default_rng(2)
    V = np.repeat(rng.uniform(0, 60, (400, 3)), 3, axis=0) + rng.normal(0, 3, (1200, 3))
    F = np.arange(1200).reshape(-1, 3)
    every = self_intersections(V, F)
    for asked in (rng.random(400) < 0.05, np.zeros(400, bool), np.ones(400, bool)):
        np.testing.assert_array_equal(intersections_of(V, F, asked), every[asked[every].any(axis=1)])
    assert len(every) > 20
