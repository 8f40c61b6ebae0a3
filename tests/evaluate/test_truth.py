"""Errors against a truth that is moved by a known amount."""

import numpy as np
import pytest

from facewright.evaluate import truth


def test_vertex_errors_by_region():
    points = np.zeros((10, 3))
    fit = points + np.array([[0.0, 0, 1.0]]) * (np.arange(10) < 5)[:, None]
    regions = {"face": np.arange(10) < 8, "lips": np.arange(10) < 5, "nostrils": np.arange(10) == 0}
    errors = truth.vertex_errors(fit, points, regions)
    assert errors["lips"]["mean"] == 1.0
    assert errors["face"]["mean"] == pytest.approx(4 / 7)  # the nostril is no part of the face
    assert errors["face"]["count"] == 7
    assert truth.vertex_errors(fit, points, regions, scale=2.0)["lips"]["p95"] == 2.0


def test_sliding_is_told_from_depth():
    normals = np.tile([0.0, 0, 1], (6, 1))
    fit = np.zeros((6, 3)) + [3.0, 4.0, 0.5]
    sliding, depth = truth.along_and_across(fit, np.zeros((6, 3)), normals, np.ones(6, bool))
    assert sliding == pytest.approx(5.0)
    assert depth == pytest.approx(0.5)
