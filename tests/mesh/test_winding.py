"""Winding numbers without a tree are the exact ones to within what the far field may err by."""

import igl
import numpy as np
import pytest

from facewright.mesh.normals import vertex_normals
from facewright.mesh.winding import winding_numbers


@pytest.fixture(scope="module")
def ball():
    V, F = igl.icosahedron()
    for _ in range(4):
        V, F = igl.upsample(V, F)
        V = V / np.linalg.norm(V, axis=1, keepdims=True)
    return 10.0 * V, F


def test_one_inside_and_none_outside(ball):
    V, F = ball
    near = 0.01 * vertex_normals(V, F)[::5]
    assert np.allclose(winding_numbers(V, F, V[::5] - near), 1.0, atol=5e-3)
    assert np.allclose(winding_numbers(V, F, V[::5] + near), 0.0, atol=5e-3)
    assert np.isclose(winding_numbers(V, F, np.zeros((1, 3))), 1.0, atol=1e-3)


def test_an_open_patch_of_a_head_as_summed_face_by_face(hm08):
    V, F = hm08.vertices, hm08.faces[hm08.skin.face_slice]
    F = F[hm08.regions["lips"][F].any(axis=1)]
    points = V[np.unique(F)][::3] + 0.02
    exact = np.asarray(igl.winding_number(np.ascontiguousarray(V), np.ascontiguousarray(F), points)).reshape(-1)
    assert np.abs(winding_numbers(V, F, points) - exact).max() < 5e-3


def test_points_share_no_answer(ball):
    V, F = ball
    points = np.random.default_rng(0).uniform(-12.0, 12.0, (300, 3))
    together = winding_numbers(V, F, points)
    alone = np.concatenate([winding_numbers(V, F, point[None]) for point in points[::30]])
    assert np.allclose(together[::30], alone, atol=1e-6)
    assert not len(winding_numbers(V, F, points[:0]))
