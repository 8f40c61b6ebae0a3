"""Eyeballs are measured, placed and met by the lids."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.parts.eyes import (
    LidOptions,
    eye_radius,
    fit_lids,
    moved_to,
    place_eyeball,
)
from facewright.transfer.eyeball import angle_from, eye_parts, measure_eyeball


def inner_margin(V, lines, side):
    chains = [V[lines[f"lid_{lid}_{side}"]] for lid in ("upper", "lower")]
    return np.concatenate([chain[len(chain) // 4 : -len(chain) // 4] for chain in chains])


def test_measures_the_templates_own_eye(hm08):
    ball = measure_eyeball(hm08, "left")
    assert abs(ball.radius - 12.0) < 0.01 and np.allclose(ball.axis, [0, 0, 1], atol=1e-6)
    front = ball.center + [[0, 0, 1.0]]
    assert 12.8 < ball.surface_radius(front)[0] < 13.6  # the cornea
    assert ball.surface_radius(ball.center - [[0, 0, 1.0]])[0] == pytest.approx(ball.radius)


def test_the_axis_is_found_on_an_eye_that_looks_aside(hm08):
    part = np.concatenate([np.arange(*part.vertices) for part in eye_parts(hm08, "left")])
    angle = np.radians(8)
    R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    V = hm08.vertices.copy()
    center = measure_eyeball(hm08, "left").center
    V[part] = (V[part] - center) @ R.T + center
    assert np.allclose(measure_eyeball(replace(hm08, vertices=V), "left").axis, R[:, 2], atol=1e-3)


def test_gap_and_pushing_are_inverse(hm08):
    ball = measure_eyeball(hm08, "right")
    points = ball.center + np.random.default_rng(0).normal(size=(50, 3)) * 10
    wanted = np.linspace(0.1, 2, 50)
    assert np.allclose(ball.gap(ball.pushed_to(points, wanted)), wanted)


def test_a_wider_face_has_slightly_larger_eyes_within_limits(hm08):
    assert eye_radius(hm08, hm08.vertices, hm08.lines) == pytest.approx(12.0)
    assert eye_radius(hm08, 1.02 * hm08.vertices, hm08.lines) == pytest.approx(12.24)
    assert eye_radius(hm08, 2 * hm08.vertices, hm08.lines) == 12.4
    assert eye_radius(hm08, 0.5 * hm08.vertices, hm08.lines) == 11.6


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_ball_sits_behind_the_lids_and_the_lids_on_it(hm08, hm08_person, seed, side):
    face = hm08_person(seed)
    radius = eye_radius(hm08, face.vertices, face.lines)
    ball = place_eyeball(hm08, face.vertices, face.lines, side, radius)
    assert abs(np.median(ball.gap(inner_margin(face.vertices, face.lines, side))) - 0.15) < 0.1
    V, stats = fit_lids(hm08, face.vertices, face.regions, face.lines, side, ball)
    assert np.abs(ball.gap(inner_margin(V, face.lines, side)) - 0.22).max() < 0.01
    moved = np.linalg.norm(V - face.vertices, axis=1)
    may_move = face.regions["eyes"] | face.regions[f"socket_{side}"]
    assert not moved[~may_move].any() and moved.max() < 2.5 and stats["margin_moved_mm"] <= 1.6 + 1e-9
    outer = face.regions["eyes"] & ~face.regions[f"socket_{side}"] & (moved > 0)
    corners = [face.lines[f"lid_upper_{side}"][[0, 1, -2, -1]], face.lines[f"lid_lower_{side}"][[0, 1, -2, -1]]]
    outer[np.concatenate(corners)] = False
    assert ball.gap(V[outer]).min() > -0.05


@pytest.mark.parametrize("wider", [1.2, 1.4])
def test_a_ball_stays_behind_lids_that_are_wider_than_itself(hm08, wider):
    V = hm08.vertices.copy()
    eye = hm08.regions["eyes"] & (V[:, 0] > 0.0)
    middle = measure_eyeball(hm08, "left").center
    V[eye, :2] = middle[:2] + wider * (V[eye, :2] - middle[:2])
    ball = place_eyeball(hm08, V, hm08.lines, "left", 12.0)
    assert np.linalg.norm(ball.center - middle) < 6.0


def test_a_margin_is_never_moved_farther_than_allowed(hm08, hm08_person):
    face = hm08_person(1)
    ball = place_eyeball(hm08, face.vertices, face.lines, "left", 12.0)
    far = replace(ball, center=ball.center - [0, 0, 5.0])
    _, stats = fit_lids(hm08, face.vertices, face.regions, face.lines, "left", far, LidOptions(most_mm=0.5))
    assert stats["margin_moved_mm"] <= 0.5 + 1e-9


def test_parts_of_an_eye_keep_their_form(hm08):
    ball = replace(measure_eyeball(hm08, "left"), center=np.array([30.0, 1, 2]), radius=11.0)
    placed = moved_to(hm08, "left", ball)
    assert list(placed) == ["eye_left", "cornea_left"]
    assert np.median(np.linalg.norm(placed["eye_left"] - ball.center, axis=1)) == pytest.approx(11.0, abs=0.01)
    own = measure_eyeball(hm08, "left")
    for name, points in placed.items():
        rest = hm08.vertices[hm08.part(name).vertex_slice] - own.center
        assert np.allclose(points - ball.center, rest * 11.0 / own.radius)


def test_angles():
    axis = np.array([0.0, 0, 1])
    assert np.allclose(
        np.degrees(angle_from(axis, np.array([[0, 0, 2.0], [3, 0, 3], [0, -1, 0], [0, 0, -1]]))), [0, 45, 90, 180]
    )
