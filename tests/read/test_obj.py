"""OBJ: every way to write the same mesh reads the same; every fault is said with its line."""

import numpy as np
import pytest
from PIL import Image

from facewright.errors import InputError
from facewright.read import read_scan
from facewright.read.obj import _parse_corners, texture_file

SQUARE = """v 0 0 0
v 1 0 0.333333333333
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
"""


def written(folder, text, name="head.obj"):
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "faces",
    [
        "f 1/1 2/2 3/3 4/4",
        "f 1/1/1 2/2/1 3/3/1 4/4/1\n",
        "f 1/1 2/2 3/3\nf 1/1/9 3/3/9 4/4/9",
        "f -4/-4 -3/-3 -2/-2 -1/-1",
        "f 1/1 2/2 \\\n3/3 4/4 # a comment",
        "o one\r\nf  1/1\t2/2 3/3\r\ng two\ns off\nf 1/1 3/3 4/4\r\n",
    ],
)
def test_same_square(tmp_path, faces):
    scan = read_scan(written(tmp_path, SQUARE + faces))
    assert scan.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert scan.uv_faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert scan.vertices[1].tolist() == [1, 0, 0.333333333333]
    assert np.array_equal(scan.T_ours_to_scan, np.eye(4)) and scan.unit_mm is None


def test_polygons_without_uv(tmp_path):
    text = "".join(f"v {np.cos(a)} {np.sin(a)} 0\n" for a in np.arange(5)) + "f 1//3 2//3 3//3 4//3 5//3\nf 1 2 3\n"
    scan = read_scan(written(tmp_path, text))
    assert scan.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2]]
    assert scan.uv is None and scan.textures == ()


def test_negative_indices_count_from_their_line(tmp_path):
    triangle = "v {0} 0 0\nv {0} 1 0\nv {0} 0 1\nf -3 -2 -1\n"
    scan = read_scan(written(tmp_path, triangle.format(0) + triangle.format(1)))
    assert scan.faces.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_vertex_colours(tmp_path):
    scan = read_scan(written(tmp_path, "v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 0 1 0 0 255 0\nf 1 2 3\n"))
    assert np.allclose(scan.colors, [[1, 0, 0.2], [0, 0, 0], [0, 1, 0]])


def test_faces_with_and_without_uv(tmp_path):
    Image.new("RGB", (2, 2), (9, 8, 7)).save(tmp_path / "skin.png")
    scan = read_scan(written(tmp_path, SQUARE + "f 1/1 2/2 3/3\nf 1 3 4\n"), albedo=tmp_path / "skin.png")
    assert scan.face_texture.tolist() == [0, -1]
    assert scan.textures[0].tolist() == [[[9, 8, 7]] * 2] * 2


def test_materials(tmp_path):
    Image.new("RGB", (2, 2), (200, 0, 0)).save(tmp_path / "red skin.png")
    (tmp_path / "maps").mkdir()
    Image.new("L", (2, 2), 7).save(tmp_path / "maps" / "grey.jpg")
    written(
        tmp_path,
        "newmtl a\nKd 1 1 1\nmap_Kd -s 1 1 1 -o 0.5 red skin.png\nnewmtl b\nmap_Kd maps/grey.jpg\nnewmtl c\nKd 1 0 0\n"
        "newmtl unused\nmap_Kd nowhere.png\n",
        "head.mtl",
    )
    faces = (
        "mtllib head.mtl\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\nusemtl a\nf 1/1 2/2 3/3\nusemtl c\nf 1/1 2/2 3/3\n"
    )
    scan = read_scan(written(tmp_path, SQUARE + faces))
    assert [scan.textures[number][0, 0].tolist() for number in scan.face_texture[1:3]] == [[7, 7, 7], [200, 0, 0]]
    assert scan.face_texture[[0, 3]].tolist() == [-1, -1]


def test_only_material_is_for_all(tmp_path):
    Image.new("RGB", (2, 2)).save(tmp_path / "skin.png")
    written(tmp_path, "newmtl skin\nmap_Kd skin.png\n", "head.mtl")
    scan = read_scan(written(tmp_path, "mtllib head.mtl\n" + SQUARE + "f 1/1 2/2 3/3\n"))
    assert scan.face_texture.tolist() == [0]


def test_missing_library_is_noted(tmp_path):
    (tmp_path / "skin.png").write_bytes(b"")
    scan = read_scan(written(tmp_path, "mtllib gone.mtl\nusemtl a\n" + SQUARE + "f 1/1 2/2 3/3\n"))
    assert scan.textures == () and "gone.mtl" in scan.notes[0]
    assert "--albedo gives (skin.png)" in scan.notes[0]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("v 0 0\nf 1 1 1\n", "line 1"),
        ("v 0 0 0\nv 1 x 0\nf 1 2 1\n", "line 2"),
        (SQUARE + "f 1 2 three\n", "line 9"),
        (SQUARE + "f 1/1/1/1 2 3\n", "line 9"),
        (SQUARE + "f 1 2 9\n", "names a vertex"),
        (SQUARE + "f 1 2 -7\n", "names a vertex"),
        (SQUARE + "f 0 1 2\n", "names a vertex"),
        (SQUARE + "f 1/1 2/2 3/8\n", "texture coordinate"),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 1 is not a finite"),
        ("v 0 0 0\nv 1 0 inf\nv 0 1 0\nf 1 2 3\n", "vertex 2 is not a finite"),
        (SQUARE.replace("vt 1 1", "vt nan 1") + "f 1/1 2/2 3/3\n", "not finite"),
        (SQUARE, "points but no faces"),
        ("# nothing\n", "no faces"),
        ("v 0 0 0\nv 1 1 1\nf 1 2\n", "no faces"),
        ("vt\nv 0 0 0\nf 1 1 1\n", "line 1"),
    ],
)
def test_bad_input_is_one_sentence(tmp_path, text, word):
    with pytest.raises(InputError, match=word) as error:
        read_scan(written(tmp_path, text))
    assert "\n" not in str(error.value)


def test_any_bytes_are_read_or_refused(tmp_path):
    rng = np.random.default_rng(0)
    alphabet = np.frombuffer(b"vft 0123456789./-\n#eE", np.uint8)
    for round_ in range(60):
        text = rng.choice(alphabet, 200).tobytes() if round_ % 2 else rng.bytes(200)
        (tmp_path / "noise.obj").write_bytes(text + b"\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        try:
            read_scan(tmp_path / "noise.obj")
        except InputError as error:
            assert "\n" not in str(error)


def test_words_of_corners():
    v, vt = _parse_corners(b"1 22/3 4//5 6/7/8 -9/-1")
    assert v.tolist() == [1, 22, 4, 6, -9] and vt.tolist() == [0, 3, 0, 7, -1]
    for text in (b"1/2/3/4", b"/1", b"1.5", b"a", b"1 /2"):
        with pytest.raises(ValueError):
            _parse_corners(text)


def test_file_name_behind_options():
    assert texture_file("-bm 0.3 -clamp on my skin.png") == "my skin.png"
    assert texture_file("-o 1 2 3 -s 1 skin.png") == "skin.png"
    assert texture_file("1.png") == "1.png"
