"""Stanford PLY: ASCII and binary of either byte order; vertex colours, UVs per vertex or per corner."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from facewright.errors import InputError
from facewright.read.raw import ImageSource, RawMaterial, RawMesh, triangulate

_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
_TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))


@dataclass(frozen=True)
class _Property:
    """A scalar, or a list when count_type is given."""

    name: str
    type: str
    count_type: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


@dataclass(frozen=True)
class _List:
    """A list property of all rows: counts (r,), and the values one after another."""

    counts: np.ndarray
    values: np.ndarray


def read_ply(path):
    """RawMesh of a PLY file."""
    data = path.read_bytes()
    layout, elements, textures, body = _read_header(path, data)
    read = _read_ascii if layout == "ascii" else _read_binary
    tables = read(path, data[body:], elements, ">" if layout == "binary_big_endian" else "<")
    vertex = tables.get("vertex", {})
    if not {"x", "y", "z"} <= set(vertex):
        raise InputError(f"{path.name}: has no vertices with x, y and z; export it again as a mesh")
    vertices = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    colors = _colors(vertex, elements)
    face = tables.get("face", {})
    corners = face.get("vertex_indices", face.get("vertex_index"))
    if corners is None or not len(corners.counts):
        if "tristrips" in tables:
            raise InputError(f"{path.name}: holds triangle strips, which are not read; export it as plain triangles")
        return RawMesh(vertices, np.zeros((0, 3), np.int64), colors=colors)
    triangles, polygon = triangulate(corners.counts)
    faces = corners.values.astype(np.int64)[triangles]
    uv, uv_faces = _texture_coordinates(path, vertex, face, corners, triangles, faces)
    materials = tuple(RawMaterial(name, ImageSource(name, beside=path)) for name in textures)
    face_material = None
    if materials:
        number = np.asarray(face.get("texnumber", np.zeros(len(corners.counts))), dtype=np.int64)
        face_material = np.where((number >= 0) & (number < len(materials)), number, -1)[polygon]
    return RawMesh(vertices, faces, uv, uv_faces, face_material, materials, colors)


def _read_header(path, data):
    """layout, elements, texture names, and where the body begins."""
    end = re.search(rb"end_header[ \t]*(\r\n|\n|\r)", data[: 1 << 20])
    if not data.startswith(b"ply") or end is None:
        raise InputError(f"{path.name}: is not a PLY file or ends within its header; export it again")
    layout, elements, textures = None, [], []
    for line in data[: end.start()].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("obj_info",):
                continue
            if words[0] == "format":
                layout = words[1]
            elif words[0] == "comment":
                if len(words) > 2 and words[1].lower() == "texturefile":
                    textures.append(line.split(None, 2)[2].strip())
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2]), ()))
            elif words[0] == "property":
                prop = _Property(words[4], _TYPES[words[3]], _TYPES[words[2]]) if words[1] == "list" else None
                prop = prop or _Property(words[2], _TYPES[words[1]])
                last = elements.pop()
                elements.append(_Element(last.name, last.count, (*last.properties, prop)))
        except (IndexError, KeyError, ValueError):
            raise InputError(
                f"{path.name}: its header holds {line.strip()!r}, which is no PLY; export it again"
            ) from None
    if layout not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise InputError(f"{path.name}: its header names the unknown format {layout!r}; export it again")
    return layout, elements, textures, end.end()


def _truncated(path, element):
    return InputError(f"{path.name}: ends before its {element.count} {element.name} rows do; copy or export it again")


def _read_ascii(path, body, elements, _order):
    words = body.split()
    try:
        numbers = np.array(words, dtype="S").astype(np.float64) if words else np.zeros(0)
    except ValueError:
        raise InputError(f"{path.name}: holds words where numbers should be; export it again") from None
    tables, at = {}, 0
    for element in elements:
        columns = [[] for _ in element.properties]
        lists = [prop for prop in element.properties if prop.count_type]
        if not lists:
            width = len(element.properties)
            block = numbers[at : at + width * element.count]
            if len(block) < width * element.count:
                raise _truncated(path, element)
            columns = list(block.reshape(-1, width).T) if width else []
            at += width * element.count
        elif (table := _uniform_rows(numbers, at, element)) is not None:
            columns, at = table
        else:
            columns, at = _ragged_rows(path, numbers, at, element)
        tables[element.name] = {prop.name: column for prop, column in zip(element.properties, columns)}
    return tables


def _uniform_rows(numbers, at, element):
    """Columns and the place behind them if every row's lists are as long as the first row's; else None."""
    width, slots = 0, []
    for prop in element.properties:
        if at + width >= len(numbers):
            return None
        count = int(numbers[at + width]) if prop.count_type else None
        slots.append((width, count))
        width += 1 + count if prop.count_type else 1
    stop = at + width * element.count
    if stop > len(numbers):
        return None
    rows = numbers[at:stop].reshape(element.count, width)
    columns = []
    for start, count in slots:
        if count is None:
            columns.append(rows[:, start])
        elif (rows[:, start] != count).any():
            return None
        else:
            columns.append(_List(np.full(len(rows), count), rows[:, start + 1 : start + 1 + count].ravel()))
    return columns, stop


def _ragged_rows(path, numbers, at, element):
    """Row by row, for files that mix triangles and polygons."""
    counts = [[] for _ in element.properties]
    pieces = [[] for _ in element.properties]
    for _ in range(element.count):
        for prop, lengths, values in zip(element.properties, counts, pieces):
            length = 1
            if prop.count_type:
                if at >= len(numbers) or numbers[at] < 0:
                    raise _truncated(path, element)
                length, at = int(numbers[at]), at + 1
            if at + length > len(numbers):
                raise _truncated(path, element)
            lengths.append(length)
            values.append(numbers[at : at + length])
            at += length
    columns = []
    for prop, lengths, values in zip(element.properties, counts, pieces):
        joined = np.concatenate(values) if values else np.zeros(0)
        columns.append(_List(np.array(lengths), joined) if prop.count_type else joined)
    return columns, at


def _read_binary(path, body, elements, order):
    tables, at = {}, 0
    for element in elements:
        if not element.properties or not element.count:
            tables[element.name] = {}
            continue
        table = _uniform_records(body, at, element, order)
        columns, at = table if table is not None else _ragged_records(path, body, at, element, order)
        tables[element.name] = {prop.name: column for prop, column in zip(element.properties, columns)}
    return tables


def _uniform_records(body, at, element, order):
    """As _uniform_rows, of binary records read at one go."""
    fields, place = [], at
    for index, prop in enumerate(element.properties):
        if prop.count_type:
            size = np.dtype(prop.count_type).itemsize
            if place + size > len(body):
                return None
            count = int(np.frombuffer(body, order + prop.count_type, 1, place)[0])
            if count < 0 or place + count > len(body):
                return None
            fields += [(f"n{index}", order + prop.count_type), (f"p{index}", order + prop.type, (count,))]
            place += size + count * np.dtype(prop.type).itemsize
        else:
            fields.append((f"p{index}", order + prop.type))
            place += np.dtype(prop.type).itemsize
    record = np.dtype(fields)
    stop = at + record.itemsize * element.count
    if stop > len(body):
        return None
    rows = np.frombuffer(body, record, element.count, at)
    columns = []
    for index, prop in enumerate(element.properties):
        values = rows[f"p{index}"]
        if prop.count_type is None:
            columns.append(values.astype(np.float64))
        elif (rows[f"n{index}"] != values.shape[1]).any():
            return None
        else:
            columns.append(_List(np.full(len(rows), values.shape[1]), values.astype(np.float64).ravel()))
    return columns, stop


def _ragged_records(path, body, at, element, order):
    counts = [[] for _ in element.properties]
    pieces = [[] for _ in element.properties]
    plan = [
        (np.dtype(order + prop.type), np.dtype(order + prop.count_type) if prop.count_type else None)
        for prop in element.properties
    ]
    for _ in range(element.count):
        for (kind, count_kind), lengths, values in zip(plan, counts, pieces):
            length = 1
            if count_kind is not None:
                if at + count_kind.itemsize > len(body):
                    raise _truncated(path, element)
                length = int(np.frombuffer(body, count_kind, 1, at)[0])
                at += count_kind.itemsize
            stop = at + length * kind.itemsize
            if length < 0 or stop > len(body):
                raise _truncated(path, element)
            lengths.append(length)
            values.append(body[at:stop])
            at = stop
    columns = []
    for (kind, count_kind), lengths, values in zip(plan, counts, pieces):
        joined = np.frombuffer(b"".join(values), kind).astype(np.float64)
        columns.append(_List(np.array(lengths), joined) if count_kind is not None else joined)
    return columns, at


def _colors(vertex, elements):
    """(n, 3) 0..1; integers count to the top of their type."""
    for names in (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b")):
        if set(names) <= set(vertex):
            properties = next(element for element in elements if element.name == "vertex").properties
            kind = next(prop.type for prop in properties if prop.name == names[0])
            top = float(np.iinfo(kind).max) if kind[0] in "iu" else 1.0
            return np.clip(np.stack([vertex[name] for name in names], axis=1) / top, 0.0, 1.0)
    return None


def _texture_coordinates(path, vertex, face, corners, triangles, faces):
    """uv and uv_faces: per corner from the faces' texcoord lists, else per vertex, else None, None."""
    listed = face.get("texcoord", face.get("texcoords"))
    if listed is not None and len(listed.values):
        if (listed.counts != 2 * corners.counts).any():
            raise InputError(f"{path.name}: has texture coordinates that do not match its corners; export it again")
        uv, inverse = np.unique(listed.values.reshape(-1, 2), axis=0, return_inverse=True)
        return uv, inverse.reshape(-1)[triangles]
    for names in _UV_NAMES:
        if set(names) <= set(vertex):
            return np.stack([vertex[name] for name in names], axis=1), faces
    return None, None
