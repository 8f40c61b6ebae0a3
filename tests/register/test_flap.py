"""What stands out as an ear does is told on any head, whatever lies around it."""

import numpy as np
import pytest

from facewright.register.flap import standing_out

CENTER = np.array([70.0, 0.0, 0.0])


@pytest.fixture
def ball(ball_scan):
    scan = ball_scan(None, radius=75.0)
    return scan.vertices, scan.faces


def raised(vertices, center, size, by):
    """Vertices of which those in an ellipse of half axes size (2,) about center (2,) in y, z stand out so far."""
    away = np.linalg.norm((vertices[:, 1:] - center) / size, axis=1)
    share = np.clip(4.0 * (1.0 - away), 0.0, 1.0) * (vertices[:, 0] > 0.0)
    return vertices + share[:, None] * [by, 0.0, 0.0]


def found(vertices, faces, reach=50.0):
    near = np.flatnonzero(np.linalg.norm(vertices - CENTER, axis=1) < reach)
    heights = np.zeros(len(vertices))
    heights[near] = standing_out(vertices, faces, near, CENTER, 4.0)
    return heights


def test_an_ear_stands_out_and_a_bare_head_does_not(ball):
    V, F = ball
    assert not found(V, F).any()
    heights = found(raised(V, (5.0, -8.0), (30.0, 15.0), 12.0), F)
    inside = np.linalg.norm((V[:, 1:] - [5.0, -8.0]) / [20.0, 9.0], axis=1) < 1.0
    assert (heights[inside & (V[:, 0] > 0.0)] > 7.0).all()
    assert not heights[(np.linalg.norm(V[:, 1:] - [5.0, -8.0], axis=1) > 40.0)].any()


def test_an_ear_is_found_on_hair_that_lies_farther_out_than_the_skin(ball):
    V, F = ball
    ear = raised(V, (0.0, 0.0), (30.0, 15.0), 12.0)
    hair = raised(V, (20.0, -20.0), (80.0, 70.0), 15.0)
    both = ear + hair - V
    heights, alone = found(both, F), found(ear, F)
    assert (alone > 6.0).any()
    overlap = ((heights > 4.0) & (alone > 4.0)).sum() / (alone > 4.0).sum()
    assert overlap > 0.8
    assert not found(hair, F).any()


def test_of_two_pieces_the_nearer_counts(ball):
    V, F = ball
    both = raised(raised(V, (0.0, 0.0), (25.0, 13.0), 10.0), (48.0, 0.0), (14.0, 16.0), 14.0)
    heights = found(both, F)
    assert (heights > 4.0).any()
    assert (V[heights > 4.0, 1] < 30.0).all()
