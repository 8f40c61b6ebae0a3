"""What a scan file names beside itself."""

import json

import pytest

from facewright.read.named import named_files

MATERIALS = r"""newmtl skin
map_Kd -clamp on maps/my skin.png
newmtl eye
map_Kd C:\scans\eye.png
norm bumps.png
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "maps").mkdir()
    for name in ("maps/my skin.png", "eye.png", "bumps.png", "unrelated.png", "data one.bin"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "head.mtl").write_text(MATERIALS)
    return tmp_path


def names(path):
    return [file.relative_to(path.parent.resolve()).as_posix() for file in named_files(path)]


def test_obj_names_libraries_and_they_name_images(folder):
    (folder / "head.obj").write_bytes(b"# scan\r\nmtllib head.mtl\r\nmtllib missing.mtl\r\nv 0 0 0\r\n")
    assert names(folder / "head.obj") == ["head.mtl", "maps/my skin.png", "eye.png", "bumps.png"]


def test_gltf_names_buffers_and_images(folder):
    document = {
        "buffers": [{"uri": "data%20one.bin"}, {"uri": "data:application/octet-stream;base64,AAAA"}],
        "images": [{"uri": "eye.png"}, {"bufferView": 0}, {"uri": "../outside.png"}],
    }
    (folder / "head.gltf").write_text(json.dumps(document))
    assert names(folder / "head.gltf") == ["data one.bin", "eye.png"]


@pytest.mark.parametrize("name, content", [("a.gltf", b"{"), ("a.gltf", b"[]"), ("a.obj", b""), ("a.ply", b"mtllib x")])
def test_files_that_name_nothing(folder, name, content):
    (folder / name).write_bytes(content)
    assert named_files(folder / name) == []
