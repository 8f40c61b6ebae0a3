"""The Rig has what the face has: a mesh per part, targets where something moves, eyes that look like eyes."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.conventions import ARKIT_SHAPES
from facewright.expand import expand_weights
from facewright.parts import AssemblyOptions, build_rig, fit_parts
from facewright.parts.iris import EyeLook, eye_colors, paint_eye
from facewright.transfer.eyeball import measure_eyeball


@pytest.fixture(scope="module")
def person(hm08_person):
    return fit_parts(hm08_person(1))


@pytest.fixture(scope="module")
def rig(hm08, person):
    maps = {"albedo": np.full((8, 8, 3), 90, np.uint8), "coverage": np.zeros((8, 8), np.uint8)}
    return build_rig(person, hm08.deltas, maps)


def test_one_mesh_per_part_and_the_skin_first(hm08, rig, person):
    assert [mesh.name for mesh in rig.meshes] == [part.name for part in hm08.parts]
    for mesh, part in zip(rig.meshes, hm08.parts):
        assert np.array_equal(mesh.vertices, person.vertices[part.vertex_slice])
        assert np.array_equal(mesh.faces + part.vertices[0], hm08.faces[part.face_slice])
        assert np.array_equal(mesh.uv[mesh.uv_faces], hm08.uv[hm08.uv_faces[part.face_slice]])
        n_triangles = len(mesh.polygons) + (mesh.polygons[:, 3] >= 0).sum()
        assert n_triangles == len(mesh.faces) and mesh.polygons.max() < len(mesh.vertices)
        assert ((mesh.polygons < 0) == (mesh.uv_polygons < 0)).all()


def test_targets_are_all_or_none(rig):
    assert rig.plain().target_names == ARKIT_SHAPES
    by_name = {mesh.name: mesh for mesh in rig.meshes}
    assert by_name["teeth_upper"].deltas is None
    assert all(
        len(by_name[name].deltas) == 52 + 16 for name in ("skin", "eye_left", "cornea_left", "teeth_lower", "tongue")
    )


def test_the_full_rig_has_halves_in_place_of_their_sums(rig):
    full, skin = rig.full(), rig.meshes[0]
    assert len(full.target_names) == 60 and not set(full.halves) & set(full.target_names)
    at = ARKIT_SHAPES.index("mouthFunnel")
    assert full.target_names[at : at + 2] == ("mouthFunnelLeft", "mouthFunnelRight")
    for pose in ({"cheekPuff": 0.6, "jawOpen": 0.2}, *rig.expressions.values()):
        played = expand_weights(pose, full.in_betweens, full.correctives, full.halves)
        moved = sum(w * full.meshes[0].deltas[full.target_names.index(name)] for name, w in played.items())
        meant = sum(w * skin.deltas[rig.target_names.index(name)] for name, w in pose.items())
        assert np.abs(moved - meant).max() < 1e-9


def test_parts_hang_on_their_bones(rig):
    names = rig.skeleton.names
    by_name = {mesh.name: mesh for mesh in rig.meshes}
    for mesh, bone in (
        ("eye_left", "eye_left"),
        ("cornea_right", "eye_right"),
        ("teeth_upper", "head"),
        ("teeth_lower", "jaw"),
        ("tongue", "jaw"),
    ):
        assert (by_name[mesh].skin_weights[:, names.index(bone)] == 1).all(), mesh
    assert all(np.allclose(mesh.skin_weights.sum(axis=1), 1) for mesh in rig.meshes)


def test_only_the_skin_takes_the_skins_maps(rig):
    skin = rig.meshes[0].material
    assert skin.albedo == "albedo" and skin.normal is None and skin.color == (1.0, 1.0, 1.0)
    assert "coverage" not in rig.maps
    assert all(mesh.material.albedo != "albedo" for mesh in rig.meshes[1:])
    painted = {mesh.name for mesh in rig.meshes if mesh.material.albedo}
    assert {"eye_left", "teeth_upper", "tongue", "gums_lower", "lashes_right"} <= painted
    assert not {"cornea_left", "cornea_right"} & painted
    assert {name for mesh in rig.meshes for name in (mesh.material.albedo, mesh.material.normal) if name} <= set(
        rig.maps
    )


def test_an_eye_is_lit_as_its_cornea_bulges(hm08, person, rig):
    """Its normal map bends the flat iris's normals to the cornea's, and leaves the white and the back alone."""
    eye = next(mesh for mesh in rig.meshes if mesh.name == "eye_right")
    image = rig.maps[eye.material.normal]
    size = len(image)
    bend = (image.astype(float) - 128.0) / 127.0
    aside = bend[size // 2, int(0.68 * size)]  # on the iris, u 0.18 to the person's left of the pupil
    assert np.allclose(bend[size // 2, size // 2], [0, 0, 1], atol=0.05) and 0.3 < aside[0] < 0.8
    assert np.allclose(aside, np.linalg.norm(aside) * np.array([aside[0], 0, aside[2]]), atol=0.05)
    v, u = (np.indices((size, size)) + 0.5) / size - 0.5
    assert (image[np.hypot(u, v) > 0.29] == [128, 128, 255]).all()
    whole = replace(hm08, parts=tuple(part for part in hm08.parts if not part.name.startswith("cornea")))
    plain = build_rig(replace(person, template=whole), np.zeros((52, *person.vertices.shape)))
    assert next(mesh.material for mesh in plain.meshes if mesh.name == "eye_right").normal is None


def test_regions_and_lines_are_the_skins(rig, person):
    n = len(rig.meshes[0].vertices)
    assert all(mask.shape == (n,) for mask in rig.regions.values()) and rig.regions["face"].any()
    assert np.array_equal(rig.lines["lip_seam_upper"], person.lines["lip_seam_upper"])


def test_info_names_its_sources(hm08, rig):
    assert rig.info["topology_id"] == hm08.info["topology_id"] and rig.info["licence"] == "CC0-1.0"
    assert isinstance(rig.info["credits"], list) and rig.info["credits"]


def test_parts_can_be_left_out_and_eyes_plain(hm08, person):
    rig = build_rig(person, hm08.deltas, options=AssemblyOptions(eyes=None, left_out=("lashes",)))
    assert "lashes_left" in [mesh.name for mesh in rig.meshes]  # it rides on the lid and stays
    assert not any(name.startswith("eye") for name in rig.maps)
    hanging = tuple(replace(p, attach="skin") if p.name == "lashes_left" else p for p in hm08.parts)
    rig = build_rig(replace(person, template=replace(hm08, parts=hanging)), hm08.deltas)
    assert "lashes_left" not in [mesh.name for mesh in rig.meshes]


def test_an_eye_has_pupil_iris_and_white():
    look = EyeLook()
    angles = np.radians([0, look.pupil_deg - 3, 19, look.iris_deg + 4, 40])
    colors = eye_colors(np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1), look=look)
    light = colors.mean(axis=1)
    assert light[:2].max() < 0.01 < 0.05 < light[2] < 0.3 and light[3:].min() > 0.6


def test_an_iris_that_is_set_back_is_painted_as_large_as_on_a_ball(hm08):
    """Seen from in front: its vertices have the colours of the ball's surface before them."""
    part, ball = hm08.part("eye_left"), measure_eyeball(hm08, "left")
    faces, uv_faces = hm08.faces[part.face_slice] - part.vertices[0], hm08.uv_faces[part.face_slice]
    points = hm08.vertices[part.vertex_slice]
    flat, round_ = points.copy(), points.copy()
    across = np.linalg.norm((points - ball.center)[:, :2], axis=1)
    front = (across < 0.5 * ball.radius) & (points[:, 2] > ball.center[2])
    flat[front, 2] = ball.center[2] + 0.8 * ball.radius
    round_[front, 2] = ball.center[2] + np.sqrt(ball.radius**2 - across[front] ** 2)
    images = [paint_eye(V, faces, hm08.uv, uv_faces, ball, EyeLook(size=64)).astype(int) for V in (flat, round_)]
    assert np.abs(images[0] - images[1]).mean() < 0.5


def test_the_painted_eye_follows_its_axis_and_uvs(hm08):
    part = hm08.part("eye_left")
    image = paint_eye(
        hm08.vertices[part.vertex_slice],
        hm08.faces[part.face_slice] - part.vertices[0],
        hm08.uv,
        hm08.uv_faces[part.face_slice],
        measure_eyeball(hm08, "left"),
        EyeLook(size=64),
    )
    axis = np.linalg.norm((hm08.vertices[part.vertex_slice] - measure_eyeball(hm08, "left").center)[:, :2], axis=1)
    apex = np.argmin(axis) + part.vertices[0]
    u, v = hm08.uv[hm08.uv_faces[part.face_slice][hm08.faces[part.face_slice] == apex][0]]
    pupil = image[min(63, int((1 - v) * 64)), min(63, int(u * 64))]
    assert image.shape == (64, 64, 3) and pupil.max() < 30 and image.max() > 200
