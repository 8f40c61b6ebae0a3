"""Triangles in four: the surface stays what it is."""

import numpy as np

from facewright.mesh.normals import face_areas, face_normals
from facewright.mesh.subdivide import split_in_four, with_midpoints


def test_a_split_surface_is_the_same_surface():
    rng = np.random.default_rng(0)
    vertices, faces = rng.normal(size=(6, 3)), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 1, 5]])
    edges, fine = split_in_four(faces, len(vertices))
    points = with_midpoints(vertices, edges)
    assert len(edges) == 9 and len(points) == 15 and len(fine) == 16
    quarters = np.repeat(face_areas(vertices, faces) / 4, 4)
    np.testing.assert_allclose(face_areas(points, fine), quarters)
    expected = np.repeat(face_normals(vertices, faces), 4, axis=0)
    np.testing.assert_allclose(face_normals(points, fine), expected, atol=1e-12)


def test_neighbours_share_the_vertex_in_their_middle_whatever_the_order_of_corners():
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    edges, fine = split_in_four(faces, 4)
    shared = 4 + int(np.flatnonzero((edges == [0, 1]).all(axis=1))[0])
    assert (fine[:4] == shared).any() and (fine[4:] == shared).any()
