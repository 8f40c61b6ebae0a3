"""The reader of template folders: what it takes and what it refuses."""

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.template.assemble import fit_sphere
from facewright.template.source import read_description, read_source_mesh, read_source_vertices

OBJ = """# made by hand
mtllib none.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0.333333
v 2 0 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl skin
f 1/1 2/2 3/3 4/4
f 2/1/1 5/2/1 3/3/1
"""


def test_quads_and_triangles(tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    mesh = read_source_mesh(tmp_path / "a.obj")
    assert mesh.polygons.tolist() == [[0, 1, 2, 3], [1, 4, 2, -1]]
    assert mesh.uv_polygons.tolist() == [[0, 1, 2, 3], [0, 1, 2, -1]]
    assert np.allclose(read_source_vertices(tmp_path / "a.obj", 5), mesh.vertices)
    assert mesh.vertices[3, 2] == 0.333333


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("f 1/1 2/2 3/3 4/4", "f 1 2 3 4", "texture coordinates"),
        ("f 1/1 2/2 3/3 4/4", "f 1/1 2/2 3/3 4/4 5/1", "3 or 4 corners"),
        ("5/2/1", "9/2/1", "out of range"),
        ("v 2 0 0", "v 2 zero 0", "not 3 numbers"),
        ("v 2 0 0", "v 2 nan 0", "not finite"),
        ("v 2 0 0", "v 2 0", "not 3 numbers"),
    ],
)
def test_broken_files_are_refused(tmp_path, old, new, message):
    (tmp_path / "a.obj").write_text(OBJ.replace(old, new))
    with pytest.raises(InputError, match=message):
        read_source_mesh(tmp_path / "a.obj")


def test_another_mesh_and_missing_files_are_refused(tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    with pytest.raises(InputError, match="another mesh"):
        read_source_vertices(tmp_path / "a.obj", 7)
    with pytest.raises(InputError, match="cannot be read"):
        read_source_mesh(tmp_path / "b.obj")


def test_descriptions(tmp_path):
    path = tmp_path / "d.toml"
    for text, message in (("[info]\n", "lacks"), ("[info", "not valid TOML")):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            read_description(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_description(tmp_path / "none.toml")


def test_sphere_with_a_cornea():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(400, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    bulge = points[:, 2] > 0.9
    points *= np.where(bulge, 13.5, 12.0)[:, None]
    center, radius = fit_sphere(points + [31, 2, -5])
    assert np.allclose(center, [31, 2, -5], atol=0.05) and radius == pytest.approx(12, abs=0.05)
