"""ICT-FaceKit as a template: built once from a thinned copy of its official folder (six shapes, two identities)."""

import json

import numpy as np
import pytest

from facewright.conventions import ARKIT_SHAPES, mirrored_name
from facewright.errors import InputError
from facewright.mesh.intersect import self_intersections
from facewright.mesh.raster import raster_uv
from facewright.template.assemble import fit_sphere
from facewright.template.atlas import uv_measures
from facewright.template.build import build_template
from facewright.template.fetch import description_of
from facewright.template.skeleton import hinge, rotation_about_x

SHAPES = ("jawOpen", "jawForward", "eyeBlink_L", "eyeBlink_R", "mouthSmile_L", "mouthSmile_R")
KEPT = ("jawOpen", "jawForward", "eyeBlinkLeft", "eyeBlinkRight", "mouthSmileLeft", "mouthSmileRight")


def lay_out(shared, folder):
    """The official folder with only what the test needs, and a description that asks for no more."""
    data = np.load(shared / "data" / "templates" / "ict" / "ict_facekit.npz")
    corners = [
        "f " + " ".join(f"{v + 1}/{t + 1}" for v, t in zip(face, uv) if v >= 0)
        for face, uv in zip(data["faces"].tolist(), data["face_uvs"].tolist())
    ]
    tail = "\n".join([f"vt {u:.6f} {v:.6f}" for u, v in data["uvs"].tolist()] + corners)
    (folder / "FaceXModel").mkdir()
    neutral = data["vertices"].astype(float)
    files = {"generic_neutral_mesh": 0 * neutral}
    files |= {str(n): d for n, d in zip(data["expression_names"], data["expressions"]) if n in SHAPES}
    files |= {str(n): d for n, d in list(zip(data["identity_names"], data["identities"]))[:2]}
    for name, delta in files.items():
        lines = "\n".join(f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in (neutral + delta).tolist())
        (folder / "FaceXModel" / f"{name}.obj").write_text(f"{lines}\n{tail}\n")
    text = description_of("ict").read_text()
    made = json.dumps([name for name in ARKIT_SHAPES if name not in KEPT])
    (folder / "ict.toml").write_text(text.replace('made_by_rule = ["tongueOut"]', f"made_by_rule = {made}"))


@pytest.fixture(scope="module")
def folder(shared, tmp_path_factory):
    folder = tmp_path_factory.mktemp("ict")
    lay_out(shared, folder)
    return folder


@pytest.fixture(scope="module")
def template(folder):
    return build_template(folder, folder / "ict.toml")


def test_shapes_are_the_52_and_left_is_the_mirror_of_right(template):
    assert template.shape_names == ARKIT_SHAPES
    mirrored = template.deltas[:, template.mirror] * [-1, 1, 1]
    for name, delta in zip(ARKIT_SHAPES, mirrored):
        assert np.array_equal(template.shape(mirrored_name(name)), delta), name
    smile = template.shape("mouthSmileLeft")
    side = template.vertices[:, 0] > 0
    assert np.linalg.norm(smile[side], axis=1).max() > 2 * np.linalg.norm(smile[~side], axis=1).max()


def test_neutral_is_symmetric_and_in_our_frame(template):
    V, mirror = template.vertices, template.mirror
    assert np.array_equal(V[mirror] * [-1, 1, 1], V)
    assert np.array_equal(mirror[mirror], np.arange(len(V)))
    eyes = [fit_sphere(V[template.part(f"eye_{side}").vertex_slice])[0] for side in ("left", "right")]
    assert np.abs(eyes[0] + eyes[1]).max() < 1e-6
    assert 60 < eyes[0][0] - eyes[1][0] < 64
    assert V[:, 2].max() == V[template.regions["face"], 2].max()


def test_lips_meet_and_do_not_cross(template):
    skin = template.faces[template.skin.face_slice]
    assert len(self_intersections(template.vertices, skin)) == 0
    upper, lower = template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]
    gap = np.linalg.norm(template.vertices[upper] - template.vertices[lower], axis=1)
    assert len(upper) == len(lower) > 25 and gap.max() < 0.06
    assert upper[0] == lower[0] and upper[-1] == lower[-1]
    assert template.vertices[upper[0], 0] < -20 < 20 < template.vertices[upper[-1], 0]
    moved = template.identity_basis[:, upper] - template.identity_basis[:, lower]
    assert np.linalg.norm(moved, axis=2).max() < 0.02


def test_lid_margins_are_the_loop_of_42(template):
    upper, lower = template.lines["lid_upper_left"], template.lines["lid_lower_left"]
    assert len(set(upper) | set(lower)) == 42 and upper[0] == lower[0] and upper[-1] == lower[-1]
    V = template.vertices
    assert V[upper[0], 0] < V[upper[-1], 0]
    assert V[upper, 1].mean() > V[lower, 1].mean()
    assert np.array_equal(template.lines["lid_upper_right"], template.mirror[upper])
    center, radius = fit_sphere(V[template.part("eye_left").vertex_slice])
    assert abs(np.median(np.linalg.norm(V[upper] - center, axis=1)) - radius) < 1.0


def test_regions_make_sense(template):
    R = template.regions
    inner = ("mouth_interior", "nostrils", "socket_left", "socket_right")
    for name in inner:
        assert R[name].any() and not (R[name] & R["outer"]).any()
        assert template.openness[R[name]].mean() < 0.25, name
    for name in ("face", "lips", "eyes", "neck", "scalp", "ear_left", "lip_upper", "lip_lower", "skull"):
        assert R[name].any() and not (R[name] & ~R["outer"]).any(), name
    parts = [R[name] for name in ("face", "neck", "scalp", "ear_left", "ear_right")]
    assert np.array_equal(np.sum(parts, axis=0), R["outer"].astype(int))
    for name in ("face", "lips", "eyes", "nostrils", "mouth_interior", "neck", "scalp", "outer"):
        assert np.array_equal(R[name], R[name][template.mirror]), name
    assert np.array_equal(R["ear_left"][template.mirror], R["ear_right"])
    assert not R["face"][template.lines["neck_ring"]].any()
    assert np.abs(template.deltas[:, R["skull"]]).max() < 0.05
    assert not R["face"][R["skull"]].any()


def test_eyes_turn_about_their_centers(template):
    for side, sign in (("left", 1.0), ("right", -1.0)):
        part = template.part(f"eye_{side}")
        rest = template.vertices[part.vertex_slice]
        center, radius = fit_sphere(rest)
        moved = rest + template.shape(f"eyeLookOut{side.capitalize()}")[part.vertex_slice]
        assert np.allclose(np.linalg.norm(moved - center, axis=1), np.linalg.norm(rest - center, axis=1), atol=1e-3)
        pupil = np.argmax(rest[:, 2])
        assert sign * (moved - rest)[pupil, 0] > 0.35 * radius


def test_jaw_and_tongue(template):
    teeth = template.part("teeth_lower").vertex_slice
    rest, open_mouth = template.vertices, template.vertices + template.shape("jawOpen")
    pivot, angle = hinge(rest[teeth], open_mouth[teeth])
    error = rotation_about_x(rest[teeth], pivot, angle) - open_mouth[teeth]
    assert np.degrees(angle) == pytest.approx(25.3, abs=0.3) and np.linalg.norm(error, axis=1).max() < 0.3
    assert np.abs(template.shape("jawOpen")[template.part("teeth_upper").vertex_slice]).max() == 0
    assert np.allclose(template.skeleton.positions[2], pivot, atol=1e-6)
    tongue = template.part("tongue").vertex_slice
    out = (rest + template.shape("tongueOut"))[tongue]
    lips = rest[template.lines["lip_seam_upper"]][:, 2].max()
    assert out[:, 2].max() > lips + 10 and rest[tongue][:, 2].max() < lips


def test_atlas_has_no_overlap_and_shows_the_face_first(template):
    faces, uv_faces = template.faces[template.skin.face_slice], template.uv_faces[template.skin.face_slice]
    everything = np.ones(len(faces), bool)
    measures = uv_measures(template.vertices, faces, template.uv, uv_faces, everything)
    covered = (raster_uv(template.uv, uv_faces, 1024)[0] >= 0).mean()
    assert measures["flipped"] == 0 and covered == pytest.approx(measures["texel_share"], abs=2e-3)
    in_face = template.regions["face"][faces].all(axis=1)
    front = uv_measures(template.vertices, faces, template.uv, uv_faces, in_face)
    assert front["texel_share"] > 0.4 and front["px_per_mm"] > 12
    assert template.uv.min() >= -1e-12 and template.uv.max() <= 1 + 1e-12


def test_weights_and_parts(template):
    assert np.allclose(template.skin_weights.sum(axis=1), 1) and template.skin_weights.min() >= 0
    assert [part.name for part in template.parts[:6]] == [
        *("skin", "eye_left", "eye_right", "teeth_upper", "teeth_lower", "tongue")
    ]
    ends = [part.vertices[1] for part in template.parts]
    assert [part.vertices[0] for part in template.parts] == [0, *ends[:-1]] and ends[-1] == len(template.vertices)
    for part in template.parts:
        faces = template.faces[part.face_slice]
        assert faces.min() >= part.vertices[0] and faces.max() < part.vertices[1], part.name


def test_landmarks_are_found_on_the_face(template):
    marks = template.landmarks
    positions = dict(zip(marks.names, marks.positions(template.vertices, template.faces)))
    weights = dict(zip(marks.names, marks.weights))
    assert len(marks.names) == 546
    assert weights["p49"] > 0.3 and positions["p49"][0] < -18 < 18 < positions["p55"][0]
    seam = template.vertices[template.lines["lip_seam_upper"]]
    assert np.linalg.norm(positions["p49"] - seam[0]) < 6


def test_another_mesh_is_refused(folder, tmp_path):
    text = (folder / "ict.toml").read_text()
    (tmp_path / "d.toml").write_text(text.replace("polygons = 26384", "polygons = 5"))
    with pytest.raises(InputError, match="26384 polygons"):
        build_template(folder, tmp_path / "d.toml")
    (tmp_path / "d.toml").write_text(text.replace('name = "tongue"', 'name = "licker"'))
    with pytest.raises(InputError, match="'tongue'"):
        build_template(folder, tmp_path / "d.toml")
