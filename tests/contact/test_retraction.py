"""Eyeballs draw back by what the lids on their chords need, and by no more."""

import numpy as np

from facewright.contact.retraction import MOST_MM, needed_retraction
from facewright.mesh.radial import RadialTable
from facewright.transfer.eyeball import Eyeball

BALL = Eyeball(np.zeros(3), 12.0, np.eye(3), RadialTable(np.full((61, 48), 12.0)))


def lid(height):
    """A patch of skin before the ball, from 10 to 40 degrees above its middle, height mm off it."""
    elevation, yaw = np.meshgrid(
        np.radians(np.linspace(10, 40, 16)), np.radians(np.linspace(-20, 20, 16)), indexing="ij"
    )
    unit = np.stack([np.cos(elevation) * np.sin(yaw), np.sin(elevation), np.cos(elevation) * np.cos(yaw)], axis=2)
    at = np.arange(256).reshape(16, 16)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    return (12.0 + height) * unit.reshape(-1, 3), faces


def lowered(vertices, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return vertices @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T - vertices


def test_lids_that_pass_clear_need_none():
    vertices, faces = lid(1.5)
    assert needed_retraction(vertices, faces, lowered(vertices, -30), BALL) == 0.0


def test_it_is_just_enough():
    vertices, faces = lid(0.2)
    blink = lowered(vertices, -35)
    back = needed_retraction(vertices, faces, blink, BALL)

    def nearest(mm):
        return min(BALL.gap(vertices + w * (blink + [0, 0, mm])).min() for w in (0.25, 0.5, 0.75))

    assert 0.0 < back < MOST_MM and nearest(back) > -0.05 and nearest(back - 0.3) < 0.0


def test_it_has_a_limit():
    vertices, faces = lid(0.2)
    assert needed_retraction(vertices, faces, lowered(vertices, -75), BALL) == MOST_MM
