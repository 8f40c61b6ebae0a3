"""Distances on shapes whose answer is known."""

import numpy as np
import pytest

from facewright.evaluate import distances


def plane(n=21, size=20.0, z=0.0):
    """A square of n x n points in z, looking along +Z."""
    x, y = np.meshgrid(np.linspace(0, size, n), np.linspace(0, size, n))
    vertices = np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3)
    grid = np.arange(n * n).reshape(n, n)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    quads = np.stack([a, b, c, d], axis=2).reshape(-1, 4)
    return vertices, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def test_parallel_planes_are_their_gap_apart_both_ways():
    scan, (fit, faces) = plane(z=0.5), plane(n=9)
    everything = {"face": np.ones(len(fit), bool)}
    there = distances.scan_to_face(scan, fit, faces, everything)["face"]
    back = distances.face_to_scan(scan, fit, faces, everything)["face"]
    for figures in (there, back):
        assert figures["mean"] == pytest.approx(0.5)
        assert figures["p95"] == pytest.approx(0.5)
        assert figures["max"] == pytest.approx(0.5)
        assert figures["rms"] == pytest.approx(0.5)
    assert there["normal_deg_mean"] == pytest.approx(0.0, abs=1e-5)
    assert there["left_out"] == 0.0


def test_shoulders_are_no_face_but_a_fit_that_failed_is_far():
    (near, faces), (far, _) = plane(z=0.5), plane(z=25.0)
    fit, fit_faces = plane(n=9)
    everything = {"face": np.ones(len(fit), bool)}
    both = np.vstack([near, far]), np.vstack([faces, faces + len(near)])
    figures = distances.scan_to_face(both, fit, fit_faces, everything)["face"]
    assert figures["max"] == pytest.approx(0.5)
    assert figures["left_out"] == 0.0
    painted = distances.scan_to_face(both, fit, fit_faces, everything, painted=True)["face"]
    assert painted["left_out"] == pytest.approx(0.5), "what was painted as face is asked"
    alone = distances.scan_to_face((far, faces), fit, fit_faces, everything)["face"]
    assert alone["mean"] == pytest.approx(25.0)


def test_only_the_region_of_the_nearest_point_counts():
    scan, (fit, faces) = plane(z=0.5), plane()
    fit = fit.copy()
    fit[fit[:, 0] > 10.0, 2] = -3.0  # the other half is far away
    left = {"left": fit[:, 0] < 8.0}
    figures = distances.scan_to_face(scan, fit, faces, left)["left"]
    assert figures["max"] == pytest.approx(0.5)


def test_beyond_the_border_of_the_scan_is_left_out_and_counted():
    (scan, scan_faces), (fit, faces) = plane(size=10.0, n=11), plane(size=20.0, n=41, z=0.25)
    figures = distances.face_to_scan((scan, scan_faces), fit, faces, {"all": np.ones(len(fit), bool)})["all"]
    assert figures["left_out"] == pytest.approx(0.75, abs=0.01)
    assert figures["max"] == pytest.approx(0.25)


def test_painted_samples_outside_the_region_are_left_out_and_counted():
    scan, (fit, faces) = plane(z=0.5), plane()
    region = {"left": fit[:, 0] <= 10.0}
    painted = np.ones(len(scan[1]), bool)
    figures = distances.scan_to_face(scan, fit, faces, region, subset=painted, painted=True)["left"]
    assert figures["left_out"] == pytest.approx(0.475, abs=0.02)


def test_hidden_faces_are_left_out_and_counted():
    scan, (fit, faces) = plane(z=0.5), plane()
    hidden = scan[0][scan[1]].mean(axis=1)[:, 0] < 5.0
    figures = distances.scan_to_face(scan, fit, faces, {"all": np.ones(len(fit), bool)}, hidden=hidden)["all"]
    assert figures["left_out"] == pytest.approx(0.25, abs=0.01)


def test_no_samples_give_no_figures():
    figures = distances.summary(np.empty(0), 1.0)
    assert figures["mean"] is None
    assert figures["left_out"] == 1.0


def test_scale_brings_heads_to_63_mm():
    assert distances.benchmark_scale(31.5) == 2.0
    assert distances.benchmark_scale(None) == 1.0
