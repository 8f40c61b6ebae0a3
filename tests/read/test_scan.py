"""read_scan: what holds for every format."""

import numpy as np
import pytest
from PIL import Image

from facewright.errors import InputError
from facewright.read import read_scan
from facewright.read.scan import unit_in_mm

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"


@pytest.fixture
def textured(tmp_path):
    """An OBJ whose texture is missing, and another image to put on it."""
    (tmp_path / "head.obj").write_text("mtllib head.mtl\nusemtl skin\n" + TRIANGLE)
    (tmp_path / "head.mtl").write_text("newmtl skin\nmap_Kd skin.png\nnorm bumps.png\n")
    Image.new("RGB", (2, 2), (5, 6, 7)).save(tmp_path / "other.png")
    Image.new("RGB", (2, 2), (128, 128, 255)).save(tmp_path / "bumps.png")
    return tmp_path


def test_albedo_of_the_user_wins(textured):
    with pytest.raises(InputError, match=r"skin\.png"):
        read_scan(textured / "head.obj")
    scan = read_scan(textured / "head.obj", albedo=textured / "other.png")
    assert scan.textures[0][0, 0].tolist() == [5, 6, 7]
    assert scan.normal_map[0, 0].tolist() == [128, 128, 255]
    scan = read_scan(textured / "head.obj", albedo=textured / "other.png", normal_map=textured / "other.png")
    assert scan.normal_map[0, 0].tolist() == [5, 6, 7]


def test_texture_that_is_no_image(textured):
    (textured / "skin.png").write_bytes(b"\x89PNG and then nothing")
    with pytest.raises(InputError, match="cannot be decoded"):
        read_scan(textured / "head.obj")
    with pytest.raises(InputError, match="does not exist"):
        read_scan(textured / "head.obj", albedo=textured / "gone.png")


@pytest.mark.parametrize("name", ["../out.png", "C:\\maps\\out.png", "maps/../../out.png"])
def test_textures_of_other_folders(textured, name):
    inside = textured / "inside"
    inside.mkdir()
    Image.new("RGB", (2, 2)).save(textured / "out.png")
    (inside / "head.obj").write_text("mtllib head.mtl\nusemtl skin\n" + TRIANGLE)
    (inside / "head.mtl").write_text(f"newmtl skin\nmap_Kd {name}\n")
    with pytest.raises(InputError, match=r"out\.png"):
        read_scan(inside / "head.obj")
    Image.new("RGB", (2, 2), (3, 3, 3)).save(inside / "out.png")  # the same name beside the scan is what was meant
    assert read_scan(inside / "head.obj").textures[0][0, 0, 0] == 3


def test_links_do_not_lead_out(textured):
    inside = textured / "inside"
    inside.mkdir()
    (inside / "head.obj").write_text("mtllib head.mtl\nusemtl skin\n" + TRIANGLE)
    (inside / "head.mtl").write_text("newmtl skin\nmap_Kd link.png\n")
    try:
        (inside / "link.png").symlink_to(textured / "other.png")
    except OSError:
        pytest.skip("this system makes no links")
    with pytest.raises(InputError, match="outside"):
        read_scan(inside / "head.obj")


def test_albedo_needs_uv(tmp_path):
    (tmp_path / "head.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    Image.new("RGB", (2, 2)).save(tmp_path / "skin.png")
    with pytest.raises(InputError, match="texture coordinates"):
        read_scan(tmp_path / "head.obj", albedo=tmp_path / "skin.png")


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "empty.obj").write_bytes(b"")
    (tmp_path / "head.fbx").write_bytes(b"Kaydara")
    for path, word in (
        (tmp_path / "gone.obj", "does not exist"),
        (tmp_path, "is a folder"),
        (tmp_path / "empty.obj", "is empty"),
        (tmp_path / "head.fbx", "unknown format '.fbx'"),
    ):
        with pytest.raises(InputError, match=word) as error:
            read_scan(path)
        assert "\n" not in str(error.value)


def test_units(textured):
    assert unit_in_mm("inch") == 25.4 and unit_in_mm("2.5") == 2.5 and unit_in_mm(None) is None
    for wrong in ("furlong", -1, "nan", 0):
        with pytest.raises(InputError, match="unknown unit"):
            unit_in_mm(wrong)
    scan = read_scan(textured / "head.obj", albedo=textured / "other.png", unit="cm")
    assert scan.unit_mm == 10.0 and np.array_equal(scan.vertices[1], [1, 0, 0])


def test_real_scans(shared):
    folder = shared / "data" / "scans"
    scan = read_scan(folder / "lee-perry-smith" / "head.obj")
    assert len(scan.vertices) == 8838 and len(scan.textures) == 1
    scan = read_scan(folder / "menpo-james" / "james.obj")
    assert len(scan.vertices) == 6393 and scan.textures[0].shape == (1600, 2400, 3)
    pytest.importorskip("DracoPy")
    draco = folder / "lee-perry-smith-draco"
    scan = read_scan(draco / "LeePerrySmith.glb", albedo=draco / "color.jpg")
    assert np.abs(np.ptp(scan.vertices, axis=0) - [8.5, 7.9, 5.2]).max() < 0.1
