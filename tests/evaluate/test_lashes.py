"""Lashes that ride on the lids are found to stay; lashes that do not are found out."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.evaluate.lashes import LASH_BAR_MM, measure_lashes
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
