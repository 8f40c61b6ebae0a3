"""Corners of the mouth whose small faces move alike."""

import numpy as np

from facewright.mesh.normals import face_areas
from facewright.template.corners import even_corners, relaxed_corners


def _sheet(n=21, step=0.5):
    """A flat sheet with a slit's end in the middle: vertices (n*n, 3), faces; the middle vertex."""
    x, y = np.meshgrid(np.arange(n) * step, np.arange(n) * step)
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n + 1], 1), np.stack([a, a + n + 1, a + n], 1)])
    return vertices, faces, n * (n // 2) + n // 2


def test_a_field_that_is_even_stays_and_so_does_all_beyond_the_radius():
    vertices, faces, corner = _sheet()
    rng = np.random.default_rng(0)
    affine = vertices @ rng.normal(size=(3, 3)) + rng.normal(size=3)
    noisy = affine + rng.normal(scale=0.2, size=affine.shape)
    even = even_corners(vertices, faces, [corner], np.stack([affine, noisy]), radius_mm=3.0, smooth_mm=1.5)
    assert np.allclose(even[0], affine, atol=1e-6)
    away = np.linalg.norm(vertices - vertices[corner], axis=1)
    assert np.array_equal(even[1][away >= 3.0], noisy[away >= 3.0])
    edges = faces[(away < 1.2)[faces].all(axis=1)][:, :2]
    unlike = [np.abs(np.diff((field - affine)[edges], axis=1)).mean() for field in (noisy, even[1])]
    assert unlike[1] < 0.3 * unlike[0]


def test_slivers_are_spread_and_the_seam_stays():
    vertices, faces, corner = _sheet()
    n = 21
    upper = np.arange(corner - 8, corner + 1)
    lower = np.concatenate([[upper[0]], upper[1:-1] - n, [corner]])
    pinched = vertices.copy()
    pinched[corner + n + 1] += [-0.3, -0.3, 0.0]  # beside the corner: faces of a few percent of their area
    relaxed = relaxed_corners(pinched, faces, (upper, lower), radius_mm=2.0)
    seam = np.concatenate([upper, lower])
    assert np.array_equal(relaxed[seam], pinched[seam])
    away = np.linalg.norm(pinched[:, None] - pinched[upper[[0, -1]]], axis=2).min(axis=1)
    assert np.array_equal(relaxed[away >= 2.0], pinched[away >= 2.0])
    assert face_areas(relaxed, faces).min() > 1.3 * face_areas(pinched, faces).min()
    assert np.allclose(relaxed[:, 2], 0.0)
