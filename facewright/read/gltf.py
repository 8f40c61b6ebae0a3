"""glTF 2.0, as .glb or .gltf: scene nodes, several primitives, embedded or neighbouring images, quantised and sparse
accessors; Draco by the optional package DracoPy. Animation, skins and morph targets are left out: the scan stands as
its nodes place it.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
import urllib.parse

import numpy as np

from facewright.errors import InputError
from facewright.mesh.render import linear_to_srgb
from facewright.read.raw import ImageSource, RawMaterial, RawMesh, path_beside

MM_PER_METRE = 1000.0
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
# What a reader may ignore although a file asks for it: it changes no shape and no base colour that we need.
_HARMLESS = {
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_draco_mesh_compression",
    "EXT_texture_webp",
    "KHR_materials_unlit",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_emissive_strength",
    "KHR_lights_punctual",
}


def read_gltf(path):
    """RawMesh of a .glb or .gltf file: all meshes of its scene as the nodes place them. V is turned to run upward."""
    document, binary = _open(path)
    try:
        return _Reader(path, document, binary).read()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, struct.error) as error:
        raise InputError(f"{path.name}: is a damaged glTF ({type(error).__name__}: {error}); export it again") from None


def _open(path):
    """The JSON document and the binary chunk (or None)."""
    data = path.read_bytes()
    binary = None
    if data[:4] == b"glTF":
        data, binary = _split_glb(path, data)
    try:
        document = json.loads(data.decode("utf-8-sig"))
    except (UnicodeDecodeError, json.JSONDecodeError):
        raise InputError(f"{path.name}: is not a glTF file (no readable JSON); export it again") from None
    if not isinstance(document, dict) or not str(document.get("asset", {}).get("version", "")).startswith("2"):
        raise InputError(f"{path.name}: is not glTF 2.0; export it again as glTF 2.0")
    unknown = sorted(set(document.get("extensionsRequired", [])) - _HARMLESS)
    if unknown:
        raise InputError(f"{path.name}: needs {', '.join(unknown)}, which is not read; export it without")
    return document, binary


def _split_glb(path, data):
    if len(data) < 20:
        raise InputError(f"{path.name}: ends within its header after {len(data)} bytes; copy it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise InputError(f"{path.name}: is binary glTF version {version}, 2 was expected; export it again")
    if len(data) < length:
        raise InputError(f"{path.name}: is cut off, {len(data)} bytes of {length}; copy it again")
    text, binary, at = None, None, 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > length:
            raise InputError(f"{path.name}: a chunk runs past the end of the file; export it again")
        chunk = data[at + 8 : at + 8 + size]
        if kind == b"JSON" and text is None:
            text = chunk
        elif kind == b"BIN\0" and binary is None:
            binary = chunk
        at += 8 + size
    if text is None:
        raise InputError(f"{path.name}: holds no JSON chunk; export it again")
    return text, binary


class _Reader:
    """One document being read: buffers are fetched once, primitives gathered in the order of the nodes."""

    def __init__(self, path, document, binary):
        self.path, self.document, self.binary = path, document, binary
        self.buffers = {}
        self.vertices, self.faces, self.uv, self.colors, self.face_material = [], [], [], [], []

    def read(self):
        for mesh, matrix in self._placed_meshes():
            for primitive in self.document["meshes"][mesh]["primitives"]:
                self._add(primitive, matrix)
        if not self.faces:
            return RawMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64), unit_mm=MM_PER_METRE)
        faces = np.concatenate(self.faces)
        textured = any(uv is not None for uv in self.uv)
        uv = self._stacked(self.uv, 2) if textured else None
        colors = self._stacked(self.colors, 3, missing=1.0) if any(c is not None for c in self.colors) else None
        materials = tuple(self._material(index) for index in range(len(self.document.get("materials", []))))
        return RawMesh(
            np.concatenate(self.vertices),
            faces,
            uv,
            faces if textured else None,
            np.concatenate(self.face_material),
            materials,
            colors,
            MM_PER_METRE,
        )

    def _stacked(self, blocks, width, missing=0.0):
        filled = [
            np.full((len(vertices), width), missing) if block is None else block
            for block, vertices in zip(blocks, self.vertices)
        ]
        return np.concatenate(filled)

    def _placed_meshes(self):
        """(mesh index, (4, 4)) of every node that carries a mesh, in the scene's order."""
        nodes = self.document.get("nodes", [])
        scenes = self.document.get("scenes", [])
        if scenes:
            roots = scenes[self.document.get("scene", 0)].get("nodes", [])
        else:
            roots = sorted(set(range(len(nodes))) - {child for node in nodes for child in node.get("children", [])})
        waiting = [(root, np.eye(4)) for root in reversed(roots)]
        visited = set()
        while waiting:
            index, above = waiting.pop()
            if index in visited:
                raise ValueError(f"node {index} hangs from two parents")
            visited.add(index)
            matrix = above @ _node_matrix(nodes[index])
            if "mesh" in nodes[index]:
                yield nodes[index]["mesh"], matrix
            waiting += [(child, matrix) for child in reversed(nodes[index].get("children", []))]

    def _add(self, primitive, matrix):
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in (_TRIANGLES, _STRIP, _FAN):
            return  # points and lines
        attributes, indices = self._attributes(primitive)
        positions = attributes["POSITION"]
        faces = _as_triangles(indices if indices is not None else np.arange(len(positions)), mode)
        if len(faces) and (faces.min() < 0 or faces.max() >= len(positions)):
            raise ValueError(f"face index {int(faces.max())} of {len(positions)} vertices")
        if np.linalg.det(matrix[:3, :3]) < 0:
            faces = faces[:, ::-1]  # the specification turns the winding with a mirroring node
        material = primitive.get("material", -1)
        offset = sum(len(block) for block in self.vertices)
        self.vertices.append(positions @ matrix[:3, :3].T + matrix[:3, 3])
        self.faces.append(faces + offset)
        self.face_material.append(np.full(len(faces), material, dtype=np.int64))
        self.uv.append(self._uv(attributes, material))
        color = attributes.get("COLOR_0")
        # COLOR_0 is linear by specification; Scan.colors are sRGB.
        self.colors.append(None if color is None else linear_to_srgb(np.clip(color[:, :3], 0.0, 1.0)))

    def _uv(self, attributes, material):
        """(n, 2) v up, of the set that the material's base colour uses, or None."""
        texture = self._base_texture(material) or {}
        transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
        uv = attributes.get(f"TEXCOORD_{transform.get('texCoord', texture.get('texCoord', 0))}")
        if uv is None:
            return None
        uv = uv[:, :2]
        if transform:
            angle = transform.get("rotation", 0.0)
            rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            uv = (uv * transform.get("scale", [1.0, 1.0])) @ rotation.T + transform.get("offset", [0.0, 0.0])
        return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)

    def _attributes(self, primitive):
        """name -> (n, c) float arrays, and indices (or None)."""
        draco = primitive.get("extensions", {}).get("KHR_draco_mesh_compression")
        if draco is not None:
            return self._draco(primitive, draco)
        attributes = {name: self._accessor(index) for name, index in primitive["attributes"].items()}
        indices = primitive.get("indices")
        return attributes, None if indices is None else self._accessor(indices, raw=True)[:, 0]

    def _draco(self, primitive, extension):
        try:
            import DracoPy
        except ImportError:
            raise InputError(
                f"{self.path.name}: is compressed with Draco; pip install DracoPy, or export it without"
            ) from None
        try:
            mesh = DracoPy.decode(self._view(extension["bufferView"]))
        except Exception as error:  # DracoPy raises types of its own
            raise InputError(f"{self.path.name}: its Draco data cannot be decoded ({error}); export it again") from None
        attributes = {}
        for name, number in extension["attributes"].items():
            if name == "POSITION" or name.startswith(("TEXCOORD", "COLOR")):
                accessor = self.document["accessors"][primitive["attributes"][name]]
                values = np.asarray(mesh.get_attribute_by_unique_id(number)["data"])
                attributes[name] = _normalized(values, accessor)
        positions = attributes["POSITION"]
        accessor = self.document["accessors"][primitive["attributes"]["POSITION"]]
        # Some decoders give zeros and no word: hold what comes out against the bounds that the file states.
        span = np.ptp(positions, axis=0) if len(positions) else np.zeros(3)
        stated = np.subtract(accessor["max"], accessor["min"]) if "max" in accessor and "min" in accessor else span
        if np.abs(span - stated).max() > 0.02 * max(np.abs(stated).max(), 1e-30):
            raise InputError(f"{self.path.name}: its Draco data does not fill the bounds it states; export it again")
        return attributes, np.asarray(mesh.faces, dtype=np.int64).ravel()

    def _accessor(self, index, raw=False):
        """(n, c) values of an accessor: floats, normalised as the file says; raw: int64."""
        accessor = self.document["accessors"][index]
        width, count = _WIDTHS[accessor["type"]], accessor["count"]
        if "bufferView" in accessor:
            values = self._strided(
                accessor["bufferView"], accessor.get("byteOffset", 0), accessor["componentType"], count, width
            )
        else:
            values = np.zeros((count, width), _COMPONENTS[accessor["componentType"]])
        if "sparse" in accessor:
            values = self._with_sparse(values, accessor["sparse"], accessor["componentType"], width)
        return values.astype(np.int64) if raw else _normalized(values, accessor)

    def _with_sparse(self, values, sparse, component, width):
        where, what = sparse["indices"], sparse["values"]
        rows = self._strided(
            where["bufferView"], where.get("byteOffset", 0), where["componentType"], sparse["count"], 1
        )
        new = self._strided(what["bufferView"], what.get("byteOffset", 0), component, sparse["count"], width)
        values = values.copy()
        values[rows[:, 0].astype(np.int64)] = new
        return values

    def _strided(self, view, offset, component, count, width):
        """(count, width) array over a buffer view."""
        stride = self.document["bufferViews"][view].get("byteStride")
        kind = np.dtype("<" + _COMPONENTS[component])
        stride = stride or kind.itemsize * width
        data = self._view(view)
        need = offset + stride * (count - 1) + kind.itemsize * width if count else offset
        if need > len(data) or offset < 0 or count < 0:
            raise InputError(
                f"{self.path.name}: an accessor needs {need} bytes of a view of {len(data)}; copy or export it again"
            )
        return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))

    def _view(self, index):
        """The bytes of a buffer view."""
        view = self.document["bufferViews"][index]
        start = view.get("byteOffset", 0)
        data = self._buffer(view["buffer"])
        stop = start + view["byteLength"]
        if start < 0 or stop > len(data):
            raise InputError(
                f"{self.path.name}: a buffer view ends at byte {stop} of a buffer of {len(data)}; export it again"
            )
        return data[start:stop]

    def _buffer(self, index):
        if index not in self.buffers:
            uri = self.document["buffers"][index].get("uri")
            if uri is None and self.binary is None:
                raise InputError(f"{self.path.name}: its binary part is missing; copy it again")
            self.buffers[index] = self.binary if uri is None else self._fetch(uri)
        return self.buffers[index]

    def _fetch(self, uri):
        """Bytes of a data URI or of a file in the document's folder."""
        if uri.startswith("data:"):
            head, _, payload = uri.partition(",")
            try:
                return base64.b64decode(payload) if head.endswith(";base64") else urllib.parse.unquote_to_bytes(payload)
            except binascii.Error:
                raise InputError(f"{self.path.name}: holds a damaged data URI; export it again") from None
        return path_beside(self.path, self._local(uri)).read_bytes()

    def _local(self, uri):
        if "://" in uri:
            raise InputError(
                f"{self.path.name}: names {uri[:60]!r}, and nothing is fetched from the network; save it here"
            )
        return urllib.parse.unquote(uri)

    def _base_texture(self, material):
        """The textureInfo of a material's base colour (or of what stands for it), or None."""
        if material < 0:
            return None
        description = self.document["materials"][material]
        glossy = description.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness", {})
        return (
            description.get("pbrMetallicRoughness", {}).get("baseColorTexture")
            or glossy.get("diffuseTexture")
            or description.get("emissiveTexture")
        )

    def _material(self, index):
        description = self.document["materials"][index]
        name = description.get("name", f"material {index}")
        return RawMaterial(name, self._image(self._base_texture(index)), self._image(description.get("normalTexture")))

    def _image(self, texture_info):
        if texture_info is None:
            return None
        texture = self.document["textures"][texture_info["index"]]
        source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
        if source is None:
            return None
        image = self.document["images"][source]
        label = f"image {image.get('name', source)} in {self.path.name}"
        if "bufferView" in image:
            return ImageSource(label, data=self._view(image["bufferView"]))
        if image["uri"].startswith("data:"):
            return ImageSource(label, data=self._fetch(image["uri"]))
        return ImageSource(self._local(image["uri"]), beside=self.path)


def _node_matrix(node):
    """(4, 4) of a node: its matrix (column-major in the file) or translation * rotation * scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), dtype=np.float64)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", [1, 1, 1]), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def _as_triangles(indices, mode):
    """(m, 3) of a triangle list, strip or fan."""
    if mode == _TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3).astype(np.int64)
    step = np.arange(max(len(indices) - 2, 0))
    if mode == _FAN:
        return np.stack([np.full(len(step), indices[0]), indices[step + 1], indices[step + 2]], axis=1)
    odd = step % 2
    return np.stack([indices[step], indices[step + 1 + odd], indices[step + 2 - odd]], axis=1)


def _normalized(values, accessor):
    """Float64; integers of a normalized accessor in -1..1 or 0..1."""
    floats = values.astype(np.float64)
    if not accessor.get("normalized") or values.dtype.kind == "f":
        return floats
    return np.maximum(floats / np.iinfo(values.dtype).max, -1.0)
