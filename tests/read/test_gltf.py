"""glTF: nodes, primitives, accessors of every kind, images; and what a damaged file says."""

import base64
import io
import json
import struct

import numpy as np
import pytest
from PIL import Image

from facewright.errors import InputError
from facewright.read import read_scan

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.25]], np.float32)
UV = np.array([[0, 0], [1, 0], [0.5, 0.25]], np.float32)
CORNERS = np.arange(3, dtype=np.uint16)


def png(color):
    file = io.BytesIO()
    Image.new("RGB", (2, 2), color).save(file, "PNG")
    return file.getvalue()


class Builder:
    """Collects arrays into one buffer and a glTF document around them."""

    def __init__(self):
        self.data = b""
        self.document = {
            "asset": {"version": "2.0"},
            "bufferViews": [],
            "accessors": [],
            "meshes": [],
            "nodes": [],
            "scenes": [{"nodes": []}],
            "scene": 0,
        }

    def view(self, data, **more):
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more}
        self.document["bufferViews"].append(view)
        self.data += data
        return len(self.document["bufferViews"]) - 1

    def accessor(self, array, **more):
        component = {"f4": 5126, "u2": 5123, "u1": 5121, "u4": 5125, "i2": 5122, "i1": 5120}[array.dtype.str[1:]]
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[1 if array.ndim == 1 else array.shape[1]]
        view = self.view(array.tobytes())
        described = {"bufferView": view, "componentType": component, "count": len(array), "type": kind, **more}
        self.document["accessors"].append(described)
        return len(self.document["accessors"]) - 1

    def mesh(self, points=POINTS, indices=CORNERS, uv=UV, **primitive):
        attributes = {"POSITION": points if isinstance(points, int) else self.accessor(points)}
        if uv is not None:
            attributes["TEXCOORD_0"] = uv if isinstance(uv, int) else self.accessor(uv)
        made = {"attributes": attributes, **primitive}
        if indices is not None:
            made["indices"] = self.accessor(indices)
        self.document["meshes"].append({"primitives": [made]})
        return len(self.document["meshes"]) - 1

    def node(self, **node):
        self.document["nodes"].append(node)
        return len(self.document["nodes"]) - 1

    def show(self, *nodes):
        self.document["scenes"][0]["nodes"] += nodes
        return self

    def glb(self):
        document = {**self.document, "buffers": [{"byteLength": len(self.data)}]}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        body = self.data + b"\0" * (-len(self.data) % 4)
        size = 12 + 8 + len(text) + 8 + len(body)
        head = struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON") + text
        return head + struct.pack("<I4s", len(body), b"BIN\0") + body


def read(tmp_path, data, name="head.glb", **options):
    (tmp_path / name).write_bytes(data)
    return read_scan(tmp_path / name, **options)


def simple():
    builder = Builder()
    return builder.show(builder.node(mesh=builder.mesh()))


def test_units_and_upright_v(tmp_path):
    scan = read(tmp_path, simple().glb())
    assert scan.unit_mm == 1000.0
    assert np.array_equal(scan.vertices, POINTS)
    assert np.array_equal(scan.uv, [[0, 1], [1, 1], [0.5, 0.75]])


def test_node_transforms_stack_and_mirrors_turn_the_winding(tmp_path):
    builder = Builder()
    half = np.sqrt(0.5)
    child = builder.node(mesh=builder.mesh(), scale=[-1, 1, 1])
    turned = builder.node(rotation=[0, 0, half, half], children=[child])  # a quarter about z
    matrix = np.eye(4)
    matrix[:3, 3] = 5, 6, 7
    parent = builder.node(matrix=matrix.T.ravel().tolist(), children=[turned])
    scan = read(tmp_path, builder.show(parent).glb())
    assert np.allclose(scan.vertices, [[5, 6, 7], [5, 5, 7], [4, 6, 7.25]])
    assert scan.faces.tolist() == [[2, 1, 0]]


def test_one_mesh_in_two_places_and_two_materials(tmp_path):
    builder = Builder()
    images = [{"bufferView": builder.view(png((250, 0, 0)))}, {"uri": "blue%20skin.png"}]
    (tmp_path / "blue skin.png").write_bytes(png((0, 0, 250)))
    materials = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": number}}} for number in (0, 1)]
    builder.document |= {"images": images, "textures": [{"source": 0}, {"source": 1}], "materials": materials}
    red, blue = builder.mesh(material=0), builder.mesh(material=1)
    builder.show(builder.node(mesh=red), builder.node(mesh=blue), builder.node(mesh=red, translation=[9, 0, 0]))
    scan = read(tmp_path, builder.glb())
    assert len(scan.vertices) == 9 and scan.face_texture.tolist() == [0, 1, 0]
    assert [image[0, 0].tolist() for image in scan.textures] == [[250, 0, 0], [0, 0, 250]]
    assert scan.vertices[6, 0] == 9


def test_strips_fans_and_no_indices(tmp_path):
    points = np.arange(15, dtype=np.float32).reshape(5, 3) ** 2
    strip = np.arange(5, dtype=np.uint8)
    for mode, faces in ((5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, [[0, 1, 2], [0, 2, 3], [0, 3, 4]])):
        for indices in (strip, None):
            builder = Builder()
            builder.show(builder.node(mesh=builder.mesh(points, indices, None, mode=mode)))
            assert read(tmp_path, builder.glb()).faces.tolist() == faces


def test_quantised_strided_and_sparse(tmp_path):
    builder = Builder()
    rows = np.zeros((3, 4), np.int16)
    rows[:, :3] = [[0, 0, 0], [32767, 0, 0], [0, 32767, -32767]]
    view = builder.view(rows.tobytes(), byteStride=8)
    where, what = builder.view(np.array([2], np.uint8).tobytes()), builder.view(np.array([[7, 7, 7]], "<i2").tobytes())
    accessor = {"bufferView": view, "componentType": 5122, "count": 3, "type": "VEC3", "normalized": True}
    sparse = {"count": 1, "indices": {"bufferView": where, "componentType": 5121}, "values": {"bufferView": what}}
    builder.document["accessors"] += [accessor, {**accessor, "normalized": False, "sparse": sparse}]
    uv = builder.accessor(np.array([[0, 0], [65535, 0], [0, 13107]], np.uint16), normalized=True)
    builder.show(builder.node(mesh=builder.mesh(0, uv=uv)), builder.node(mesh=builder.mesh(1, uv=uv)))
    builder.document["extensionsRequired"] = ["KHR_mesh_quantization"]
    scan = read(tmp_path, builder.glb())
    assert np.allclose(scan.vertices[:3], [[0, 0, 0], [1, 0, 0], [0, 1, -1]])
    assert scan.vertices[5].tolist() == [7, 7, 7]
    assert np.allclose(scan.uv[:3], [[0, 1], [1, 1], [0, 0.8]])


def test_gltf_with_data_uri_and_file(tmp_path):
    builder = simple()
    for uri in ("data:application/octet-stream;base64," + base64.b64encode(builder.data).decode(), "head.bin"):
        (tmp_path / "head.bin").write_bytes(builder.data)
        builder.document["buffers"] = [{"byteLength": len(builder.data), "uri": uri}]
        scan = read(tmp_path, json.dumps(builder.document).encode(), "head.gltf")
        assert np.array_equal(scan.vertices, POINTS)


def test_vertex_colours_are_linear_in_the_file(tmp_path):
    builder = Builder()
    colors = builder.accessor(np.array([[0, 0.5, 1, 1]] * 3, np.float32))
    mesh = builder.mesh()
    builder.document["meshes"][mesh]["primitives"][0]["attributes"]["COLOR_0"] = colors
    scan = read(tmp_path, builder.show(builder.node(mesh=mesh)).glb())
    assert np.allclose(scan.colors[0], [0, 0.7353570, 1])


def test_draco(tmp_path):
    draco = pytest.importorskip("DracoPy")
    grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), -1).reshape(-1, 2)
    points = np.column_stack([grid, np.sin(grid[:, 0])])
    quads = np.array([[i, i + 1, i + 7, i + 6] for i in range(30) if i % 6 < 5])
    faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    data = draco.encode(points, faces, quantization_bits=16, preserve_order=True)
    for factor in (1.0, 2.0):
        builder = Builder()
        extension = {"bufferView": builder.view(data), "attributes": {"POSITION": 0}}
        bounds = {"min": (points.min(0) * factor).tolist(), "max": (points.max(0) * factor).tolist()}
        accessor = {"componentType": 5126, "count": len(points), "type": "VEC3", **bounds}
        builder.document["accessors"].append(accessor)
        primitive = {"attributes": {"POSITION": 0}, "extensions": {"KHR_draco_mesh_compression": extension}}
        builder.document["meshes"].append({"primitives": [primitive]})
        builder.show(builder.node(mesh=0))
        if factor == 1.0:
            scan = read(tmp_path, builder.glb())
            assert np.abs(scan.vertices - points).max() < 1e-3 and np.array_equal(scan.faces, faces)
        else:  # a decoder that quietly gives something else than the file states
            with pytest.raises(InputError, match="bounds"):
                read(tmp_path, builder.glb())


def test_draco_without_its_package(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "DracoPy", None)
    builder = Builder()
    extension = {"bufferView": builder.view(b"DRACO"), "attributes": {"POSITION": 0}}
    primitive = {"attributes": {"POSITION": 0}, "extensions": {"KHR_draco_mesh_compression": extension}}
    builder.document["meshes"].append({"primitives": [primitive]})
    with pytest.raises(InputError, match="pip install DracoPy"):
        read(tmp_path, builder.show(builder.node(mesh=0)).glb())


def test_every_truncation_is_refused(tmp_path):
    whole = simple().glb()
    for length in range(1, len(whole), 13):
        with pytest.raises(InputError):
            read(tmp_path, whole[:length])


def test_damaged_bytes_are_read_or_refused(tmp_path):
    whole = bytearray(simple().glb())
    rng = np.random.default_rng(1)
    for _ in range(150):
        damaged = bytearray(whole)
        for at in rng.integers(20, len(whole), 3):
            damaged[at] = rng.integers(256)
        try:
            read(tmp_path, bytes(damaged))
        except InputError as error:
            assert "\n" not in str(error)


def changed(**changes):
    builder = simple()
    for key, value in changes.items():
        if key == "drop":
            del builder.document[value]
        else:
            builder.document[key] = value
    return builder.glb()


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (b"{}", "not glTF 2.0"),
        (b"not json", "no readable JSON"),
        (changed(asset={"version": "1.0"}), "not glTF 2.0"),
        (changed(extensionsRequired=["EXT_meshopt_compression"]), "EXT_meshopt_compression"),
        (changed(nodes=[{"mesh": 4}]), "damaged"),
        (changed(nodes=[{"mesh": 0, "children": [0]}]), "damaged"),
        (changed(drop="accessors"), "damaged"),
        (changed(meshes=[]), "damaged"),
        (changed(nodes=[{}]), "no faces"),
        (changed(bufferViews=[{"buffer": 0, "byteLength": 9999}] * 3), "ends at byte 9999"),
        (changed(bufferViews=[{"buffer": 0, "byteLength": 4}] * 3), "needs"),
    ],
)
def test_bad_input(tmp_path, data, word):
    with pytest.raises(InputError, match=word):
        read(tmp_path, data)


@pytest.mark.parametrize(
    "uri", ["../secret.bin", "/etc/hostname", "%2e%2e/secret.bin", "https://example.com/a.bin", ""]
)
def test_nothing_is_read_outside_the_folder(tmp_path, uri):
    inside = tmp_path / "scan"
    inside.mkdir()
    builder = simple()
    (tmp_path / "secret.bin").write_bytes(builder.data)
    builder.document["buffers"] = [{"byteLength": len(builder.data), "uri": uri}]
    with pytest.raises(InputError):
        read(inside, json.dumps(builder.document).encode(), "head.gltf")
