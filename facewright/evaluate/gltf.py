"""A GLB read back into arrays, to see what a reader of the file sees. Shares no code with the writer."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass

import numpy as np

from facewright.errors import InputError

_DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class GlbMesh:
    """One mesh of a file, as stored: positions, normals (v, 3) and uv (v, 2) float32, faces (m, 3).

    target_names (t,), deltas and normal_deltas (t, v, 3) float32; empty for a mesh without targets
    weights (t,) the mesh's own morph weights
    """

    name: str
    positions: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    faces: np.ndarray
    joints: np.ndarray
    joint_weights: np.ndarray
    target_names: tuple[str, ...]
    deltas: np.ndarray
    normal_deltas: np.ndarray
    weights: np.ndarray
    material: dict

    def posed(self, weights):
        """(v, 3) float32 positions at target weights (t,), in the order and precision of the standard."""
        result = self.positions.copy()
        for weight, delta in zip(np.asarray(weights, np.float32), self.deltas):
            result += weight * delta
        return result


@dataclass(frozen=True)
class Glb:
    """meshes by name, asset and the whole JSON; images name -> (mime type, bytes); skinning (j, 4, 4) at rest."""

    meshes: dict[str, GlbMesh]
    asset: dict
    document: dict
    images: dict[str, tuple[str, bytes]]
    rest_matrices: np.ndarray


def read_glb(path):
    """Read a .glb. Raises InputError when it is not a complete binary glTF 2.0 file."""
    with open(path, "rb") as file:
        content = file.read()
    if len(content) < 20 or content[:4] != b"glTF":
        raise InputError(f"evaluate: {path} is not a GLB file (it does not begin with 'glTF')")
    version, length = struct.unpack_from("<II", content, 4)
    if version != 2 or length != len(content):
        raise InputError(f"evaluate: {path} is version {version} with {length} bytes announced, {len(content)} found")
    chunks = dict(_chunks(content))
    document, binary = json.loads(chunks[b"JSON"]), chunks.get(b"BIN\0", b"")
    meshes = [_mesh(mesh, document, binary) for mesh in document.get("meshes", [])]
    images = {}
    for image in document.get("images", []):
        view = document["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        images[image["name"]] = (image["mimeType"], binary[start : start + view["byteLength"]])
    rest = _rest_matrices(document, binary)
    return Glb({mesh.name: mesh for mesh in meshes}, document["asset"], document, images, rest)


def _chunks(content):
    at = 12
    while at < len(content):
        length, kind = struct.unpack_from("<I4s", content, at)
        yield kind, content[at + 8 : at + 8 + length]
        at += 8 + length


def _array(index, document, binary):
    """The values of an accessor, (count, width) or (count,) for scalars."""
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    dtype, width = np.dtype(_DTYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
    stride = view.get("byteStride", dtype.itemsize * width)
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    shape, strides = (accessor["count"], width), (stride, dtype.itemsize)
    values = np.ndarray(shape, dtype, binary, start, strides).copy()
    return values[:, 0] if width == 1 else values


def _mesh(mesh, document, binary):
    (primitive,) = mesh["primitives"]
    attributes = {name: _array(index, document, binary) for name, index in primitive["attributes"].items()}
    targets = primitive.get("targets", [])
    shape = (len(targets), len(attributes["POSITION"]), 3)
    deltas = [_array(target["POSITION"], document, binary) for target in targets]
    normal_deltas = [_array(target["NORMAL"], document, binary) for target in targets]
    return GlbMesh(
        name=mesh["name"],
        positions=attributes["POSITION"],
        normals=attributes["NORMAL"],
        uv=attributes["TEXCOORD_0"],
        faces=_array(primitive["indices"], document, binary).astype(np.int64).reshape(-1, 3),
        joints=attributes["JOINTS_0"],
        joint_weights=attributes["WEIGHTS_0"],
        target_names=tuple(mesh.get("extras", {}).get("targetNames", ())),
        deltas=np.array(deltas, np.float32).reshape(shape),
        normal_deltas=np.array(normal_deltas, np.float32).reshape(shape),
        weights=np.array(mesh.get("weights", ()), float),
        material=document["materials"][primitive["material"]],
    )


def _rest_matrices(document, binary):
    """(j, 4, 4) what skinning multiplies vertices with when no joint is moved: identity in a sound file."""
    if not document.get("skins"):
        return np.zeros((0, 4, 4))
    nodes = document["nodes"]
    parent = {child: index for index, node in enumerate(nodes) for child in node.get("children", ())}

    def world(index):
        local = np.eye(4)
        local[:3, 3] = nodes[index].get("translation", (0.0, 0.0, 0.0))
        return world(parent[index]) @ local if index in parent else local

    skin = document["skins"][0]
    inverse = _array(skin["inverseBindMatrices"], document, binary).reshape(-1, 4, 4).transpose(0, 2, 1)
    return np.array([world(joint) @ matrix for joint, matrix in zip(skin["joints"], inverse.astype(float))])
