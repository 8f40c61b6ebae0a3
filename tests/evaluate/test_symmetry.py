"""A symmetric head is symmetric in any pose; a moved vertex shows by half."""

import numpy as np
import pytest

from facewright.evaluate import symmetry


@pytest.fixture
def head():
    rng = np.random.default_rng(4)
    right = rng.normal(size=(40, 3)) * 30 - [50, 0, 0]
    vertices = np.vstack([right, right * [-1, 1, 1]])
    return vertices, np.roll(np.arange(80), 40)


def turn(axis_angle):
    angle = np.linalg.norm(axis_angle)
    K = np.cross(np.eye(3), np.asarray(axis_angle) / angle)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_symmetric_in_any_pose(head):
    vertices, mirror = head
    posed = vertices @ turn([0.3, -0.5, 1.0]).T + [10, -20, 5]
    assert symmetry.mirror_distances(posed, mirror, np.ones(80, bool)).max() < 1e-9


def test_asymmetry_is_half_of_the_mirror_distance(head):
    vertices, mirror = head
    moved = vertices.copy()
    moved[3] += [0, 0, 2.0]
    regions = {"face": np.arange(80) != 3, "lips": np.arange(80) == 3}
    regions["face"][mirror[3]] = False
    figures = symmetry.measure_symmetry(moved, mirror, regions)
    assert figures["lips"]["max"] == pytest.approx(1.0, abs=1e-6)
    assert figures["face"]["max"] < 1e-6
    assert "eyes" not in symmetry.measure_symmetry(moved, mirror, regions | {"eyes": np.zeros(80, bool)})
