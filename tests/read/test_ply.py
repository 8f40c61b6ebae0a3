"""PLY: the same mesh in all three layouts, with all that vertices and faces may carry."""

import struct

import numpy as np
import pytest
from PIL import Image

from facewright.errors import InputError
from facewright.read import read_scan

POINTS = [(0.0, 0.0, 0.25), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
COLORS = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (51, 51, 51)]
HEADER = """ply
format {layout} 1.0
comment made for a test
obj_info nothing
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property float s
property float t
element face {n}
property uchar quality
property list uchar int vertex_indices
element edge 1
property int vertex1
property int vertex2
end_header
"""


def content(layout, polygons):
    """A PLY of the square as bytes; polygons a list of index lists."""
    header = HEADER.format(layout=layout, n=len(polygons)).encode()
    if layout == "ascii":
        rows = [" ".join(map(str, (*p, *c, p[0], p[1]))) for p, c in zip(POINTS, COLORS)]
        rows += [" ".join(map(str, (7, len(p), *p))) for p in polygons] + ["0 1"]
        return header + "\n".join(rows).encode() + b"\n"
    order = ">" if "big" in layout else "<"
    body = b"".join(struct.pack(order + "3f3B2f", *p, *c, p[0], p[1]) for p, c in zip(POINTS, COLORS))
    body += b"".join(struct.pack(f"{order}BB{len(p)}i", 7, len(p), *p) for p in polygons)
    return header + body + struct.pack(order + "2i", 0, 1)


LAYOUTS = ("ascii", "binary_little_endian", "binary_big_endian")


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("polygons", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]], [[0, 1, 2, 3], [0, 1, 2]]])
def test_layouts(tmp_path, layout, polygons):
    (tmp_path / "head.ply").write_bytes(content(layout, polygons))
    scan = read_scan(tmp_path / "head.ply")
    assert np.array_equal(scan.vertices, POINTS)
    assert scan.faces[:2].tolist() == [[0, 1, 2], [0, 2, 3]]
    assert np.allclose(scan.colors * 255, COLORS)
    assert np.array_equal(scan.uv, np.array(POINTS)[:, :2]) and np.array_equal(scan.uv_faces, scan.faces)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("polygons", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3], [0, 1, 2]]])
def test_every_truncation_is_refused(tmp_path, layout, polygons):
    whole = content(layout, polygons)
    edges = 4 if layout == "ascii" else 8
    for length in range(0, len(whole) - edges, 7):
        (tmp_path / "head.ply").write_bytes(whole[:length])
        with pytest.raises(InputError):
            read_scan(tmp_path / "head.ply")


def test_texture_and_corner_coordinates(tmp_path):
    Image.new("RGB", (2, 2), (1, 2, 3)).save(tmp_path / "my skin.png")
    text = """ply
format ascii 1.0
comment TextureFile my skin.png
element vertex 3
property double x
property double y
property double z
element face 1
property list uchar int vertex_index
property list uchar float texcoord
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2 6 0.5 0.5 0.25 0 0 1
"""
    (tmp_path / "head.ply").write_text(text)
    scan = read_scan(tmp_path / "head.ply")
    assert np.array_equal(scan.uv[scan.uv_faces[0]], [[0.5, 0.5], [0.25, 0], [0, 1]])
    assert scan.has_texture and scan.face_texture.tolist() == [0]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("plx\n", "not a PLY"),
        ("ply\nformat ascii 1.0\n", "header"),
        ("ply\nformat morse 1.0\nend_header\n", "unknown format"),
        ("ply\nformat ascii 1.0\nelement vertex many\nend_header\n", "element vertex many"),
        ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "property float x"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n", "x, y and z"),
        (HEADER.format(layout="ascii", n=0) + "0 0 0 0 0 0 0 0\n" * 4 + "0 1\n", "points but no faces"),
        (HEADER.format(layout="ascii", n=1) + "0 0 0 0 0 0 0 zero\n", "words where numbers"),
        (content("ascii", [[0, 1, 9]]).decode(), "names a vertex"),
    ],
)
def test_bad_input(tmp_path, text, word):
    (tmp_path / "head.ply").write_text(text)
    with pytest.raises(InputError, match=word):
        read_scan(tmp_path / "head.ply")
