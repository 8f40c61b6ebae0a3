"""Samples of a surface are even; borders are told from seams."""

import numpy as np

from facewright.mesh.sampling import on_border, sample_surface


def test_samples_spread_by_area_and_lie_on_their_faces():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5], [3, 0, 5], [0, 3, 5]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])  # areas 0.5 and 4.5
    samples = sample_surface(vertices, faces, 1000)
    assert (samples.faces == 1).sum() == 900
    assert np.allclose(samples.barycentric.sum(axis=1), 1)
    assert samples.barycentric.min() >= 0
    assert set(np.unique(samples.points[:, 2])) == {0.0, 5.0}


def test_samples_are_even_inside_a_face():
    vertices, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    points = sample_surface(vertices, faces, 4000).points
    assert np.allclose(points.mean(axis=0), [1 / 3, 1 / 3, 0], atol=2e-3)


def test_samples_of_a_subset_stay_in_it(sheet):
    vertices, faces = sheet()
    subset = np.arange(len(faces)) < 10
    assert (sample_surface(vertices, faces, 100, subset).faces < 10).all()
    assert not len(sample_surface(vertices, faces, 100, np.zeros(len(faces), bool)).points)


def test_border_points_are_those_on_border_edges_and_corners(sheet):
    _, faces = sheet(3)  # one inner vertex, 4
    at = np.array([f for f in range(len(faces)) if 4 in faces[f]])[:1]
    inner = (faces[at[0]] == 4).astype(float)[None]
    assert not on_border(faces, at, inner)[0]
    corner = (faces[0] == 0).astype(float)[None]
    assert on_border(faces, np.array([0]), corner)[0]
    assert not on_border(faces, at, np.full((1, 3), 1 / 3))[0]
