"""Landmark files: what is written comes back, what is moved is moved, what is wrong is named."""

import json

import numpy as np
import pytest

from facewright.data import Landmarks, Scan
from facewright.errors import InputError
from facewright.scan import read_landmarks, write_landmarks
from facewright.scan.detector import LANDMARK_NAMES
from facewright.scan.landmark_files import NAMED, landmark_index, place_landmarks


@pytest.fixture
def landmarks_on_wall():
    T = np.diag([2.0, 2.0, 2.0, 1.0])
    T[:3, 3] = 1, 0, 0
    wall = Scan([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]], [[0, 1, 2], [0, 2, 3]], T_ours_to_scan=T)
    rng = np.random.default_rng(0)
    barycentric = rng.dirichlet(np.ones(3), 478)
    weights = np.where(np.arange(478) % 2, 0.5, 0.0)
    faces = rng.integers(0, 2, 478)
    for left, index in NAMED.items():  # of the wall's middle
        if left.endswith("_left"):
            faces[[index, NAMED[left[:-4] + "right"]]] = 0, 1
            barycentric[[index, NAMED[left[:-4] + "right"]]] = [0, 0.8, 0.2], [0.2, 0.2, 0.6]
    return wall, Landmarks(LANDMARK_NAMES, faces, barycentric, weights)


def test_round_trip(tmp_path, landmarks_on_wall):
    wall, landmarks = landmarks_on_wall
    write_landmarks(tmp_path / "a.json", landmarks, wall)
    table = read_landmarks(tmp_path / "a.json")
    assert len(table) == 239 and "mp1" in table and "mp0" not in table
    points = landmarks.positions(wall.vertices, wall.faces)
    assert np.allclose(table["mp1"], 2 * points[1] + [1, 0, 0], atol=1e-5)
    placed = place_landmarks(landmarks, table, wall)
    assert np.allclose(placed.positions(wall.vertices, wall.faces), points, atol=1e-5)
    assert placed.weights[1] == 1.0 and placed.weights[0] == 0.0


def test_some_names_only(tmp_path, landmarks_on_wall):
    wall, landmarks = landmarks_on_wall
    write_landmarks(
        tmp_path / "a.json", landmarks, wall, names={"mp61": "mouth_corner_right", "mp2": "a", "mp291": "mp291"}
    )
    assert sorted(read_landmarks(tmp_path / "a.json")) == ["mouth_corner_right", "mp291"]
    assert not list(tmp_path.glob("*.part"))


def test_moved_by_hand(tmp_path, landmarks_on_wall):
    wall, landmarks = landmarks_on_wall
    table = {"_comment": "moved", "mouth_corner_left": [5, 6, 3], "p31": {"face": 1, "barycentric": [0.5, 0.25, 0.25]}}
    (tmp_path / "a.json").write_text(json.dumps(table))
    placed = place_landmarks(landmarks, read_landmarks(tmp_path / "a.json"), wall)
    points = placed.positions(wall.vertices, wall.faces)
    assert np.allclose(points[291], [2, 3, 0])
    assert placed.faces[4] == 1 and placed.barycentric[4].tolist() == [0.5, 0.25, 0.25]
    others = np.delete(np.arange(478), [4, 291])
    assert np.array_equal(placed.barycentric[others], landmarks.barycentric[others])


def test_names():
    assert landmark_index("mp477") == 477 and landmark_index("p49") == 61 and landmark_index("chin") == 152
    for name in ("mp478", "p0", "p69", "mp", "nose", "mpx"):
        assert landmark_index(name) is None
    assert all(landmark_index(name) is not None for name in NAMED)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("{", "cannot be read as JSON"),
        ("[1, 2]", "no {name"),
        ('{"nose": [0, 0, 0]}', "unknown landmark 'nose'"),
        ('{"mp1": [0, 0]}', "landmark 'mp1' is"),
        ('{"mp1": [0, 0, NaN]}', "landmark 'mp1' is"),
        ('{"mp1": "here"}', "landmark 'mp1' is"),
        ('{"mp1": {"face": 3}}', "landmark 'mp1' is"),
        ('{"mp1": {"face": 3, "barycentric": [1, 1, 1]}}', "landmark 'mp1' is"),
    ],
)
def test_bad_files(tmp_path, text, word):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=word):
        read_landmarks(tmp_path / "a.json")
    with pytest.raises(InputError, match="does not exist"):
        read_landmarks(tmp_path / "b.json")


def test_slips_of_the_hand_are_named(landmarks_on_wall):
    """A point in other units, and left for right, as one who looks at the face would have it."""
    wall, landmarks = landmarks_on_wall
    with pytest.raises(InputError, match="'nose_tip' lies 45 mm from the scan"):
        place_landmarks(landmarks, {"nose_tip": np.array([5.0, 6.0, 90.0])}, wall)
    left, right = np.array([17.0, 6.0, 0.0]), np.array([3.0, 6.0, 0.0])
    place_landmarks(landmarks, {"mouth_corner_left": left, "mouth_corner_right": right}, wall)
    with pytest.raises(InputError, match="'mouth_corner_left' lies to the right of 'mouth_corner_right'"):
        place_landmarks(landmarks, {"mouth_corner_left": right, "mouth_corner_right": left}, wall)


def test_face_that_is_not_there(landmarks_on_wall):
    wall, landmarks = landmarks_on_wall
    with pytest.raises(InputError, match="face 7"):
        place_landmarks(landmarks, {"mp1": (7, np.array([1, 0, 0]))}, wall)
