"""The scan prepared for matching: noise goes, form stays."""

import numpy as np

from facewright.mesh.normals import vertex_normals
from facewright.register.correspond import Target


def bumpy_sheet(edge_mm=1.2, size=60, noise=0.15):
    x, y = np.meshgrid(np.arange(size) * edge_mm, np.arange(size) * edge_mm, indexing="ij")
    z = 6.0 * np.sin(x / 14.0)
    clean = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    corner = (np.arange(size - 1)[:, None] * size + np.arange(size - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + size, corner + 1], 1), np.stack([corner + 1, corner + size, corner + size + 1], 1)]
    )
    noisy = clean + np.random.default_rng(0).normal(0, noise, len(clean))[:, None] * [0, 0, 1]
    inside = np.zeros((size, size), bool)
    inside[6:-6, 6:-6] = True
    return clean, noisy, faces, inside.ravel()


def test_noise_of_the_normals_goes_and_the_form_stays():
    clean, noisy, faces, inside = bumpy_sheet()
    target = Target(noisy, faces)
    smooth = target.smoothed(1.2)
    true = vertex_normals(clean, faces)

    def degrees(normals):
        return np.degrees(np.arccos(np.clip((normals * true).sum(axis=1), -1, 1)))[inside].mean()

    assert degrees(smooth.normals) < 0.4 * degrees(target.normals)
    assert np.abs(smooth.vertices - clean)[inside].mean() < np.abs(noisy - clean)[inside].mean()


def test_a_coarse_scan_is_left_as_it_is():
    _, noisy, faces, _ = bumpy_sheet(edge_mm=11.0)
    np.testing.assert_array_equal(Target(noisy, faces).smoothed(11.0).vertices, noisy)
