"""The GLB writer: structure, determinism, seams, joints. What a reader gets: tests/evaluate/test_gltf.py."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.evaluate.gltf import read_glb
from facewright.write.gltf import gltf_bytes, split_at_seams, write_gltf


def test_same_rig_same_bytes(small_rig):
    assert gltf_bytes(small_rig) == gltf_bytes(small_rig)


def test_vertices_are_doubled_at_seams_only(small_rig):
    skin = small_rig.meshes[0]
    whole = split_at_seams(skin)
    pairs = np.unique(np.stack([skin.faces.ravel(), skin.uv_faces.ravel()], axis=1), axis=0)
    assert len(whole.origin) == len(pairs) and np.all(np.diff(whole.origin) >= 0)
    assert len(split_at_seams(small_rig.meshes[1]).origin) == 4
    for vertex in range(12):
        assert len(np.unique(whole.normals[whole.origin == vertex], axis=0)) <= 1


def test_tangents_split_mirrored_uvs_and_are_unit(small_rig):
    primitive = split_at_seams(small_rig.meshes[0], tangents=True)
    assert set(np.unique(primitive.tangents[:, 3])) == {-1.0, 1.0}
    assert np.allclose(np.linalg.norm(primitive.tangents[:, :3], axis=1), 1, atol=1e-6)
    assert np.abs((primitive.tangents[:, :3] * primitive.normals).sum(axis=1)).max() < 1e-6


def test_document_says_what_engines_ask_for(small_rig, tmp_path):
    write_gltf(small_rig, tmp_path / "a.glb")
    document = read_glb(tmp_path / "a.glb").document
    assert document["asset"]["copyright"] == "nobody" and document["asset"]["version"] == "2.0"
    skin = document["meshes"][0]
    assert skin["extras"]["targetNames"] == list(small_rig.target_names) and skin["weights"] == [0.0] * 3
    for target in skin["primitives"][0]["targets"]:
        accessor = document["accessors"][target["POSITION"]]
        assert "min" in accessor and "max" in accessor and "bufferView" in accessor and "sparse" not in accessor
        assert "bufferView" in document["accessors"][target["NORMAL"]]
    tables = document["scenes"][0]["extras"]["facewright"]
    assert tables["visemes"] == small_rig.visemes and tables["expressions"] == small_rig.expressions
    assert tables["inBetweens"] == {"jawOpen": {"0.5": "mouthClose"}}
    assert "extras" not in document["meshes"][1] and "targets" not in document["meshes"][1]["primitives"][0]
    assert all(material["pbrMetallicRoughness"]["metallicFactor"] == 0 for material in document["materials"])
    assert document["materials"][1]["alphaMode"] == "BLEND" and document["materials"][1]["doubleSided"]
    assert [node["name"] for node in document["nodes"][:5]] == list(small_rig.skeleton.names)


def test_more_than_65535_vertices_take_wide_indices(small_rig, tmp_path):
    n = 66000
    strip = np.stack([np.arange(n) / 100, np.arange(n) % 2, np.zeros(n)], axis=1)
    index = np.arange(n - 2)
    faces = np.stack([index, index + 1, index + 2], axis=1)
    polygons = np.column_stack([faces, np.full(len(faces), -1)])
    weights = np.tile([1.0, 0, 0, 0, 0], (n, 1))
    tooth = replace(
        small_rig.meshes[1],
        vertices=strip,
        faces=faces,
        polygons=polygons,
        uv=strip[:, :2],
        uv_faces=faces,
        uv_polygons=polygons,
        skin_weights=weights,
    )
    write_gltf(replace(small_rig, meshes=(tooth,)), tmp_path / "big.glb")
    assert np.array_equal(read_glb(tmp_path / "big.glb").meshes["tooth"].faces, faces)


def test_a_folder_that_cannot_be_written_is_an_input_error(small_rig, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot write"):
        write_gltf(small_rig, tmp_path / "file" / "rig.glb")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]
