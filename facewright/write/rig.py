"""A Rig on disk without loss: a folder with rig.json (what a person reads), arrays.npz and maps/*.png.

Format 1, described in docs/rig-format.md. Arrays keep their float64 bits. No pickles, no time stamps: same rig, same
bytes. rig.json is written last and names the checksum of arrays.npz, so a half-written folder is never taken for a rig.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from dataclasses import asdict
from pathlib import Path

import numpy as np
from PIL import Image

from facewright.data import Material, Mesh, Rig, Skeleton
from facewright.errors import InputError
from facewright.template.store import npz_bytes
from facewright.write.files import file_name, png_bytes, replace_file

FORMAT = 1
DESCRIPTION = "rig.json"
ARRAYS = "arrays.npz"
_MESH_ARRAYS = ("vertices", "faces", "polygons", "uv", "uv_faces", "uv_polygons", "skin_weights", "deltas")


def write_rig(rig, folder, png=png_bytes):
    """Write a Rig into a folder (made if needed) that read_rig reads back bit for bit.

    png  how maps are encoded (files.PngOnce)
    """
    folder = Path(folder)
    maps = {}
    for name, pixels in rig.maps.items():
        maps[name] = {"file": f"maps/{file_name(name)}.png", "shape": list(pixels.shape)}
        replace_file(folder / maps[name]["file"], png(pixels))
    arrays = npz_bytes(_pack(rig), level=1)
    replace_file(folder / ARRAYS, arrays)
    description = _describe(rig) | {"maps": maps, "arrays_sha256": hashlib.sha256(arrays).hexdigest()}
    text = json.dumps(description, indent=1, ensure_ascii=False, default=_plain) + "\n"
    replace_file(folder / DESCRIPTION, text.encode("utf-8"))


def read_rig(folder):
    """The Rig in a folder. Raises InputError for anything missing, broken or of another format."""
    folder = Path(folder)
    try:
        description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
        if description.get("format") != FORMAT:
            raise InputError(
                f"rig: {folder / DESCRIPTION} has format {description.get('format')!r}, this version reads {FORMAT}"
            )
        content = (folder / ARRAYS).read_bytes()
        if hashlib.sha256(content).hexdigest() != description["arrays_sha256"]:
            raise InputError(f"rig: {folder / ARRAYS} is not the one that {DESCRIPTION} describes; write the rig again")
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return _unpack(description, {name: arrays[name] for name in arrays.files}, folder)
    except FileNotFoundError as error:
        raise InputError(f"rig: {folder} is not a rig folder: {Path(error.filename).name} is missing") from error
    except (ValueError, KeyError, TypeError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"rig: {folder} cannot be read: {error}") from error


def _pack(rig):
    """Arrays of a rig, named <mesh>.<field>, region.<name> (packed bits) and line.<name>."""
    arrays = {"skeleton.positions": rig.skeleton.positions}
    for mesh in rig.meshes:
        for field in _MESH_ARRAYS:
            if getattr(mesh, field) is not None:
                arrays[f"mesh.{mesh.name}.{field}"] = getattr(mesh, field)
    arrays |= {f"region.{name}": np.packbits(mask) for name, mask in rig.regions.items()}
    arrays |= {f"line.{name}": np.asarray(line, np.int64) for name, line in rig.lines.items()}
    return arrays


def _describe(rig):
    """What rig.json says, apart from maps and checksum."""
    return {
        "format": FORMAT,
        "units": "millimetres",
        "axes": "+X the person's left, +Y up, +Z out of the face; origin midway between the eyes; v up",
        "target_names": list(rig.target_names),
        "meshes": [
            {"name": mesh.name, "moves": mesh.deltas is not None, "material": asdict(mesh.material)}
            for mesh in rig.meshes
        ],
        "skeleton": {"names": list(rig.skeleton.names), "parents": list(rig.skeleton.parents)},
        "regions": list(rig.regions),
        "lines": list(rig.lines),
        "in_betweens": {name: list(map(list, steps.items())) for name, steps in rig.in_betweens.items()},
        "correctives": {name: list(drivers) for name, drivers in rig.correctives.items()},
        "halves": {name: list(sides) for name, sides in rig.halves.items()},
        "expressions": rig.expressions,
        "visemes": rig.visemes,
        "info": rig.info,
    }


def _plain(value):
    """Numpy values as JSON knows them."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"rig.info holds a {type(value).__name__}, which JSON cannot store")


def _unpack(description, arrays, folder):
    """The Rig of a parsed rig.json, its arrays and the folder with its maps."""
    meshes = []
    for entry in description["meshes"]:
        fields = {name: arrays.get(f"mesh.{entry['name']}.{name}") for name in _MESH_ARRAYS}
        material = entry["material"] | {"color": tuple(entry["material"]["color"])}
        meshes.append(Mesh(name=entry["name"], material=Material(**material), **fields))
    n_skin = len(meshes[0].vertices)
    skeleton = description["skeleton"]
    return Rig(
        meshes=tuple(meshes),
        target_names=tuple(description["target_names"]),
        skeleton=Skeleton(tuple(skeleton["names"]), tuple(skeleton["parents"]), arrays["skeleton.positions"]),
        maps={name: _read_map(folder, entry) for name, entry in description["maps"].items()},
        regions={
            name: np.unpackbits(arrays[f"region.{name}"], count=n_skin).astype(bool) for name in description["regions"]
        },
        lines={name: arrays[f"line.{name}"] for name in description["lines"]},
        info=description["info"],
        in_betweens={name: dict(steps) for name, steps in description["in_betweens"].items()},
        correctives={name: tuple(drivers) for name, drivers in description["correctives"].items()},
        halves={name: tuple(sides) for name, sides in description.get("halves", {}).items()},
        expressions=description.get("expressions", {}),
        visemes=description.get("visemes", {}),
    )


def _read_map(folder, entry):
    """One map; its file lies inside the rig's folder, whatever rig.json says."""
    path = (folder / entry["file"]).resolve()
    if folder.resolve() not in path.parents:
        raise InputError(f"rig: {entry['file']} lies outside the rig's folder")
    with Image.open(path) as image:
        return np.array(image).reshape(entry["shape"])
