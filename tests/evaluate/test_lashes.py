"""Lashes that ride on the lids are found to stay; lashes that do not are found out."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.evaluate.lashes import LASH_BAR_MM, _roots, measure_lashes
from facewright.parts import build_rig


@pytest.fixture(scope="module")
def rig(hm08, hm08_person):
    return build_rig(replace(hm08_person(1), vertices=hm08.vertices), hm08.deltas)


def test_the_templates_lashes_stay(rig):
    figures = measure_lashes(rig)
    assert figures["roots"] > 100 and figures["off_mm"] < 0.02 < LASH_BAR_MM


def test_lashes_left_behind_are_found_out(rig):
    still = tuple(
        replace(mesh, deltas=np.zeros_like(mesh.deltas)) if mesh.name.startswith("lashes") else mesh
        for mesh in rig.meshes
    )
    figures = measure_lashes(replace(rig, meshes=still))
    assert figures["off_mm"] > 5.0 and "eyeBlink" in figures["at"]


def test_a_rig_without_lashes_has_no_figure(rig):
    bald = tuple(mesh for mesh in rig.meshes if not mesh.name.startswith("lashes"))
    assert measure_lashes(replace(rig, meshes=bald)) is None


def test_roots_are_one_side_of_a_card_however_its_corner_hangs_into_the_skin():
    rows, columns = 4, 10
    y, x = np.mgrid[0.0:rows, 0.0:columns]
    card = np.stack([x, y, 0.1 * x**2 / columns + 0.2 * y**2], axis=-1).reshape(-1, 3)
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))])
    near = np.zeros(rows * columns, bool)
    near[at[0]] = True
    assert np.array_equal(_roots(card, faces, near), at[0])
    near[at[1, 0]] = True
    assert np.array_equal(_roots(card, faces, near), at[0])
    near[at[0, 4]] = False
    assert np.array_equal(_roots(card, faces, near), np.delete(at[0], 4))
    assert not len(_roots(card, faces, np.zeros(rows * columns, bool)))
