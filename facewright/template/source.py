"""The raw material of a template: a folder of OBJ files in one topology, and the description (TOML) of how to use it.

A light reader for this one purpose: the neutral is parsed whole, of every other file only the `v` lines are read.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facewright.errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


@dataclass(frozen=True)
class ObjMesh:
    """vertices (n, 3) file units, uv (t, 2), polygons and uv_polygons (p, 4) with -1 for the missing fourth corner."""

    vertices: np.ndarray
    uv: np.ndarray
    polygons: np.ndarray
    uv_polygons: np.ndarray


def read_description(path):
    """The parsed description file of a template; docs/template.md lists its keys."""
    path = Path(path)
    try:
        description = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"template description: {path} cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"template description: {path} is not valid TOML: {error}") from error
    missing = [key for key in ("info", "source", "parts", "shapes") if key not in description]
    if missing:
        raise InputError(f"template description: {path} lacks [{missing[0]}]; docs/template.md lists the keys")
    return description


def read_source_mesh(path):
    """The ObjMesh of an OBJ file whose faces have three or four corners with texture coordinates."""
    vertices, uv, polygons, uv_polygons = [], [], [], []
    for number, line in enumerate(_lines(path), start=1):
        if line.startswith(b"v "):
            vertices.append(line[2:])
        elif line.startswith(b"vt "):
            uv.append(line[3:])
        elif line.startswith(b"f "):
            corners = [corner.split(b"/") for corner in line.split()[1:]]
            if len(corners) not in (3, 4) or any(len(corner) < 2 or not corner[1] for corner in corners):
                raise InputError(
                    f"template source: {path} line {number}: a face needs 3 or 4 corners with texture coordinates"
                )
            pad = [-1] * (4 - len(corners))
            polygons.append([int(corner[0]) - 1 for corner in corners] + pad)
            uv_polygons.append([int(corner[1]) - 1 for corner in corners] + pad)
    mesh = ObjMesh(
        _numbers(vertices, 3, path), _numbers(uv, 2, path), np.array(polygons, int), np.array(uv_polygons, int)
    )
    if not len(polygons) or mesh.polygons.max() >= len(mesh.vertices) or mesh.uv_polygons.max() >= len(mesh.uv):
        raise InputError(f"template source: {path} has no faces or faces with indices out of range")
    return mesh


def read_source_vertices(path, n):
    """(n, 3) vertex positions of an OBJ file in file units; InputError if there are more or fewer."""
    vertices = _numbers([line[2:] for line in _lines(path) if line.startswith(b"v ")], 3, path)
    if len(vertices) != n:
        raise InputError(f"template source: {path} has {len(vertices)} vertices, the neutral {n}; it is another mesh")
    return vertices


def _lines(path):
    try:
        return Path(path).read_bytes().splitlines()
    except OSError as error:
        raise InputError(f"template source: {path} cannot be read: {error.strerror}") from error


def _numbers(rows, columns, path):
    """(k, columns) float64 of rows of text; further columns (vertex colours, w) are dropped."""
    if not rows:
        raise InputError(f"template source: {path} has no vertices or no texture coordinates")
    try:
        width = len(rows[0].split())
        values = np.array(b" ".join(rows).split(), dtype=np.float64).reshape(len(rows), width)[:, :columns]
    except ValueError as error:
        raise InputError(f"template source: {path} holds a vertex line that is not {columns} numbers") from error
    if not np.isfinite(values).all():
        raise InputError(f"template source: {path} holds a vertex that is not finite")
    return values
