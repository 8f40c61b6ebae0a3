"""OBJ files of a rig, read back by a few lines of their own."""

import numpy as np

from facewright.write.obj import write_obj


def parse(path):
    """Vertices, UVs and polygons (lists of vertex and UV indices) of an OBJ."""
    vertices, uvs, polygons = [], [], []
    for line in path.read_text().splitlines():
        word, *rest = line.split()
        if word == "v":
            vertices.append([float(value) for value in rest])
        elif word == "vt":
            uvs.append([float(value) for value in rest])
        elif word == "f":
            polygons.append([tuple(int(i) - 1 for i in corner.split("/")) for corner in rest])
    return np.array(vertices), np.array(uvs), polygons


def test_neutral_and_targets(small_rig, tmp_path):
    paths = write_obj(small_rig, tmp_path)
    assert [path.name for path in paths] == ["neutral.obj", "jawOpen.obj", "mouthClose.obj", "tongueOut.obj"]
    skin, tooth = small_rig.meshes
    vertices, uvs, polygons = parse(paths[0])
    assert np.abs(vertices - np.vstack([skin.vertices, tooth.vertices])).max() < 1e-5
    assert np.abs(uvs - np.vstack([skin.uv, tooth.uv])).max() < 1e-6
    assert sorted(map(len, polygons)) == [3, 4, 4, 4, 4, 4, 4]
    assert polygons[-1] == [(13 + i, 15 + i) for i in range(4)]
    moved, _, same = parse(paths[1])
    assert np.abs(moved[:13] - skin.vertices - skin.deltas[0]).max() < 1e-5 and same == polygons
    assert np.array_equal(moved[13:], vertices[13:])


def test_materials_name_files_that_exist(small_rig, tmp_path):
    write_obj(small_rig, tmp_path)
    text = (tmp_path / "rig.mtl").read_text()
    assert "newmtl skin" in text and "newmtl teeth" in text and "map_Kd albedo.png" in text
    assert (tmp_path / "albedo.png").is_file() and (tmp_path / "normal.png").is_file()
    assert "mtllib rig.mtl" in (tmp_path / "neutral.obj").read_text()
