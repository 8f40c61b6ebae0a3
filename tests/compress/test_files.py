"""The command line from images to a packed set and back."""

import numpy as np
from PIL import Image

from facewright.cli.__main__ import main

QUAD = "v 0 0 0\nv 100 0 0\nv 100 100 0\nv 0 100 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"


def make_folder(folder):
    rng = np.random.default_rng(0)
    (folder / "textures").mkdir()
    neutral = rng.integers(90, 160, (40, 48, 3)).astype(np.uint8)
    Image.fromarray(neutral).save(folder / "neutral.png")
    for name in ("smile", "frown"):
        Image.fromarray(neutral + rng.integers(0, 40, neutral.shape).astype(np.uint8)).save(
            folder / "textures" / f"{name}.png"
        )
    (folder / "mesh.obj").write_text(QUAD)
    return ["compress", f"{folder}/textures", "--neutral", f"{folder}/neutral.png", "--mesh", f"{folder}/mesh.obj"]


def test_compress_and_decompress(tmp_path):
    command = make_folder(tmp_path)
    assert main([*command, "--out", f"{tmp_path}/packed", "--quiet"]) == 0
    frame = tmp_path / "frame.png"
    assert main(["decompress", f"{tmp_path}/packed", "--weights", "smile=1", "--out", str(frame)]) == 0
    smile = np.array(Image.open(tmp_path / "textures" / "smile.png")).astype(int)
    assert np.abs(np.array(Image.open(frame)).astype(int) - smile).max() <= 1


def test_bad_input_ends_in_exit_code_2_and_leaves_nothing(tmp_path, capsys):
    command = make_folder(tmp_path)
    out = tmp_path / "packed"
    (tmp_path / "textures" / "broken.png").write_bytes(b"\x89PNG")
    assert main([*command, "--out", str(out), "--quiet"]) == 2
    assert "broken.png" in capsys.readouterr().err and not out.exists()
    (tmp_path / "mesh.obj").write_text(QUAD.replace("vt 1 1", "vt 1.5 1"))
    assert main([*command, "--out", str(out), "--quiet"]) == 2
    assert "beyond the image" in capsys.readouterr().err and not out.exists()
