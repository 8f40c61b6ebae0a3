"""A Rig as one binary glTF 2.0 file: meshes with named morph targets, materials with their images, skeleton.

Written by hand (struct and json), because the libraries at hand know no morph targets. Choices that readers ask for:

- metres, +Y up, +Z forward, which are our axes; V runs down in glTF, so v' = 1 - v and images stay as they are;
- vertices are doubled at UV seams only, and normals are computed before that, so no seam shows in the light;
- every target carries POSITION and NORMAL deltas in dense accessors with a buffer view of their own, zeros too:
  viewers have stumbled over sparse, interleaved and view-less morph data;
- names in mesh.extras.targetNames, how to play them in the scene's extras; a mesh has all targets of the rig or none;
- joints are moved onto a grid of 2^-20 m, on which their sums and differences are exact in float32: at rest the
  skinning matrices are the identity to the bit;
- meshes with a normal map carry tangents by the rule the map was baked with, since viewers' own derivations differ;
- colour as JPEG (4:4:4: skin suffers from halved chroma), a tenth of the PNG; data maps and images with transparency as
  PNG, since JPEG's blocks show in highlights. The lossless images are written beside the file (textures/, rig/).
"""

from __future__ import annotations

import io
import json
import struct
from dataclasses import dataclass

import numpy as np
from PIL import Image

from facewright.mesh.normals import vertex_normals
from facewright.mesh.tangents import corner_tangents
from facewright.write.files import png_bytes, replace_file

_FLOAT, _UBYTE, _USHORT, _UINT = 5126, 5121, 5123, 5125
_VERTEX_BUFFER, _INDEX_BUFFER = 34962, 34963
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_JOINT_GRID_M = 2.0**-20
_M_PER_MM = 0.001


@dataclass(frozen=True)
class GltfOptions:
    """How a Rig becomes a GLB.

    jpeg_quality   1..100, colour maps; 92 is not told from the original on skin
    png_level      1..9, data maps: higher is smaller and slower
    tangents       write tangents for meshes with a normal map
    """

    jpeg_quality: int = 92
    png_level: int = 3
    tangents: bool = True


def write_gltf(rig, path, options=GltfOptions(), png=png_bytes):
    """Write a Rig to path (.glb). Same rig and options, same bytes. png: how maps are encoded (files.PngOnce)"""
    replace_file(path, gltf_bytes(rig, options, png))


def gltf_bytes(rig, options=GltfOptions(), png=png_bytes):
    """The bytes of a Rig as .glb."""
    document = _Document(_asset(rig))
    textures = {name: document.add_image(name, *_encode(rig, name, options, png)) for name in _used_maps(rig)}
    joints = document.add_skeleton(rig.skeleton)
    for mesh in rig.meshes:
        material = document.add_material(mesh.material, textures, _see_through(rig, mesh.material))
        primitive = split_at_seams(mesh, tangents=options.tangents and mesh.material.normal is not None)
        document.add_mesh(mesh.name, primitive, material, joints, rig.target_names)
    document.add_scene_extras(_how_to_play(rig))
    return document.to_bytes()


def _asset(rig):
    asset = {"version": "2.0", "generator": f"Facewright {rig.info.get('facewright_version', '')}".strip()}
    if rig.info.get("copyright"):
        asset["copyright"] = str(rig.info["copyright"])
    return asset


def _how_to_play(rig):
    """What a player needs beside the targets: the tables of expand_weights, the expressions and the visemes."""
    tables = {
        "inBetweens": {
            name: {f"{at:g}": target for at, target in steps.items()} for name, steps in rig.in_betweens.items()
        },
        "correctives": {name: list(drivers) for name, drivers in rig.correctives.items()},
        "halves": {name: list(sides) for name, sides in rig.halves.items()},
        "expressions": rig.expressions,
        "visemes": rig.visemes,
    }
    return {"facewright": tables} if any(tables.values()) else {}


@dataclass(frozen=True)
class Primitive:
    """A mesh as glTF stores it: one index for everything.

    origin  (v,) vertex of the Mesh each glTF vertex comes from
    indices (m, 3); positions, normals (v, 3) metres; uv (v, 2) with v down; tangents (v, 4) or None
    joints  (v, 4) int; weights (v, 4) float32 that sum to 1
    target_positions, target_normals (t, v, 3) deltas, or None; all floats are float32
    """

    origin: np.ndarray
    indices: np.ndarray
    positions: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    tangents: np.ndarray | None
    joints: np.ndarray
    weights: np.ndarray
    target_positions: np.ndarray | None
    target_normals: np.ndarray | None


def split_at_seams(mesh, tangents=False):
    """The Primitive of a Mesh: a vertex for each pair of vertex and UV (and side of a mirrored UV, with tangents)."""
    side = np.zeros((len(mesh.faces), 1), np.int64)
    normals = _unit_normals(mesh.vertices, mesh.faces)
    if tangents:
        per_corner, sign = corner_tangents(mesh.vertices, mesh.faces, normals, mesh.uv, mesh.uv_faces)
        side = (sign < 0)[:, None].astype(np.int64)
    keys = (mesh.faces * max(len(mesh.uv), 1) + mesh.uv_faces) * 2 + side
    _, first, inverse = np.unique(keys.ravel(), return_index=True, return_inverse=True)
    origin = mesh.faces.ravel()[first]
    uv = mesh.uv[mesh.uv_faces.ravel()[first]]
    joints, weights = _four_weights(mesh.skin_weights)
    positions, changes = _target_deltas(mesh, normals)
    return Primitive(
        origin=origin,
        indices=inverse.reshape(-1, 3),
        positions=_float32(mesh.vertices[origin] * _M_PER_MM),
        normals=_float32(normals[origin]),
        uv=_float32(np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)),
        tangents=_with_sign(per_corner.reshape(-1, 3)[first], np.repeat(sign, 3)[first]) if tangents else None,
        joints=joints[origin],
        weights=weights[origin],
        target_positions=None if positions is None else positions[:, origin],
        target_normals=None if changes is None else changes[:, origin],
    )


def _float32(values):
    """float32 without negative zeros, so that equal geometry gives equal bytes."""
    return np.asarray(values, np.float32) + np.float32(0.0)


def _with_sign(vectors, sign):
    return _float32(np.concatenate([vectors, sign[:, None]], axis=1))


def _unit_normals(vertices, faces):
    """Vertex normals; where there is none (no face, or no area) straight ahead, since a normal must have length 1."""
    normals = vertex_normals(vertices, faces)
    normals[~normals.any(axis=1)] = [0.0, 0.0, 1.0]
    return normals


def _target_deltas(mesh, normals):
    """(t, n, 3) float32 position deltas in metres and normal deltas; (None, None) for a mesh that never moves.

    A normal's delta is the normalised normal of neutral + delta minus the neutral's, computed only around what moves.
    """
    if mesh.deltas is None:
        return None, None
    changes = np.zeros(mesh.deltas.shape, np.float32)
    for change, delta in zip(changes, mesh.deltas):
        near = delta.any(axis=1)[mesh.faces].any(axis=1)
        touched = np.zeros(len(normals), bool)
        touched[mesh.faces[near]] = True
        around = mesh.faces[touched[mesh.faces].any(axis=1)]
        moved = _unit_normals(mesh.vertices + delta, around)
        change[touched] = _float32(moved[touched] - normals[touched])
    return _float32(mesh.deltas * _M_PER_MM), changes


def _four_weights(skin_weights):
    """The four strongest joints of each vertex (n, 4) and their weights (n, 4) float32, which sum to 1."""
    n, j = skin_weights.shape
    padded = np.concatenate([skin_weights, np.zeros((n, max(0, 4 - j)))], axis=1)
    order = np.argsort(-padded, axis=1, kind="stable")[:, :4]
    weights = np.take_along_axis(padded, order, axis=1)
    weights = np.where(weights < 1e-4, 0.0, weights)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.divide(weights, total, out=np.tile([1.0, 0, 0, 0], (n, 1)), where=total > 0).astype(np.float32)
    weights[:, 0] = 1.0 - weights[:, 1:].sum(axis=1)
    joints = np.where(weights > 0, order, 0)
    return joints, weights


def _see_through(rig, material):
    """Whether a Material lets through what lies behind: as a whole or by its texture's alpha."""
    return material.alpha < 1.0 or (material.albedo is not None and rig.maps[material.albedo].shape[2:] == (4,))


def _used_maps(rig):
    """Names of the maps that materials use, each once, in the order of the meshes."""
    names = [name for mesh in rig.meshes for name in (mesh.material.albedo, mesh.material.normal) if name]
    return list(dict.fromkeys(names))


def _encode(rig, name, options, png):
    """(bytes, mime type) of a map."""
    pixels = rig.maps[name]
    image = Image.fromarray(np.squeeze(pixels))
    is_data = name in {mesh.material.normal for mesh in rig.meshes} or image.mode not in ("RGB", "L")
    if is_data:
        return png(pixels, options.png_level), "image/png"
    stream = io.BytesIO()
    image.save(stream, "JPEG", quality=options.jpeg_quality, subsampling=0)
    return stream.getvalue(), "image/jpeg"


class _Document:
    """A glTF document that grows: json lists and one binary buffer."""

    def __init__(self, asset):
        self._json = {"asset": asset, "scene": 0, "scenes": [{"nodes": []}], "nodes": []}
        self._binary = bytearray()

    def _append(self, key, item):
        items = self._json.setdefault(key, [])
        items.append(item)
        return len(items) - 1

    def _view(self, content, target=None):
        self._binary.extend(b"\0" * (-len(self._binary) % 4))
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(content)}
        self._binary.extend(content)
        return self._append("bufferViews", view | ({"target": target} if target else {}))

    def _accessor(self, array, component, *, target=_VERTEX_BUFFER, bounds=False, width=None):
        width = array.shape[-1] if width is None else width
        little = array.astype(array.dtype.newbyteorder("<"), copy=False)
        accessor = {
            "bufferView": self._view(little.tobytes(), target),
            "componentType": component,
            "count": array.size // width,
            "type": _TYPES[width],
        }
        if bounds:
            flat = array.reshape(-1, width)
            accessor |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        return self._append("accessors", accessor)

    def add_image(self, name, content, mime):
        """Index of a texture that shows an encoded image."""
        image = self._append("images", {"name": name, "mimeType": mime, "bufferView": self._view(content)})
        if "samplers" not in self._json:
            # Linear with mipmaps; clamped, since the maps do not tile.
            self._append("samplers", {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071})
        return self._append("textures", {"name": name, "sampler": 0, "source": image})

    def add_material(self, material, textures, see_through):
        """Index of a Material; textures maps names of maps to textures.

        Lashes and soft strips are blended: a mask would cut their fine ends off.
        """
        surface = {
            "baseColorFactor": [*(float(c) for c in material.color), float(material.alpha)],
            "metallicFactor": 0.0,
            "roughnessFactor": float(material.roughness),
        }
        if material.albedo:
            surface["baseColorTexture"] = {"index": textures[material.albedo]}
        entry = {"name": material.name, "pbrMetallicRoughness": surface}
        if material.normal:
            entry["normalTexture"] = {"index": textures[material.normal]}
        if see_through:
            entry["alphaMode"] = "BLEND"
        if material.double_sided:
            entry["doubleSided"] = True
        known = self._json.setdefault("materials", [])
        return known.index(entry) if entry in known else self._append("materials", entry)

    def add_skeleton(self, skeleton):
        """Index of a skin with the skeleton's joints as nodes."""
        world = np.round(skeleton.positions * _M_PER_MM / _JOINT_GRID_M) * _JOINT_GRID_M
        first = len(self._json["nodes"])
        nodes = []
        for index, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents)):
            local = world[index] - (world[parent] if parent >= 0 else 0.0)
            nodes.append({"name": name, "translation": (local + 0.0).tolist()})
        for index, parent in enumerate(skeleton.parents):
            if parent >= 0:
                nodes[parent].setdefault("children", []).append(first + index)
        self._json["nodes"].extend(nodes)
        roots = [first + index for index, parent in enumerate(skeleton.parents) if parent < 0]
        self._json["scenes"][0]["nodes"].extend(roots)
        inverse = np.tile(np.eye(4, dtype=np.float32), (len(nodes), 1, 1))
        inverse[:, 3, :3] = -world  # column-major: the last column is the fourth row here
        matrices = self._accessor(_float32(inverse), _FLOAT, target=None, width=16)
        joints = list(range(first, first + len(nodes)))
        return self._append("skins", {"joints": joints, "inverseBindMatrices": matrices, "skeleton": roots[0]})

    def add_mesh(self, name, primitive, material, skin, target_names):
        """A skinned mesh as a node of its own at the root of the scene."""
        small = len(primitive.positions) < 65535
        indices = primitive.indices.reshape(-1).astype(np.uint16 if small else np.uint32)
        attributes = {
            "POSITION": self._accessor(primitive.positions, _FLOAT, bounds=True),
            "NORMAL": self._accessor(primitive.normals, _FLOAT),
        }
        if primitive.tangents is not None:
            attributes["TANGENT"] = self._accessor(primitive.tangents, _FLOAT)
        attributes["TEXCOORD_0"] = self._accessor(primitive.uv, _FLOAT)
        attributes["JOINTS_0"] = self._accessor(primitive.joints.astype(np.uint8), _UBYTE)
        attributes["WEIGHTS_0"] = self._accessor(primitive.weights, _FLOAT)
        index_accessor = self._accessor(indices, _USHORT if small else _UINT, target=_INDEX_BUFFER, width=1)
        drawn = {"attributes": attributes, "indices": index_accessor, "material": material, "mode": 4}
        mesh = {"name": name, "primitives": [drawn]}
        if primitive.target_positions is not None:
            drawn["targets"] = [
                {"POSITION": self._accessor(p, _FLOAT, bounds=True), "NORMAL": self._accessor(q, _FLOAT)}
                for p, q in zip(primitive.target_positions, primitive.target_normals)
            ]
            mesh |= {"weights": [0.0] * len(target_names), "extras": {"targetNames": list(target_names)}}
        taken = {node["name"] for node in self._json["nodes"]}
        node_name = f"{name}_mesh" if name in taken else name  # a joint "eye_left" has its name first
        node = {"name": node_name, "mesh": self._append("meshes", mesh), "skin": skin}
        self._json["scenes"][0]["nodes"].append(self._append("nodes", node))

    def add_scene_extras(self, extras):
        """Data of the application's own, on the scene: viewers hand it on."""
        if extras:
            self._json["scenes"][0]["extras"] = extras

    def to_bytes(self):
        """The document as GLB: header, JSON chunk, binary chunk."""
        self._binary.extend(b"\0" * (-len(self._binary) % 4))
        self._json["buffers"] = [{"byteLength": len(self._binary)}]
        text = json.dumps(self._json, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode("utf-8")
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(self._binary)
        parts = (
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(self._binary), b"BIN\0"),
            bytes(self._binary),
        )
        return b"".join(parts)
