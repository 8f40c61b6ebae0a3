"""Figures of a rig whose faults are known."""

from dataclasses import replace

import numpy as np
import pytest

from facewright import data
from facewright.evaluate import rig as measure
from facewright.evaluate.shapes import measure_shapes


@pytest.fixture
def flat_rig(small_rig):
    """A rig whose skin is a flat sheet of 9 x 9 points, with one sound shape and one that turns a face over."""
    n = 9
    x, y = np.meshgrid(np.arange(n) * 2.0, np.arange(n) * 2.0)
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    grid = np.arange(n * n).reshape(n, n)
    polygons = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4)
    faces = np.vstack([polygons[:, [0, 1, 2]], polygons[:, [0, 2, 3]]])
    deltas = np.zeros((3, n * n, 3))
    deltas[0, :, 1] = 3.0
    deltas[1, 40] = [5.0, 0.0, 0.0]
    uv = vertices[:, :2] / 20
    skin = replace(
        small_rig.meshes[0],
        vertices=vertices,
        faces=faces,
        polygons=polygons,
        uv=uv,
        uv_faces=faces,
        uv_polygons=polygons,
        skin_weights=np.ones((n * n, 5)) / 5,
        deltas=deltas,
    )
    everywhere, nowhere = np.ones(n * n, bool), np.zeros(n * n, bool)
    regions = {"face": everywhere, "lips": nowhere, "mouth_interior": nowhere, "nostrils": nowhere}
    lines = {"lip_seam_upper": np.array([0, 1]), "lip_seam_lower": np.array([0, 10])}
    return replace(small_rig, meshes=(skin, *small_rig.meshes[1:]), regions=regions, lines=lines)


def test_only_the_broken_shape_is_reported(flat_rig):
    shapes = measure_shapes(replace(flat_rig, in_betweens={}, correctives={}))
    names = flat_rig.target_names
    assert shapes[names[0]] == {"max_mm": 3.0, "folded": 0, "torn": 0, "self_intersections": 0}
    assert shapes[names[1]]["folded"] > 0
    assert shapes[names[2]]["max_mm"] == 0.0


def test_a_scan_at_half_a_millimetre(flat_rig):
    skin = flat_rig.meshes[0]
    figures = measure.measure_rig_distances(flat_rig, data.Scan(skin.vertices + [0, 0, 0.5], skin.faces))
    assert figures["face"]["scan_to_rig"]["mean"] == pytest.approx(0.5)
    assert figures["face"]["rig_to_scan"]["max"] == pytest.approx(0.5)


def test_the_neutral_by_itself(flat_rig):
    figures = measure.measure_neutral(flat_rig)
    assert figures["lip_gap_mm"] == pytest.approx(2.0)
    assert figures["vertices"] == sum(len(mesh.vertices) for mesh in flat_rig.meshes)


def test_the_frame_leads_from_the_file_to_the_rig(flat_rig):
    T = np.diag([100.0, 100.0, 100.0, 1.0])  # a file in centimetres
    T[:3, 3] = 1, 2, 3
    rig = replace(flat_rig, info=flat_rig.info | {"T_rig_to_scan": T.tolist()})
    point_mm = np.array([10.0, 20.0, 30.0])
    in_file = T[:3, :3] @ (point_mm / 1000) + T[:3, 3]
    back = measure.rig_frame(rig)
    assert np.allclose(back[:3, :3] @ in_file + back[:3, 3], point_mm)
