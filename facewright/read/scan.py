"""read_scan: a file of any format becomes a Scan in the file's own coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facewright.conventions import MM_PER_UNIT
from facewright.data import Scan
from facewright.errors import InputError
from facewright.read.gltf import read_gltf
from facewright.read.images import read_image, read_named_image
from facewright.read.obj import read_obj
from facewright.read.ply import read_ply

READERS = {".obj": read_obj, ".ply": read_ply, ".glb": read_gltf, ".gltf": read_gltf}


def read_scan(path, *, albedo=None, normal_map=None, unit=None):
    """Read a head scan. Nothing is moved, scaled or repaired: T_ours_to_scan is the identity.

    path        .obj, .ply, .glb or .gltf; images that it names are read from its own folder only
    albedo      path of an image that takes the place of all textures the file names
    normal_map  path of a tangent-space normal map (+Y) in the same UVs
    unit        "mm", "cm", "dm", "m", "inch" or millimetres per unit; default: what the format says, else None
    raises      InputError, one sentence, for whatever cannot be used
    """
    path = Path(path)
    unit_mm = unit_in_mm(unit)
    check_scan_file(path)
    raw = READERS[path.suffix.lower()](path)
    _check_mesh(path, raw)
    uv, uv_faces, without_uv = _checked_uv(path, raw)
    if albedo is not None and uv is None:
        raise InputError(
            f"{path.name}: has no texture coordinates, so {albedo} cannot be put on it; export it with UVs"
        )
    if albedo is not None:
        textures, face_texture = (read_image(albedo),), np.zeros(len(raw.faces), np.int64)
    else:
        textures, face_texture = _named_textures(raw, uv is not None)
    if face_texture is not None:
        face_texture = np.where(without_uv, -1, face_texture)
    notes = list(raw.notes)
    if normal_map is not None:
        normals = read_image(normal_map)
    else:
        normals = _named_normal_map(raw, uv is not None, notes)
    return Scan(
        raw.vertices,
        raw.faces,
        uv,
        uv_faces,
        textures,
        face_texture,
        raw.colors,
        normals,
        unit_mm=unit_mm if unit_mm is not None else raw.unit_mm,
        name=path.stem,
        notes=tuple(notes),
    )


def unit_in_mm(unit):
    """Millimetres per unit of a name from MM_PER_UNIT or of a positive number; None stays None."""
    if unit is None:
        return None
    if unit in MM_PER_UNIT:
        return MM_PER_UNIT[unit]
    try:
        value = float(unit)
    except (TypeError, ValueError):
        value = -1.0
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"unknown unit {unit!r}; give one of {', '.join(MM_PER_UNIT)} or millimetres per unit")
    return value


def check_scan_file(path):
    """InputError where a file cannot be a scan: it is not there, empty, or of a format that is not known."""
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: this file does not exist; check the name")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give the scan file in it")
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
    if empty:
        raise InputError(f"{path.name}: is empty; copy or export it again")
    if path.suffix.lower() not in READERS:
        raise InputError(f"{path.name}: unknown format {path.suffix!r}; give one of {', '.join(sorted(READERS))}")


def _check_mesh(path, raw):
    if not len(raw.faces):
        what = "has points but no faces" if len(raw.vertices) else "has no faces"
        raise InputError(f"{path.name}: {what}; export it as a triangle mesh")
    bad = ~np.isfinite(raw.vertices).all(axis=1)
    if bad.any():
        raise InputError(
            f"{path.name}: vertex {int(np.flatnonzero(bad)[0]) + 1} is not a finite point "
            f"({int(bad.sum())} of {len(bad)} are not); repair or export it again"
        )
    outside = (raw.faces < 0) | (raw.faces >= len(raw.vertices))
    if outside.any():
        triangle = int(np.flatnonzero(outside.any(axis=1))[0]) + 1
        raise InputError(
            f"{path.name}: triangle {triangle} names a vertex beyond the {len(raw.vertices)}; export it again"
        )


def _checked_uv(path, raw):
    """uv, uv_faces (faces without any point at a coordinate of their own) and (m,) bool of those faces."""
    without = np.zeros(len(raw.faces), bool)
    if raw.uv is None:
        return None, None, ~without
    if not np.isfinite(raw.uv).all():
        raise InputError(f"{path.name}: holds texture coordinates that are not finite; repair or export it again")
    if (raw.uv_faces >= len(raw.uv)).any():
        raise InputError(
            f"{path.name}: a face names a texture coordinate that is not among the {len(raw.uv)}; export it again"
        )
    without = (raw.uv_faces < 0).any(axis=1)
    if not without.any():
        return raw.uv, raw.uv_faces, without
    uv = np.concatenate([raw.uv, np.zeros((1, 2))])
    return uv, np.where(without[:, None], len(raw.uv), raw.uv_faces), without


def _used_materials(raw):
    if raw.face_material is None:
        return []
    return [raw.materials[index] for index in np.unique(raw.face_material) if index >= 0]


def _named_textures(raw, has_uv):
    """Images that the materials in use name, each once, and (m,) which one a face wears; (), None without any."""
    sources = list(dict.fromkeys(material.albedo for material in _used_materials(raw) if material.albedo))
    if not sources or not has_uv:
        return (), None
    number = [sources.index(material.albedo) if material.albedo in sources else -1 for material in raw.materials]
    return tuple(read_named_image(source) for source in sources), np.array([*number, -1])[raw.face_material]


def _named_normal_map(raw, has_uv, notes):
    """The normal map of the file's only textured material; several would need one each, which a Scan has not."""
    sources = list(dict.fromkeys(material.normal for material in _used_materials(raw) if material.normal))
    if not sources or not has_uv:
        return None
    if len(sources) > 1 or len(_used_materials(raw)) > 1:
        notes.append("the file names normal maps for several materials; they are not used")
        return None
    return read_named_image(sources[0])
