"""Polygon meshes of quads with a triangle among them."""

import numpy as np

from facewright.mesh.polygons import (
    polygon_adjacency,
    polygon_centers,
    polygon_edges,
    polygon_half_edges,
    triangulated,
)

#  3-4-5
#  |0|1\      two quads, then a triangle
#  0-1-2-6
POLYGONS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [2, 6, 5, -1]])
V = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [3, 0, 0]], float)


def test_edges_and_owners():
    edges, owner = polygon_half_edges(POLYGONS)
    assert len(edges) == 11 and np.bincount(owner).tolist() == [4, 4, 3]
    assert [2, 6] in edges.tolist() and [5, 2] in edges.tolist() and [6, 2] not in edges.tolist()
    assert len(polygon_edges(POLYGONS)) == 9


def test_triangles_keep_order_and_area():
    faces, owner = triangulated(POLYGONS)
    assert faces.tolist() == [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 6, 5]]
    assert owner.tolist() == [0, 0, 1, 1, 2]


def test_neighbours_share_an_edge():
    pairs, edges = polygon_adjacency(POLYGONS)
    found = {tuple(sorted(pair)): tuple(edge) for pair, edge in zip(pairs.tolist(), edges.tolist())}
    assert found == {(0, 1): (1, 4), (1, 2): (2, 5)}


def test_centers():
    assert np.allclose(polygon_centers(V, POLYGONS), [[0.5, 0.5, 0], [1.5, 0.5, 0], [7 / 3, 1 / 3, 0]])
