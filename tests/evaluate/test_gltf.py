"""What a reader of the GLB gets is what the rig holds."""

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.evaluate.gltf import read_glb
from facewright.mesh.normals import vertex_normals
from facewright.write.gltf import split_at_seams, write_gltf


@pytest.fixture
def glb(small_rig, tmp_path):
    write_gltf(small_rig, tmp_path / "rig.glb")
    return read_glb(tmp_path / "rig.glb")


def test_positions_deltas_and_names_come_back(glb, small_rig):
    skin, stored = small_rig.meshes[0], glb.meshes["skin"]
    origin = split_at_seams(skin, tangents=True).origin
    assert np.array_equal(stored.positions, (skin.vertices[origin] * 0.001).astype(np.float32))
    assert np.array_equal(stored.deltas, (skin.deltas[:, origin] * 0.001).astype(np.float32))
    assert stored.target_names == small_rig.target_names
    assert np.array_equal(origin[stored.faces], skin.faces)


def test_all_weights_zero_is_the_neutral_bit_for_bit(glb):
    for mesh in glb.meshes.values():
        assert np.array_equal(mesh.posed(np.zeros(len(mesh.deltas))).view(np.int32), mesh.positions.view(np.int32))
        assert not mesh.weights.any()
    assert np.array_equal(glb.rest_matrices, np.tile(np.eye(4), (5, 1, 1)))


def test_normals_follow_the_targets(glb, small_rig):
    skin, stored = small_rig.meshes[0], glb.meshes["skin"]
    origin = split_at_seams(skin, tangents=True).origin
    used = np.isin(np.arange(len(skin.vertices)), skin.faces)
    for delta, change in zip(skin.deltas, stored.normal_deltas):
        expected = vertex_normals(skin.vertices + delta, skin.faces)[origin]
        assert np.abs((stored.normals + change - expected)[used[origin]]).max() < 1e-6
    assert not stored.normal_deltas[1].any()


def test_texture_coordinates_and_images_share_the_top(glb, small_rig):
    skin, stored = small_rig.meshes[0], glb.meshes["skin"]
    assert np.allclose(stored.uv[stored.faces], skin.uv[skin.uv_faces] * [1, -1] + [0, 1], atol=1e-7)
    mime, content = glb.images["normal"]
    assert mime == "image/png" and content.startswith(b"\x89PNG")
    assert glb.images["albedo"][0] == "image/jpeg"


def test_a_mesh_that_never_moves_has_no_targets(glb):
    tooth = glb.meshes["tooth"]
    assert tooth.target_names == () and len(tooth.deltas) == 0 and len(tooth.weights) == 0


def test_joint_weights_sum_to_one(glb):
    for mesh in glb.meshes.values():
        assert np.abs(mesh.joint_weights.sum(axis=1) - 1).max() < 1e-6
        assert not mesh.joints[mesh.joint_weights == 0].any()


def test_broken_files_are_refused(tmp_path, small_rig):
    path = tmp_path / "rig.glb"
    path.write_bytes(b"solid")
    with pytest.raises(InputError, match="not a GLB"):
        read_glb(path)
    write_gltf(small_rig, path)
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(InputError, match="announced"):
        read_glb(path)
