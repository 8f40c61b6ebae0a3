"""report.json: the names that others read, finite numbers, and warnings where there is doubt."""

import json
import math

import numpy as np
import pytest

from facewright.conventions import ARKIT_SHAPES
from facewright.pipeline import STAGES
from facewright.write.report import plain, write_json


@pytest.fixture(scope="module")
def report(sample_job):
    return json.loads((sample_job.folder / "report.json").read_text(encoding="utf-8"))


def test_distances(report):
    registration = report["registration"]
    for block in (registration, registration["lips"], registration["nostrils"]):
        for way in ("scan_to_face_mm", "face_to_scan_mm"):
            figures = block[way]
            assert {"mean", "rms", "p95", "max", "left_out"} <= set(figures)
            assert 0 < figures["mean"] <= figures["rms"] <= figures["max"]
            assert figures["mean"] < figures["p95"] <= figures["max"]
            assert 0 <= figures["left_out"] < 0.2
    assert registration["scan_to_face_mm"]["mean"] < 0.2


def test_single_figures(report):
    registration = report["registration"]
    assert 0 <= registration["lip_seam_mm"] < 2
    assert 0 < registration["normal_deg_mean"] < 10
    assert 0 < registration["landmark_mm"]["mean"] < 4
    assert isinstance(registration["folded"], int)
    assert isinstance(registration["self_intersections"], int)


def test_times_memory_and_versions(report):
    assert list(report["timings_s"]) == list(STAGES)
    assert all(seconds >= 0 for seconds in report["timings_s"].values())
    assert 100 < report["peak_memory_mb"] < 64_000
    assert report["versions"]["numpy"] == np.__version__
    assert report["facewright"] and report["template"]["topology_id"].startswith("hm08-")
    assert report["targets"] == 52


def test_matrix_found_and_removed(report):
    T = np.array(report["T_rig_to_scan"])
    assert T.shape == (4, 4) and np.linalg.det(T[:3, :3]) > 0
    assert report["pose"]["unit_mm"] == 10.0  # the sample is in centimetres
    assert {"cleaning", "symmetry_mm", "expression_removed", "expression_found", "eyes_closed_on_scan"} <= set(report)
    assert isinstance(report["warnings"], list)
    assert report["neutral"]["face_outside_eyes_and_lips_mean_mm"] < 0.1


def test_plain_is_json_and_keeps_nine_digits(tmp_path):
    document = {
        "array": np.arange(3),
        "number": np.float32(0.5),
        "third": 1 / 3,
        "large": 123456.789012,
        "nothing": math.nan,
        "yes": np.bool_(True),
        2: (np.int64(7), math.inf),
    }
    expected = {
        "array": [0, 1, 2],
        "number": 0.5,
        "third": 0.333333333,
        "large": 123456.789,
        "nothing": None,
        "yes": True,
        "2": [7, None],
    }
    assert plain(document) == expected
    write_json(document, tmp_path / "report.json")
    assert json.loads((tmp_path / "report.json").read_text()) == expected


def test_every_shape_is_measured(report):
    assert set(report["shapes"]) == set(ARKIT_SHAPES)
    for figures in report["shapes"].values():
        assert set(figures) == {"max_mm", "folded", "torn", "self_intersections"}
    assert report["shapes"]["jawOpen"]["max_mm"] > 25 and report["shapes"]["jawOpen"]["folded"] == 0
