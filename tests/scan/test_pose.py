"""find_landmarks on the embedded sample: whatever is done to the file, the same head comes out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import facewright
from facewright.conventions import MM_PER_UNIT
from facewright.data import Scan
from facewright.errors import InputError
from facewright.read import read_scan
from facewright.scan import LandmarkOptions, clean_scan, find_landmarks
from facewright.scan.landmarks import STABLE
from facewright.scan.pose import choose_unit
from facewright.scan.sightings import transform

SAMPLE = Path(facewright.__file__).parent / "sample" / "head.obj"


@pytest.fixture(scope="module")
def sample():
    return clean_scan(read_scan(SAMPLE))[0]


@pytest.fixture(scope="module")
def found(sample):
    return find_landmarks(sample)


def moved(scan, seed, scale=1.0):
    """The scan as another program might have written it: turned, shifted, in another unit; and the (4, 4) of that."""
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    A = np.eye(4)
    A[:3, :3] = rotation * np.linalg.det(rotation) * scale
    A[:3, 3] = rng.normal(size=3) * 40 * scale
    return replace(scan.transformed(A), T_ours_to_scan=np.eye(4)), A


def frame_gap(found, other, A):
    """Greatest distance, mm, between where found and other (of the scan moved by A) put the points of the face."""
    face = found.scan.vertices[np.linalg.norm(found.scan.vertices - [0, -30, 20], axis=1) < 90]
    through = transform(other.T_scan_to_ours @ A @ np.linalg.inv(found.T_scan_to_ours), face)
    return np.linalg.norm(through - face, axis=1).max()


def landmark_gap(found, other, A):
    """(k,) distances of the landmarks of lips, eyes and nose, mm, in the frame of found."""
    back = found.T_scan_to_ours @ np.linalg.inv(other.T_scan_to_ours @ A)
    points = found.landmarks.positions(found.scan.vertices, found.scan.faces)
    others = transform(back, other.landmarks.positions(other.scan.vertices, other.scan.faces))
    return np.linalg.norm(points - others, axis=1)[list(STABLE)]


def test_frame_and_unit(sample, found):
    assert (found.unit_mm, found.unit_source, found.uv_flipped, found.warnings) == (10.0, "found", False, ())
    assert np.allclose(transform(found.T_scan_to_ours, sample.vertices)[:5], found.scan.vertices[:5])
    assert np.allclose(found.T_scan_to_ours @ found.scan.T_ours_to_scan, np.eye(4))
    points = found.landmarks.positions(found.scan.vertices, found.scan.faces)
    assert np.abs(points[[33, 263]].mean(axis=0)[:2]).max() < 6.0  # between the eyes
    assert points[4, 2] > 40 and points[152, 1] < -90 and points[263, 0] > 25


def test_against_the_truth(sample, found, hm08):
    truth = np.load(SAMPLE.parent / "truth.npz")["vertices"].astype(np.float64)
    names = {name: place for place, name in enumerate(hm08.landmarks.names)}
    order = [names[name] for name in found.landmarks.names]
    expected = transform(found.T_scan_to_ours, hm08.landmarks.positions(truth, hm08.faces)[order])
    error = np.linalg.norm(found.landmarks.positions(found.scan.vertices, found.scan.faces) - expected, axis=1)
    assert error[list(STABLE)].mean() < 2.0


def test_turned_shifted_and_in_metres(sample, found):
    other, A = moved(sample, 1, 0.01)
    again = find_landmarks(other)
    assert again.unit_mm == 1000.0 and again.unit_source == "found"
    assert frame_gap(found, again, A) < 0.6
    assert landmark_gap(found, again, A).mean() < 0.3


def test_clay_inside_out_and_upside_down_texture(sample, found):
    clay, A = moved(replace(sample, textures=(), face_texture=None), 2)
    again = find_landmarks(clean_scan(replace(clay, faces=clay.faces[:, ::-1], uv_faces=clay.uv_faces[:, ::-1]))[0])
    assert frame_gap(found, again, A) < 4.0 and landmark_gap(found, again, A).mean() < 2.0
    flipped = find_landmarks(replace(sample, uv=sample.uv * [1, -1] + [0, 1]))
    assert flipped.uv_flipped and "upside down" in flipped.warnings[0]
    assert np.allclose(flipped.scan.uv, sample.uv) and frame_gap(found, flipped, np.eye(4)) < 1e-9


def test_mirrored_only_when_asked(sample, found):
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    other = replace(sample.transformed(mirror), T_ours_to_scan=np.eye(4))
    other = replace(other, faces=other.faces[:, ::-1], uv_faces=other.uv_faces[:, ::-1])
    again = find_landmarks(other, LandmarkOptions(mirror=True))
    assert np.linalg.det(again.T_scan_to_ours) < 0
    assert frame_gap(found, again, mirror) < 1e-6


def test_landmarks_by_hand_win(sample, found):
    file_points = transform(np.linalg.inv(found.T_scan_to_ours), found.scan.vertices)
    wanted = file_points[np.linalg.norm(found.scan.vertices - [30, -75, 25], axis=1).argmin()]
    by_hand = find_landmarks(sample, LandmarkOptions(landmarks={"mouth_corner_left": wanted}))
    index = by_hand.landmarks.names.index("mp291")
    point = by_hand.landmarks.positions(by_hand.scan.vertices, by_hand.scan.faces)[index]
    assert np.allclose(transform(by_hand.scan.T_ours_to_scan, point[None])[0], wanted, atol=1e-6)
    assert by_hand.landmarks.weights[index] == 1.0


def test_a_strange_face_that_all_looks_agree_on(found):
    """Narrow and deep, 6.7 mm off the canonical face: eyes 46 mm apart."""
    stretched = found.scan.vertices * [0.75, 1.1, 1.35]
    strange = find_landmarks(replace(found.scan, vertices=stretched, T_ours_to_scan=np.eye(4)))
    assert strange.stats["residual_mm"] > 5.5 and not strange.warnings
    wanted, got = (x.landmarks.positions(stretched, found.scan.faces)[list(STABLE)] for x in (found, strange))
    assert np.linalg.norm(got - wanted, axis=1).mean() < 2.0


def test_what_is_no_face(ball_scan):
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1.0)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    for scan in (Scan(cube, faces, name="cube"), replace(ball_scan(None, k=20), name="ball")):
        with pytest.raises(InputError, match="no face was found") as error:
            find_landmarks(scan)
        assert "\n" not in str(error.value)


def test_a_face_by_hand_where_none_is_found(ball_scan):
    ball = ball_scan(None, k=20)
    marks = {"eye_outer_right": (-45, 0, 66), "eye_outer_left": (45, 0, 66), "eye_inner_right": (-18, 0, 78)}
    marks |= {"eye_inner_left": (18, 0, 78), "mouth_corner_right": (-25, -70, 30), "mouth_corner_left": (25, -70, 30)}
    marks = {name: np.array(point, float) for name, point in marks.items()}
    found = find_landmarks(ball, LandmarkOptions(landmarks=marks, units="mm"))
    assert (found.landmarks.weights > 0).sum() == 6 and "hard to find" in found.warnings[0]
    assert np.diag(found.T_scan_to_ours).min() > 0.7  # upright, however unlike a face a ball is
    assert found.stats["ipd_mm"] == pytest.approx(63.0, abs=1.0)  # only of what is known


def test_up_narrows_the_search(sample):
    clay = replace(sample, textures=(), face_texture=None)
    with pytest.raises(InputError, match="no face was found"):
        find_landmarks(clay, LandmarkOptions(up="-y"))


def test_wrong_options(sample):
    with pytest.raises(InputError, match="unknown up axis"):
        find_landmarks(sample, LandmarkOptions(up="north"))
    with pytest.raises(InputError, match="unknown unit"):
        find_landmarks(sample, LandmarkOptions(units="ell"))


def test_units():
    assert choose_unit(6.3) == (10.0, "found", [])
    assert choose_unit(0.063, 1000.0) == (1000.0, "format", [])
    assert choose_unit(2.5)[0] == 25.4
    unit, source, warnings = choose_unit(6.3, 1000.0)  # a glTF in centimetres
    assert (unit, source) == (10.0, "found") and "not believed" in warnings[0]
    unit, source, warnings = choose_unit(1.2)
    assert unit == pytest.approx(52.5) and source == "assumed" and "63 mm" in warnings[0]
    assert choose_unit(0.09, 10.0, "m") == (1000.0, "given", [])  # a large head, and the user says so


@pytest.mark.parametrize("unit", ["mm", "cm", "dm", "m", "inch"])
def test_a_given_unit_that_cannot_be_is_refused_and_the_one_that_fits_is_named(unit):
    for ipd in (45.0, 63.0, 75.0):
        for wrong in {"mm", "cm", "dm", "m", "inch"} - {unit}:
            with pytest.raises(InputError, match=rf"--units {wrong} would .*; --units {unit} would put them {ipd:.0f}"):
                choose_unit(ipd / MM_PER_UNIT[unit], given=wrong)
    with pytest.raises(InputError, match="leave it out"):
        choose_unit(1.2, given="mm")


@pytest.mark.parametrize("name", ["lee-perry-smith/head.obj", "menpo-james/james.obj"])
def test_real_scans(shared, name):
    scan = clean_scan(read_scan(shared / "data" / "scans" / name))[0]
    found = find_landmarks(scan)
    other, A = moved(scan, 3)
    again = find_landmarks(other)
    assert frame_gap(found, again, A) * 63 / found.stats["ipd_mm"] < 0.6
    assert landmark_gap(found, again, A).mean() < 0.35
