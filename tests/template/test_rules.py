"""Rules that make what a template lacks."""

import numpy as np
import pytest

from facewright.template import rules
from facewright.template.skeleton import hinge, neck_blend, rigid_fit, rotation_about_x


def test_turned_is_rigid_about_the_center_and_goes_the_right_way():
    rng = np.random.default_rng(2)
    points, center = rng.normal(size=(20, 3)) * 12, np.array([31.0, 0, 0])
    moved = points + center + rules.turned(points + center, center, 30, 0)
    assert np.allclose(np.linalg.norm(moved - center, axis=1), np.linalg.norm(points, axis=1))
    ahead = center + [[0, 0, 12.0]]
    left = rules.turned(ahead, center, 30, 0)[0]
    up = rules.turned(ahead, center, 0, 25)[0]
    assert left == pytest.approx([6, 0, 12 * np.cos(np.pi / 6) - 12])
    assert up[1] == pytest.approx(12 * np.sin(np.radians(25))) and up[0] == pytest.approx(0)


def test_left_eye_looks_out_to_the_left_and_in_to_the_right():
    degrees = {"out": 30, "inward": 28, "up": 25, "down": 30}
    left, right = rules.eye_turns("Left", degrees), rules.eye_turns("Right", degrees)
    assert left["eyeLookOutLeft"] == (30, 0) and left["eyeLookInLeft"] == (-28, 0)
    assert right["eyeLookOutRight"] == (-30, 0) and right["eyeLookInRight"] == (28, 0)
    assert left["eyeLookDownLeft"] == (0, -30) and left["eyeLookUpLeft"] == (0, 25)


def test_symmetric_shapes_mirror_each_other_and_keep_what_is_symmetric():
    mirror = np.array([1, 0, 2])
    names = ("mouthSmileLeft", "mouthSmileRight", "jawOpen")
    deltas = np.random.default_rng(3).normal(size=(3, 3, 3))
    even = rules.symmetric_shapes(names, deltas, mirror)
    assert np.array_equal(even[0][mirror] * [-1, 1, 1], even[1])
    assert np.array_equal(even[2][mirror] * [-1, 1, 1], even[2])
    assert np.allclose(rules.symmetric_shapes(names, even, mirror), even)


def test_even_eyes_keep_a_sphere_round_and_pass_a_scaled_one():
    rng = np.random.default_rng(4)
    points = rng.normal(size=(60, 3))
    points *= 12 / np.linalg.norm(points, axis=1, keepdims=True)
    pure = 0.1 * points + [1, 2, 3]
    modes = np.stack([pure, rng.normal(size=(60, 3))])
    even = rules.even_eyes(modes, points, np.zeros(3))
    assert np.allclose(even[0], pure)
    moved = points + even[1] - even[1].mean(axis=0)
    center = points.mean(axis=0)
    ratio = np.linalg.norm(moved - moved.mean(axis=0), axis=1) / np.linalg.norm(points - center, axis=1)
    assert np.ptp(ratio) < 1e-12


def test_hinge_finds_axis_and_angle():
    points = np.random.default_rng(5).normal(size=(30, 3)) * 20
    center, angle = np.array([0, -41.5, -60.8]), np.radians(25.3)
    found, turn = hinge(points, rotation_about_x(points, center, angle))
    assert np.allclose(found, center) and turn == pytest.approx(angle)


def test_rigid_fit_recovers_a_motion():
    points = np.random.default_rng(6).normal(size=(8, 3))
    R = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    R *= np.sign(np.linalg.det(R))
    found, t = rigid_fit(points, points @ R.T + [1, 2, 3])
    assert np.allclose(found, R) and np.allclose(t, [1, 2, 3])


def test_neck_blend_is_smooth_and_complete():
    y = np.linspace(-200, 0, 50)
    blend = neck_blend(np.stack([0 * y, y, 0 * y], axis=1), -150, -50)
    assert blend[0] == 0 and blend[-1] == 1 and (np.diff(blend) >= 0).all()
