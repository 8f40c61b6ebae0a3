"""Openness of shapes where it is known."""

import numpy as np

from facewright.mesh.openness import sphere_directions, vertex_openness


def sphere(radius, inward=False):
    import igl

    V, F = igl.icosahedron()
    for _ in range(3):
        V, F = igl.upsample(V, F)
    V = radius * V / np.linalg.norm(V, axis=1, keepdims=True)
    return V, F[:, ::-1] if inward else F


def test_directions_are_even():
    directions = sphere_directions(200)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1)
    assert np.abs(directions.mean(axis=0)).max() < 1e-2


def test_convex_is_open_and_enclosed_is_not():
    V, F = sphere(50.0)
    inner, G = sphere(20.0)
    both, faces = np.vstack([V, inner]), np.vstack([F, G + len(V)])
    result = vertex_openness(both, faces)
    assert result[: len(V)].min() == 1.0
    assert result[len(V) :].max() == 0.0


def test_bowl_is_darkest_at_its_bottom():
    V, F = sphere(50.0, inward=True)
    F = F[(V[F][:, :, 1] < 0).all(axis=1)]
    result = vertex_openness(V, F, n_directions=400)
    bottom, rim = np.argmin(V[:, 1]), np.unique(F)[np.argmax(V[np.unique(F), 1])]
    assert abs(result[bottom] - (1 - np.cos(np.pi / 4)) / 0.9) < 0.05
    assert result[rim] > result[bottom]
