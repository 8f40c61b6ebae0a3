"""Registration of heads whose truth is known: the template itself with another identity, lids open or shut."""

import numpy as np
import pytest

from facewright.data import Landmarks, Scan
from facewright.evaluate.quality import lip_gaps_mm, measure_quality
from facewright.mesh.closest import Surface
from facewright.register import register


def scan_of(template, vertices):
    """What a scanner sees of a head: outer skin and eyeballs as one cloth, and the template's landmarks on it."""
    outer = template.regions["outer"]
    keep = np.zeros(len(template.faces), bool)
    keep[template.skin.face_slice] = outer[template.faces[template.skin.face_slice]].all(axis=1)
    for name in ("eye_left", "eye_right"):
        keep[template.part(name).face_slice] = True
    used, faces = np.unique(template.faces[keep], return_inverse=True)
    faces = faces.reshape(-1, 3)
    scan = Scan(vertices=vertices[used], faces=faces)
    nearest = Surface(scan.vertices, scan.faces).closest(template.landmarks.positions(vertices, template.faces))
    marks = template.landmarks
    return scan, Landmarks(marks.names, nearest.faces, nearest.barycentric, marks.weights)


def person(template, scale=0.7):
    rng = np.random.default_rng(4)
    amounts = rng.normal(size=len(template.identity_basis)) * scale
    return template.vertices + np.tensordot(amounts, template.identity_basis, 1)


@pytest.fixture(scope="module")
def open_eyed(hm08):
    truth = person(hm08)
    scan, landmarks = scan_of(hm08, truth)
    return truth, scan, register(scan, landmarks, hm08)


def test_a_known_head_is_recovered(hm08, open_eyed):
    truth, _, face = open_eyed
    error = np.linalg.norm(face.fit - truth, axis=1)
    assert error[hm08.regions["face"]].mean() < 0.5
    assert error[hm08.regions["lips"]].mean() < 0.5
    assert not any(face.eyes_closed.values()) and not face.expression
    assert np.array_equal(face.fit, face.vertices)


def test_the_fit_is_sound(hm08, open_eyed):
    _, scan, face = open_eyed
    quality = measure_quality(scan, face.fit, hm08)
    assert quality["folded"] == 0
    assert quality["self_intersections"] == 0
    assert lip_gaps_mm(face.fit, face.lines).max() < 0.3


def test_the_back_of_a_bald_head_is_followed_however_far_it_lies_from_the_model(hm08):
    """Of a face nobody can tell how deep its head is: 20 mm more at the back."""
    truth = person(hm08, 0.4)
    back = truth[hm08.regions["skull"], 2].min()
    depth = np.clip((back + 60.0 - truth[:, 2]) / 60.0, 0.0, 1.0)
    truth = truth - 20.0 * (depth * depth * (3.0 - 2.0 * depth))[:, None] * [0.0, 0.0, 1.0]
    scan, landmarks = scan_of(hm08, truth)
    face = register(scan, landmarks, hm08)
    off = Surface(scan.vertices, scan.faces).closest(face.fit).distance
    assert face.stats["bald"]
    assert np.quantile(off[hm08.regions["skull"]], 0.95) < 0.3


def test_what_was_given_is_not_changed(hm08, open_eyed):
    truth, scan, _ = open_eyed
    assert np.array_equal(scan.vertices, scan_of(hm08, truth)[0].vertices)


def test_shut_lids_are_recognised_fitted_and_opened(hm08):
    blink = hm08.shape("eyeBlinkLeft") + hm08.shape("eyeBlinkRight")
    truth = person(hm08, 0.4)
    scan, landmarks = scan_of(hm08, truth + 0.9 * blink)
    face = register(scan, landmarks, hm08)
    assert face.eyes_closed == {"left": True, "right": True}
    assert set(face.expression) == {"eyeBlinkLeft", "eyeBlinkRight"}
    moved = np.linalg.norm(face.vertices - face.fit, axis=1)
    away = hm08.regions["face"] & ~hm08.regions["eyes"] & ~hm08.regions["lips"]
    assert moved[away].mean() < 0.1
    upper, lower = hm08.lines["lid_upper_left"], hm08.lines["lid_lower_left"]
    for vertices, least, most in ((face.fit, 0.0, 4.0), (face.vertices, 6.0, 13.0)):
        opening = vertices[upper][:, 1].max() - vertices[lower][:, 1].min()
        assert least <= opening <= most + 0.3 * np.ptp(vertices[lower][:, 1])


def test_a_landmark_placed_by_hand_is_obeyed(hm08, open_eyed):
    truth, scan, face = open_eyed
    _, landmarks = scan_of(hm08, truth)
    name = "mp61"  # the person's right corner of the mouth
    row = landmarks.names.index(name)
    start = landmarks.positions(scan.vertices, scan.faces)[row]
    moved = Surface(scan.vertices, scan.faces).closest(start[None] + [[-4.0, 0.0, 0.0]])
    faces, barycentric = landmarks.faces.copy(), landmarks.barycentric.copy()
    faces[row], barycentric[row] = moved.faces[0], moved.barycentric[0]
    corrected = register(scan, Landmarks(landmarks.names, faces, barycentric, landmarks.weights), hm08, placed=(name,))
    on_template = hm08.landmarks.positions
    before = on_template(face.fit, hm08.faces)[hm08.landmarks.names.index(name)]
    after = on_template(corrected.fit, hm08.faces)[hm08.landmarks.names.index(name)]
    assert np.linalg.norm(after - moved.points[0]) < 1.0 < np.linalg.norm(before - moved.points[0])
