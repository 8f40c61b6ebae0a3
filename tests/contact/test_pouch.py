"""The lining of lids stays behind their skin, and moves no more than it must."""

import numpy as np
import pytest

from facewright.contact.pouch import BEHIND_MM, FROM_MM, LidLining

SIDE = 21
CENTER = np.array([3.0, -2.0, 1.0])


def patch(radius, start):
    """(n, 3) points before the ball and (m, 3) faces of a square patch, `radius` mm from its centre."""
    elevation, yaw = np.meshgrid(*[np.radians(np.linspace(-30, 30, SIDE))] * 2, indexing="ij")
    unit = np.stack([np.cos(elevation) * np.sin(yaw), np.sin(elevation), np.cos(elevation) * np.cos(yaw)], axis=2)
    at = np.arange(SIDE**2).reshape(SIDE, SIDE) + start
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    return CENTER + radius * unit.reshape(-1, 3), faces


@pytest.fixture()
def lid():
    """Skin 14 mm and lining 13 mm from the centre, as one mesh; LidLining of it, all far from the margins."""
    skin, skin_faces = patch(14.0, 0)
    lining, lining_faces = patch(13.0, len(skin))
    gives = np.arange(2 * len(skin)) >= len(skin)
    distance = np.full(2 * len(skin), 2 * FROM_MM)
    vertices = np.vstack([skin, lining])
    return vertices, gives, LidLining(vertices, skin_faces, lining_faces, distance, gives, CENTER)


def test_a_lining_that_lies_behind_stays(lid):
    vertices, _, lining = lid
    assert np.array_equal(lining.kept_behind(vertices), vertices)


@pytest.mark.parametrize("pressed", [0.9, 2.0, 4.0])
def test_it_gives_way_to_skin_that_is_pressed_in(lid, pressed):
    vertices, gives, lining = lid
    pose = vertices.copy()
    dent = np.exp(-(((vertices - CENTER)[:, :2] / 3.0) ** 2).sum(axis=1)) * ~gives
    pose -= (vertices - CENTER) / 14.0 * (pressed * dent)[:, None]
    found = lining.kept_behind(pose)
    radius = np.linalg.norm(found - CENTER, axis=1)
    assert np.array_equal(found[~gives], pose[~gives])
    assert (radius[~gives] - radius[gives]).min() > BEHIND_MM - 0.05
    assert radius[gives].max() < 13.0 + 1e-9


def test_at_the_margins_lining_and_skin_are_one(lid):
    vertices, gives, lining = lid
    at_margin = LidLining(vertices, lining._skin_faces, lining._lining_faces, np.zeros(len(vertices)), gives, CENTER)
    pose = vertices.copy()
    pose[gives] = CENTER + (vertices[gives] - CENTER) * (13.99 / 13.0)
    assert np.array_equal(at_margin.kept_behind(pose), pose)
    assert not np.array_equal(lining.kept_behind(pose), pose)
