import json

import numpy as np
import pytest
from PIL import Image

from facewright.errors import InputError
from facewright.write.textures import write_textures


@pytest.fixture
def maps():
    rng = np.random.default_rng(0)
    albedo, normal = rng.integers(0, 256, (2, 16, 16, 3)).astype(np.uint8)
    return {"albedo": albedo, "normal": normal, "coverage": rng.choice([0, 128, 255], (16, 16)).astype(np.uint8)}


def test_images_come_back_and_the_manifest_says_how_to_read_them(maps, tmp_path):
    document = write_textures(maps, tmp_path / "textures", {"size": 16, "texels_per_mm_face_median": 4.5})
    for name, image in maps.items():
        np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "textures" / f"{name}.png")), image)
    manifest = json.loads((tmp_path / "textures" / "manifest.json").read_text())
    assert manifest == document
    assert manifest["texels_per_mm_face_median"] == 4.5
    spaces = {name: entry["color_space"] for name, entry in manifest["maps"].items()}
    assert spaces == {"albedo": "sRGB", "normal": "linear", "coverage": "linear"}
    assert manifest["maps"]["normal"]["green"].startswith("+Y")
    assert manifest["maps"]["coverage"]["channels"] == 1
    assert sorted(path.name for path in (tmp_path / "textures").iterdir()) == [
        "albedo.png",
        "coverage.png",
        "manifest.json",
        "normal.png",
    ]


def test_same_maps_same_bytes(maps, tmp_path):
    write_textures(maps, tmp_path / "a")
    write_textures(dict(reversed(maps.items())), tmp_path / "b")
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_a_folder_that_cannot_be_is_said_so(maps, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        write_textures(maps, tmp_path / "file" / "textures")
