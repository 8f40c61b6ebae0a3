"""Wavefront OBJ with its material library (MTL).

Built for speed on big scans: lines are sorted by their first word, numbers are parsed by numpy in blocks. 500,000
triangles with UVs take about two seconds.
"""

from __future__ import annotations

import re
import warnings

import numpy as np

from facewright.errors import InputError
from facewright.read.raw import (
    ImageSource,
    RawMaterial,
    RawMesh,
    colors_to_unit,
    images_beside,
    path_beside,
    triangulate,
)

# Faces parsed at a time: bounds the memory that the byte-wise look at their text takes.
FACES_PER_BLOCK = 200_000


def read_obj(path):
    """RawMesh of an OBJ file: all objects and groups in one."""
    data = path.read_bytes()
    lines = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()
    keywords = [line.split(None, 1)[0] if line.strip() else b"" for line in lines]
    kinds = np.array(keywords, dtype="S8")
    rows_v = np.flatnonzero(kinds == b"v")
    rows_vt = np.flatnonzero(kinds == b"vt")
    rows_f = np.flatnonzero((kinds == b"f") | (kinds == b"fo"))
    values, widths = _numbers(path, lines, rows_v)
    vertices, colors = _split_vertices(path, values, widths, rows_v)
    uv = _texture_coordinates(path, lines, rows_vt)
    if not len(rows_f):
        return RawMesh(vertices, np.zeros((0, 3), np.int64))
    counts, corner_v, corner_vt = _corners(path, lines, rows_f)
    corner_v = _absolute(corner_v, counts, rows_f, rows_v)
    corner_vt = _absolute(corner_vt, counts, rows_f, rows_vt)
    triangles, polygon = triangulate(counts)
    faces = corner_v[triangles]
    uv_faces = corner_vt[triangles] if len(uv) and (corner_vt >= 0).any() else None
    materials, face_material, notes = _materials(path, lines, kinds, rows_f)
    return RawMesh(
        vertices,
        faces,
        uv if uv_faces is not None else None,
        uv_faces,
        face_material[polygon],
        materials,
        colors,
        notes=tuple(notes),
    )


def _numbers(path, lines, rows):
    """All numbers of the given lines after their keyword, flat, and how many each line holds."""
    texts = [lines[row].split(b"#", 1)[0].split() for row in rows.tolist()]
    widths = np.array([len(words) - 1 for words in texts], dtype=np.int64)
    flat = [word for words in texts for word in words[1:]]
    try:
        return np.array(flat, dtype="S").astype(np.float64) if flat else np.zeros(0), widths
    except ValueError:
        pass
    for row, words in zip(rows.tolist(), texts):
        for word in words[1:]:
            try:
                float(word)
            except ValueError:
                text = word.decode("latin-1")
                raise InputError(f"{path.name}, line {row + 1}: {text!r} is not a number; export it again") from None
    raise InputError(f"{path.name}: holds numbers that cannot be read; export it again")


def _split_vertices(path, values, widths, rows):
    """Positions (n, 3), and colours (n, 3) where every vertex line has six or more numbers."""
    short = np.flatnonzero(widths < 3)
    if len(short):
        raise InputError(
            f"{path.name}, line {rows[short[0]] + 1}: a vertex has {widths[short[0]]} numbers, not 3; export it again"
        )
    starts = np.cumsum(widths) - widths
    vertices = values[starts[:, None] + np.arange(3)]
    if not len(widths) or widths.min() < 6:
        return vertices, None
    return vertices, colors_to_unit(values[starts[:, None] + np.arange(3, 6)])


def _texture_coordinates(path, lines, rows):
    """(t, 2); a coordinate with one number has v = 0."""
    values, widths = _numbers(path, lines, rows)
    if len(widths) and widths.min() < 1:
        row = rows[int(np.argmin(widths))] + 1
        raise InputError(f"{path.name}, line {row}: a texture coordinate has no numbers; export it again")
    starts = np.cumsum(widths) - widths
    u = values[starts]
    v = np.where(widths > 1, values[np.minimum(starts + 1, max(len(values) - 1, 0))], 0.0) if len(widths) else u
    return np.stack([u, v], axis=1)


def _corners(path, lines, rows):
    """Corner counts per face, and 1-based (or negative, relative) indices per corner; 0 stands for no uv."""
    counts, corner_v, corner_vt = [], [], []
    for start in range(0, len(rows), FACES_PER_BLOCK):
        block = rows[start : start + FACES_PER_BLOCK].tolist()
        payloads = [lines[row].split(b"#", 1)[0].split(None, 1) for row in block]
        payloads = [words[1] if len(words) > 1 else b"" for words in payloads]
        counts.append(np.array([len(payload.split()) for payload in payloads], dtype=np.int64))
        try:
            v, vt = _parse_corners(b" ".join(payloads))
        except ValueError:
            raise InputError(_first_bad_face(path, lines, block)) from None
        corner_v.append(v)
        corner_vt.append(vt)
    return np.concatenate(counts), np.concatenate(corner_v), np.concatenate(corner_vt)


def _parse_corners(text):
    """Words v, v/vt, v//vn, v/vt/vn, mixed at will -> (k,) v and (k,) vt. Raises ValueError on anything else."""
    letters = np.frombuffer(text, dtype=np.uint8)
    slash = letters == ord("/")
    gap = (letters == ord(" ")) | (letters == ord("\t"))
    begins = ~gap & np.concatenate([[True], gap[:-1]])
    apart = gap | slash
    number_at = np.flatnonzero(~apart & np.concatenate([[True], apart[:-1]]))
    word_at = np.flatnonzero(begins)
    word = np.cumsum(begins, dtype=np.int32)[number_at] - 1
    slashes = np.cumsum(slash, dtype=np.int32)
    place = slashes[number_at] - slashes[word_at[word]]  # a word begins with a number, so none is counted before it
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy only warns where it stops early
        try:
            numbers = np.fromstring(text.replace(b"/", b" "), dtype=np.int64, sep=" ")
        except DeprecationWarning as error:
            raise ValueError(str(error)) from None
    if len(numbers) != len(number_at) or (place > 2).any() or (letters[word_at] == ord("/")).any():
        raise ValueError("unreadable face")
    vt = np.zeros(len(word_at), np.int64)
    vt[word[place == 1]] = numbers[place == 1]
    return numbers[place == 0], vt


def _first_bad_face(path, lines, block):
    for row in block:
        words = lines[row].split(b"#", 1)[0].split()[1:]
        try:
            for word in words:
                _parse_corners(word)
        except ValueError:
            text = lines[row].decode("latin-1")[:60]
            return f"{path.name}, line {row + 1}: {text!r} is not a face; export it again"
    return f"{path.name}: holds faces that cannot be read; export it again"


def _absolute(indices, counts, rows_f, rows_points):
    """0-based indices; -1 where there was none (0). Negative ones count back from the face's own line."""
    if (indices >= 0).all():
        return indices - 1
    before = np.repeat(np.searchsorted(rows_points, rows_f), counts)
    # An index that reaches back past the first point must not turn into "none": make it invalid.
    back = before + indices
    back = np.where(back < 0, np.iinfo(np.int64).max // 2, back)
    return np.where(indices < 0, back, indices - 1)


def _materials(path, lines, kinds, rows_f):
    """Materials in use, (p,) material of each face line, notes."""
    rows_use = np.flatnonzero(kinds == b"usemtl")
    names = [_argument(lines[row]) for row in rows_use]
    order = sorted(set(names))
    library, notes = {}, []
    for row in np.flatnonzero(kinds == b"mtllib"):
        found, note = _read_library(path, _argument(lines[row]))
        library.update(found)
        notes += [note] if note else []
    if not names and len(library) == 1:  # a library of one material that no face names: meant for all
        return tuple(library.values()), np.zeros(len(rows_f), np.int64), notes
    number = np.array([order.index(name) for name in names] + [-1], dtype=np.int64)
    at = np.searchsorted(rows_use, rows_f) - 1  # -1: before the first usemtl, the last entry
    materials = tuple(library.get(name, RawMaterial(name)) for name in order)
    return materials, number[at], notes


def _argument(line):
    words = line.decode("utf-8", "replace").split(None, 1)
    return words[1].strip() if len(words) > 1 else ""


def _read_library(path, name):
    """dict of RawMaterial by name, and a note if the library cannot be found."""
    try:
        file = path_beside(path, name)
    except InputError:
        return {}, (
            f"the material library {name!r} of {path.name} is missing; read without its textures, "
            f"which --albedo gives{images_beside(path)}"
        )
    materials, current = {}, ""
    for line in file.read_bytes().decode("utf-8", "replace").splitlines():
        words = line.split(None, 1)
        if len(words) < 2:
            continue
        keyword, argument = words[0].lower(), words[1].strip()
        if keyword == "newmtl":
            current = argument
            materials[current] = {}
        elif current and keyword == "map_kd":
            materials[current]["albedo"] = argument
        elif current and keyword in ("norm", "map_kn"):
            materials[current]["normal"] = argument
    return {key: RawMaterial(key, **_sources(path, maps)) for key, maps in materials.items()}, None


def _sources(path, maps):
    return {role: ImageSource(texture_file(argument), beside=path) for role, argument in maps.items()}


# Options of a texture line and how many words follow each (at most).
_TEXTURE_OPTIONS = {"-bm": 1, "-boost": 1, "-imfchan": 1, "-texres": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3}
_TEXTURE_OPTIONS |= {"-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1}
_OPTION_WORD = re.compile(r"on|off|[rgbmlz]|[-+]?[0-9.]+(e[-+]?[0-9]+)?", re.IGNORECASE)


def texture_file(argument):
    """The file name of a texture line, behind its options; the name may hold blanks."""
    words = argument.split(" ")
    while len(words) > 1 and words[0].lower() in _TEXTURE_OPTIONS:
        limit = _TEXTURE_OPTIONS[words.pop(0).lower()]
        while limit and len(words) > 1 and _OPTION_WORD.fullmatch(words[0]):
            words.pop(0)
            limit -= 1
    return " ".join(words)
