"""Landmarks on the shipped template, whose own landmarks are known."""

import numpy as np
import pytest

from facewright.data import Landmarks
from facewright.scan import lift_landmarks
from facewright.scan.detector import LANDMARK_NAMES, N_LANDMARKS, mirrored_landmarks
from facewright.scan.landmarks import IBUG68, STABLE, fuse_sightings, geometric_median
from facewright.scan.sightings import Sightings, Subject

FEW = ((-20.0, 0.0), (0.0, 0.0), (20.0, 0.0))


@pytest.fixture(scope="module")
def lifted(hm08):
    return lift_landmarks(hm08.vertices, hm08.faces, views=FEW)


def test_face_of_the_template(hm08, lifted):
    assert lifted.names == LANDMARK_NAMES and lifted.weights[list(STABLE)].min() > 0.3
    points = lifted.positions(hm08.vertices, hm08.faces)
    mouth, eye_left = points[list(IBUG68[48:60])].mean(axis=0), points[list(IBUG68[42:48])].mean(axis=0)
    ball = hm08.vertices[hm08.part("eye_left").vertex_slice].mean(axis=0)
    assert np.abs(eye_left - ball)[:2].max() < 4.0
    lips = hm08.vertices[hm08.lines["lip_seam_upper"]].mean(axis=0)
    assert np.linalg.norm((mouth - lips)[:2]) < 3.0


def test_mirrored_head_gives_mirrored_landmarks(hm08, hm08_person):
    vertices = hm08_person(5).vertices
    views = ((-15.0, 0.0), (15.0, 0.0))
    straight = lift_landmarks(vertices, hm08.faces, views=views)
    mirrored = lift_landmarks(vertices * [-1, 1, 1], hm08.faces[:, ::-1], views=views)
    a = straight.positions(vertices, hm08.faces)[mirrored_landmarks()] * [-1, 1, 1]
    b = mirrored.positions(vertices * [-1, 1, 1], hm08.faces[:, ::-1])
    gap = np.linalg.norm(a - b, axis=1)[list(STABLE)]
    # Mirror images are the same pictures but for the lights, which stand to one side.
    assert gap.mean() < 1.5


def test_same_bytes_again(hm08, lifted):
    again = lift_landmarks(hm08.vertices, hm08.faces, views=FEW)
    assert np.array_equal(again.faces, lifted.faces) and np.array_equal(again.barycentric, lifted.barycentric)


def test_a_wall_has_no_landmarks():
    wall = np.array([[-200, -200, 0], [200, -200, 0], [200, 200, 0], [-200, 200, 0.0]])
    lifted = lift_landmarks(wall, np.array([[0, 1, 2], [0, 2, 3]]), views=FEW)
    assert isinstance(lifted, Landmarks) and not lifted.weights.any()


def test_median_is_not_moved_by_outliers():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(9, 4, 3)) * 0.1 + [1, 2, 3]
    points[:3] += 500
    assert np.abs(geometric_median(points, np.ones((9, 4))) - [1, 2, 3]).max() < 0.3


def test_fusing_takes_what_agrees_and_stays_on_the_surface():
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0)), -1).reshape(-1, 2) * 10 - 40
    vertices = np.column_stack([grid, np.zeros(81)])
    corner = np.array([i + 9 * j for j in range(8) for i in range(8)])
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 10], 1), np.stack([corner, corner + 10, corner + 9], 1)]
    )
    points = np.zeros((5, N_LANDMARKS, 3))
    points[:, 0] = [[3, 4, 0.5], [3.2, 4, -0.5], [2.8, 4, 0], [30, 30, 0], [-30, 0, 0]]
    facing = np.ones((5, N_LANDMARKS))
    facing[:, 1] = 0.0
    subject = Subject.of(vertices, faces)
    fused = fuse_sightings(subject, np.eye(4), Sightings(points, facing, np.arange(len(faces)), 0))
    assert np.allclose(fused.positions(vertices, faces)[0], [3, 4, 0], atol=1e-6)
    assert 0.5 < fused.weights[0] < 0.65 and fused.weights[1] == 0.0
