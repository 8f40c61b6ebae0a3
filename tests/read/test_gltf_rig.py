"""A GLB of ours read back as a rig, and the names that others give their targets."""

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.read.gltf_rig import apple_name, read_gltf_rig
from facewright.write.gltf import write_gltf


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("eyeBlink_L", "eyeBlinkLeft"),
        ("EyeBlinkLeft", "eyeBlinkLeft"),
        ("blendShape1.mouthSmile_R", "mouthSmileRight"),
        ("jawOpen", "jawOpen"),
        ("browInnerUp_L", "browInnerUp_L"),
        ("eyeBlinkLeft@0.5", "eyeBlinkLeft@0.5"),
        ("anger", "anger"),
    ],
)
def test_names(name, wanted):
    assert apple_name(name) == wanted


def test_our_own_file_comes_back(small_rig, tmp_path):
    write_gltf(small_rig, tmp_path / "rig.glb")
    back = read_gltf_rig(tmp_path / "rig.glb")
    assert back.target_names == small_rig.target_names and back.meshes[0].name == "skin"
    skin, own = back.meshes[0], small_rig.meshes[0]
    used = np.unique(own.faces)
    assert len(skin.vertices) == len(used)  # what seams doubled is one vertex again
    order = [np.abs(skin.vertices - point).sum(axis=1).argmin() for point in own.vertices[used]]
    assert np.abs(skin.vertices[order] - own.vertices[used]).max() < 1e-4
    assert np.abs(skin.deltas[:, order] - own.deltas[:, used]).max() < 1e-4
    assert len(skin.faces) == len(own.faces) and back.meshes[1].deltas is None
    assert back.skeleton.names == small_rig.skeleton.names
    assert np.abs(back.skeleton.positions - small_rig.skeleton.positions).max() < 2e-3
    for table in ("in_betweens", "correctives", "halves", "expressions", "visemes"):
        assert getattr(back, table) == getattr(small_rig, table), table


def test_a_file_without_shapes_is_refused(small_rig, tmp_path):
    write_gltf(small_rig._with_targets([]), tmp_path / "bare.glb")
    with pytest.raises(InputError, match="targets"):
        read_gltf_rig(tmp_path / "bare.glb")
