"""Eyeballs of known radius and turn; lids that show the ball; bends of a line."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.contact import solve_eyes
from facewright.evaluate.eye_views import EyeView
from facewright.evaluate.eyes import bends_deg, eye_rows, measure_eyes
from facewright.parts import build_rig


def test_bends():
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0.0]])
    assert np.allclose(bends_deg(line), [0.0, 90.0])


@pytest.fixture
def view():
    """A ball of 10 mm behind a sheet of lid skin 12 mm in front of its centre, with a slit of 4 x 8 mm."""
    grid = np.arange(-30.0, 31.0, 2.0)
    x, y = np.meshgrid(grid, grid)
    sheet = np.stack([x, y, np.full_like(x, 12.0)], axis=-1).reshape(-1, 3)
    n = len(grid)
    index = np.arange(n * n).reshape(n, n)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=2).reshape(-1, 4)
    middle = sheet[quads].mean(axis=1)
    quads = quads[(np.abs(middle[:, 0]) > 2.0) | (np.abs(middle[:, 1]) > 3.0)]
    faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    u, v = np.meshgrid(np.linspace(0, np.pi, 40), np.linspace(0, 2 * np.pi, 60))
    ball = 10.0 * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3)
    at = np.arange(2400).reshape(60, 40)
    cells = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=2).reshape(-1, 4)
    ball_faces = np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    return sheet, ball, EyeView(sheet, faces, [(ball, ball_faces)], np.zeros(len(sheet), bool), np.zeros(3))


def test_the_slit_shows_as_much_as_it_is_large(view):
    sheet, ball, eye = view
    assert eye.visible_mm2(sheet, [ball], views=((0.0, 0.0),)) == pytest.approx(32.0, abs=1.0)
    assert eye.through_lids_mm2(sheet, [ball]) == 0.0


def test_a_ball_that_stands_before_the_lid_is_seen_through_it(view):
    sheet, ball, eye = view
    sunk = sheet - [0.0, 0.0, 4.0]  # the ball stands out of the skin by 2 mm: a disc of 6 mm, less the slit
    seen = eye.through_lids_mm2(sunk, [ball], views=((0.0, 0.0),))
    assert seen == pytest.approx(np.pi * (100 - 64) - 32.0, rel=0.06)


def test_the_eyes_of_a_rig(hm08, hm08_person):
    face = replace(hm08_person(0), vertices=hm08.vertices)
    eyes = solve_eyes(face, hm08.deltas)
    rig = build_rig(face, eyes.deltas, eyes=eyes)
    found = measure_eyes(rig)
    assert found["radius_mm"] == pytest.approx(12.0, abs=0.5)
    assert found["turn_deg"] == pytest.approx({"eyeLookIn": 30, "eyeLookOut": 30, "eyeLookDown": 30, "eyeLookUp": 25})
    assert found["swell"][0] < 0.01 < found["swell"][1] < 0.04  # a chord of 30 degrees is 3.4 % nearer to the centre
    assert found["visible_mm2"][0] < 0.1 and found["poses"]["eyeBlink 1"]["margins_mm"][0] < 0.4
    open_eyed = replace(rig, meshes=(replace(rig.meshes[0], deltas=0 * rig.meshes[0].deltas), *rig.meshes[1:]))
    assert measure_eyes(open_eyed)["visible_mm2"][0] > 100.0
    bare = replace(rig, regions={}, lines={})
    assert {row.figure for row in eye_rows(bare)} == {"radius mm", "ball turns deg", "radius changes by"}
