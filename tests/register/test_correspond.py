"""The scan prepared for matching: noise goes, form stays."""

import numpy as np

from facewright.mesh.normals import face_normals, vertex_normals
from facewright.mesh.subdivide import split_in_four, with_midpoints
from facewright.register.correspond import Target, roughness_deg


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


def test_facets_of_a_coarse_scan_go_and_its_form_stays():
    """A wave sampled every 11 mm: its corners lie on it, the middles of its facets off it, all with one slope each."""
    clean, _, faces, inside = bumpy_sheet(edge_mm=11.0, size=24)
    target = Target(clean, faces)
    smooth = target.smoothed(11.0)
    centers = clean[faces[inside[faces].all(axis=1)]].mean(axis=1)
    slope = 6.0 / 14.0 * np.cos(centers[:, 0] / 14.0)
    true = np.stack([-slope, 0 * slope, np.ones(len(slope))], 1) / np.sqrt(1 + slope**2)[:, None]

    def degrees(at):
        normals = face_normals(at.vertices, at.faces)[at.surface.closest(centers).faces]
        return np.degrees(np.arccos(np.clip((normals * true).sum(axis=1), -1, 1))).mean()

    assert degrees(smooth) < degrees(target)
    assert smooth.roughness.shape == smooth.openness.shape == smooth.border.shape == (len(smooth.vertices),)
    assert not smooth.border[np.linalg.norm(smooth.vertices - smooth.vertices.mean(axis=0), axis=1) < 60].any()


def test_a_finer_mesh_of_the_same_surface_is_smoothed_alike():
    _, noisy, faces, inside = bumpy_sheet(edge_mm=2.0, noise=0.3)
    edges, finer = split_in_four(faces, len(noisy))
    coarse = Target(noisy, faces).smoothed(2.0)
    fine = Target(with_midpoints(noisy, edges), finer).smoothed(1.0)
    moved = np.abs(coarse.vertices - noisy)[inside].mean()
    assert np.abs(fine.vertices[: len(noisy)] - coarse.vertices)[inside].mean() < 0.3 * moved


def test_roughness_is_of_the_surface_not_of_its_triangles():
    _, noisy, faces, inside = bumpy_sheet(edge_mm=3.0, noise=0.5)
    edges, finer = split_in_four(faces, len(noisy))
    coarse, fine = roughness_deg(noisy, faces), roughness_deg(with_midpoints(noisy, edges), finer)[: len(noisy)]
    assert np.abs(fine - coarse)[inside].mean() < 0.1 * coarse[inside].mean()
