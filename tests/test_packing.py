"""pack_x and unpack_x are inverse, also through a stage on disk."""

import dataclasses

import numpy as np
import pytest

from facewright import data
from facewright.cache import StageStore
from facewright.packing import pack_face, pack_landmarks, pack_scan, unpack_face, unpack_landmarks, unpack_scan


@pytest.fixture
def through_disk(tmp_path):
    store = StageStore(tmp_path)

    def go(arrays, info):
        store.save("01-x", "key", arrays, info, 0.0)
        stage = store.load("01-x", "key")
        return stage.arrays, stage.info

    return go


def assert_same(ours, theirs):
    for field in dataclasses.fields(ours):
        a, b = getattr(ours, field.name), getattr(theirs, field.name)
        if isinstance(a, np.ndarray):
            assert np.array_equal(a, b) and a.dtype == b.dtype, field.name
        elif isinstance(a, dict) and a and isinstance(next(iter(a.values())), np.ndarray):
            assert list(a) == list(b) and all(np.array_equal(a[key], b[key]) for key in a), field.name
        elif field.name == "textures":
            assert len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b))
        else:
            assert a is b or a == b, field.name


def full_scan():
    vertices = np.array([[0, 0, 1 / 3], [10, 0, 0], [0, 10, 0.1], [9, 9, -1]])
    return data.Scan(
        vertices,
        np.array([[0, 1, 2], [1, 3, 2]]),
        uv=np.array([[0, 0], [1, 0], [0, 1 / 7]]),
        uv_faces=np.array([[0, 1, 2], [1, 2, 0]]),
        textures=(np.full((2, 3, 3), 9, np.uint8), np.zeros((1, 1, 3), np.uint8)),
        face_texture=np.array([0, -1]),
        colors=np.full((4, 3), 0.3),
        normal_map=np.full((2, 2, 3), 128, np.uint8),
        T_ours_to_scan=np.diag([0.1, 0.1, 0.1, 1.0]),
        unit_mm=10.0,
        name="somebody",
        notes=("a note",),
    )


def test_scan(through_disk):
    scan = full_scan()
    assert_same(unpack_scan(*through_disk(*pack_scan(scan))), scan)


def test_scan_with_nothing_but_a_surface(through_disk):
    scan = data.Scan(full_scan().vertices, full_scan().faces)
    again = unpack_scan(*through_disk(*pack_scan(scan)))
    assert_same(again, scan)
    assert again.uv is None and again.textures == () and again.unit_mm is None


def test_landmarks(through_disk):
    marks = data.Landmarks(
        ("mp4", "mp61"), np.array([3, 1]), np.array([[1 / 3, 1 / 3, 1 / 3], [0, 0.5, 0.5]]), np.array([0.5, 0])
    )
    assert_same(unpack_landmarks(*through_disk(*pack_landmarks(marks))), marks)


def test_scan_and_landmarks_in_one_stage(through_disk):
    scan, marks = full_scan(), data.Landmarks(("mp1",), np.array([1]), np.array([[0, 0, 1.0]]), np.array([1.0]))
    (arrays, info), (more, names) = pack_scan(scan), pack_landmarks(marks)
    assert not set(arrays) & set(more) and not set(info) & set(names)
    stage = through_disk(arrays | more, info | names)
    assert_same(unpack_scan(*stage), scan)
    assert_same(unpack_landmarks(*stage), marks)


def test_face(through_disk, ball_face):
    face = dataclasses.replace(
        ball_face,
        fit=ball_face.vertices + 0.1,
        lines={"lip_seam_upper": np.array([3, 1, 2])},
        expression={"mouthSmileLeft": 1 / 3},
        eyes_closed={"left": True, "right": False},
        stats={"landmark_mm": {"mean": 0.7}, "identity_std": 0.5, "lips_closed": True},
    )
    again = unpack_face(*through_disk(*pack_face(face)), face.template)
    assert_same(again, face)
