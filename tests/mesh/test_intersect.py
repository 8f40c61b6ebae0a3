"""Triangles that cross, and triangles that only touch."""

import numpy as np

from facewright.mesh.intersect import self_intersections

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
