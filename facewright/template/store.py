"""Templates on disk: a folder with template.toml (what a person reads) and arrays.npz (what a program reads).

Format 1, described in docs/template.md. Arrays are compact: deltas are int16 with one scale per shape (at most
0.0012 mm off for a shape of 45 mm), identity modes likewise, optionally on a coarser control mesh with the sparse
operator that expands them. No pickles. Same template, same bytes.
"""

from __future__ import annotations

import hashlib
import io
import os
import sys
import zipfile
import zlib
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import tomli_w

from facewright.data import Landmarks, Part, Skeleton, Template
from facewright.errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

FORMAT = 1
DESCRIPTION = "template.toml"
ARRAYS = "arrays.npz"
SHIPPED = Path(__file__).resolve().parents[1] / "templates"


def user_folder():
    """Where fetched templates live: $FACEWRIGHT_HOME/templates, by default ~/.facewright/templates."""
    home = os.environ.get("FACEWRIGHT_HOME")
    return (Path(home) if home else Path.home() / ".facewright") / "templates"


def list_templates():
    """name -> folder of every template that read_template knows by name: the shipped ones and the user's."""
    found = {}
    for root in (user_folder(), SHIPPED):
        if root.is_dir():
            found.update({path.parent.name: path.parent for path in sorted(root.glob(f"*/{DESCRIPTION}"))})
    return dict(sorted(found.items()))


def find_template(name_or_folder):
    """The folder of a template given by name or by folder; InputError with the known names if there is none."""
    folder = Path(name_or_folder)
    if (folder / DESCRIPTION).is_file():
        return folder
    known = list_templates()
    if str(name_or_folder) in known:
        return known[str(name_or_folder)]
    names = ", ".join(known) or "none"
    if folder.is_dir():
        raise InputError(
            f"template: {folder} holds no {DESCRIPTION}; build one with 'facewright template build', known: {names}"
        )
    raise InputError(
        f"template: {str(name_or_folder)!r} is neither a folder nor a known template ({names}); "
        "'facewright template list' shows them"
    )


def read_info(name_or_folder):
    """The description of a template (the parsed template.toml) without its arrays."""
    path = find_template(name_or_folder) / DESCRIPTION
    try:
        description = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"template: {path} is not valid TOML: {error}") from error
    except OSError as error:
        raise InputError(f"template: {path} cannot be read: {error.strerror}") from error
    if description.get("format") != FORMAT:
        raise InputError(
            f"template: {path} has format {description.get('format')!r}, this version reads format {FORMAT}"
        )
    return description


def read_template(name_or_folder):
    """The Template in a folder, or a known one by name ("hm08"). Raises InputError for anything broken or missing."""
    folder = find_template(name_or_folder)
    description = read_info(folder)
    path = folder / ARRAYS
    if not path.is_file():
        raise InputError(f"template: {folder} has a {DESCRIPTION} but no {ARRAYS}; build the template again")
    try:
        with np.load(path, allow_pickle=False) as arrays:
            template = _unpack(description, {name: arrays[name] for name in arrays.files})
    except KeyError as error:
        raise InputError(f"template: {folder} lacks {error}; build the template again") from error
    except (ValueError, IndexError, TypeError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"template: {folder} cannot be read: {error}; build the template again") from error
    expected = template.info.get("topology_id")
    if topology_id(template) != expected:
        raise InputError(
            f"template: faces, UVs or mirror map in {folder} are not those of topology_id {expected!r}; "
            "a changed head is a new template: build it under another name"
        )
    return template


def write_template(template, folder, *, control=None):
    """Write a Template into a folder (made if needed) that read_template reads.

    control  None, or dict(operator=csr (n, c), identity=(i, c, 3), optional deltas=(s, c, 3)): identity modes (and
             deltas) of a coarse control mesh; then these are stored, and reading gives operator @ control
    raises   ValueError if operator @ control is more than 0.01 mm from the template's own (0.002 mm for deltas)
    """
    folder = Path(folder)
    arrays = _pack(template, control)
    description = _describe(template)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _replace(folder / ARRAYS, npz_bytes(arrays))
        _replace(folder / DESCRIPTION, tomli_w.dumps(description).encode("utf-8"))
    except OSError as error:
        raise InputError(f"template: cannot write to {folder}: {error.strerror}") from error


def topology_id(template):
    """Name of a topology: template name and 12 hex digits of a hash over polygons, UVs (float32) and mirror map."""
    digest = hashlib.sha256()
    for array, dtype in (
        (template.faces, "<i4"),
        (template.polygons, "<i4"),
        (template.uv, "<f4"),
        (template.uv_polygons, "<i4"),
        (template.mirror, "<i4"),
    ):
        digest.update(np.ascontiguousarray(array, dtype=dtype).tobytes())
    return f"{template.info.get('name', 'template')}-{digest.hexdigest()[:12]}"


def npz_bytes(arrays, level=7):
    """The bytes of an .npz of a dict of arrays: compressed (zlib level), sorted by name, no time stamps or pickles."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(arrays):
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # else the operating system's, and bytes differ between platforms
            content = io.BytesIO()
            np.lib.format.write_array(content, np.asarray(arrays[name]), version=(1, 0), allow_pickle=False)
            archive.writestr(entry, content.getvalue(), compresslevel=level)
    return buffer.getvalue()


def _replace(path, content):
    """Write a file so that it appears whole or not at all."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_bytes(content)
    os.replace(temporary, path)


def _quantize(fields):
    """(k, n, 3) float -> int16 (k, n, 3) and (k,) float64 scales; fields = int * scale."""
    peak = np.abs(fields).reshape(len(fields), -1).max(axis=1, initial=0.0)
    scale = np.where(peak > 0, peak, 1.0) / 32767.0
    return np.round(fields / scale[:, None, None]).astype(np.int16), scale


def _dequantize(integers, scale):
    """The inverse of _quantize."""
    return integers * np.asarray(scale, np.float64)[:, None, None]


def _pack(template, control):
    """Arrays of a template as they are stored."""
    packed = {
        "vertices": template.vertices,
        "faces": template.faces.astype(np.int32),
        "polygons": template.polygons.astype(np.int32),
        "uv": template.uv.astype(np.float32),
        "uv_faces": template.uv_faces.astype(np.int32),
        "uv_polygons": template.uv_polygons.astype(np.int32),
        "mirror": template.mirror.astype(np.int32),
        "region_bits": np.packbits(_stack(list(template.regions.values()), len(template.vertices)), axis=1),
        "line_vertices": np.concatenate([np.empty(0, int), *template.lines.values()]).astype(np.int32),
        "landmark_names": np.array(template.landmarks.names, dtype="U16"),
        "landmark_faces": template.landmarks.faces.astype(np.int32),
        "landmark_barycentric": template.landmarks.barycentric,
        "landmark_weights": template.landmarks.weights.astype(np.float32),
        "openness": np.round(template.openness * 65535).astype(np.uint16),
        "skin_weights": template.skin_weights.astype(np.float32),
    }
    packed.update(_pack_fields(template.identity_basis, "identity", control, 0.01))
    packed.update(_pack_fields(template.deltas, "deltas", control, 0.002))
    if control is not None:
        operator = sp.csr_matrix(control["operator"])
        operator.sort_indices()
        packed["operator_data"] = operator.data.astype(np.float64)
        packed["operator_indices"] = operator.indices.astype(np.int32)
        packed["operator_indptr"] = operator.indptr.astype(np.int32)
        packed["operator_shape"] = np.array(operator.shape, dtype=np.int32)
    return packed


def _pack_fields(fields, name, control, tolerance):
    """Stored arrays of identity modes or deltas (k, n, 3), on the control mesh where control has them."""
    prefix = ""
    if control is not None and control.get(name) is not None:
        operator = sp.csr_matrix(control["operator"])
        values = np.asarray(control[name], np.float64)
        error = max((np.abs(operator @ v - f).max() for v, f in zip(values, fields)), default=0.0)
        if len(values) != len(fields) or error > tolerance:
            raise ValueError(
                f"write_template: {len(values)} control fields {name!r} differ by {error:.3g} mm from {len(fields)}"
            )
        fields, prefix = values, "control_"
    integers, scale = _quantize(np.asarray(fields))
    return {f"{prefix}{name}": integers, f"{prefix}{name}_scale": scale}


def _unpack_fields(arrays, name):
    """(k, n, 3) float64, read-only, of stored identity modes or deltas."""
    if f"control_{name}" in arrays:
        parts = (arrays["operator_data"], arrays["operator_indices"], arrays["operator_indptr"])
        operator = sp.csr_matrix(parts, shape=tuple(arrays["operator_shape"]))
        coarse = _dequantize(arrays[f"control_{name}"], arrays[f"control_{name}_scale"])
        k, c = coarse.shape[:2]
        wide = coarse.transpose(1, 0, 2).reshape(c, 3 * k)
        fields = np.ascontiguousarray((operator @ wide).reshape(-1, k, 3).transpose(1, 0, 2))
    else:
        fields = _dequantize(arrays[name], arrays[f"{name}_scale"])
    fields.flags.writeable = False  # the Template keeps it without a copy
    return fields


def _stack(masks, n):
    return np.array(masks, dtype=bool).reshape(len(masks), n)


def _describe(template):
    """The content of template.toml."""
    return {
        "format": FORMAT,
        "info": {**_plain(template.info), "topology_id": topology_id(template)},
        "counts": {
            "vertices": len(template.vertices),
            "faces": len(template.faces),
            "identity_modes": len(template.identity_basis),
            "landmarks": len(template.landmarks.names),
        },
        "shapes": list(template.shape_names),
        "regions": list(template.regions),
        "lines": [{"name": name, "count": len(line)} for name, line in template.lines.items()],
        "skeleton": {"names": list(template.skeleton.names), "parents": [int(p) for p in template.skeleton.parents]}
        | {"positions": np.asarray(template.skeleton.positions).round(6).tolist()},
        "parts": [
            {
                "name": part.name,
                "vertices": [int(i) for i in part.vertices],
                "faces": [int(i) for i in part.faces],
                "material": part.material,
                "attach": part.attach,
            }
            for part in template.parts
        ],
        "materials": {name: _plain(material) for name, material in template.materials.items()},
    }


def _plain(value):
    """Numpy numbers and tuples as TOML knows them; TOML has no null, so None is left out."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def _unpack(description, arrays):
    """The Template of a parsed template.toml and its stored arrays."""
    n = len(arrays["vertices"])
    bits = np.unpackbits(arrays["region_bits"], axis=1, count=n).astype(bool)
    counts = [line["count"] for line in description["lines"]]
    pieces = np.split(arrays["line_vertices"].astype(np.int64), np.cumsum(counts)[:-1]) if counts else []
    barycentric = arrays["landmark_barycentric"].astype(np.float64)
    weights = arrays["skin_weights"].astype(np.float64)
    skeleton = description["skeleton"]
    return Template(
        vertices=arrays["vertices"],
        faces=arrays["faces"],
        polygons=arrays["polygons"],
        uv=arrays["uv"],
        uv_faces=arrays["uv_faces"],
        uv_polygons=arrays["uv_polygons"],
        mirror=arrays["mirror"],
        parts=tuple(
            Part(p["name"], tuple(p["vertices"]), tuple(p["faces"]), p["material"], p["attach"])
            for p in description["parts"]
        ),
        regions=dict(zip(description["regions"], bits, strict=True)),
        lines={line["name"]: piece for line, piece in zip(description["lines"], pieces, strict=True)},
        landmarks=Landmarks(
            tuple(str(name) for name in arrays["landmark_names"]),
            arrays["landmark_faces"],
            barycentric,
            arrays["landmark_weights"],
        ),
        shape_names=tuple(description["shapes"]),
        deltas=_unpack_fields(arrays, "deltas"),
        identity_basis=_unpack_fields(arrays, "identity"),
        openness=arrays["openness"] / 65535.0,
        skeleton=Skeleton(tuple(skeleton["names"]), tuple(skeleton["parents"]), np.array(skeleton["positions"])),
        skin_weights=weights / weights.sum(axis=1, keepdims=True),
        materials={name: _tuples(material) for name, material in description["materials"].items()},
        info=description["info"],
    )


def _tuples(material):
    return {key: tuple(value) if isinstance(value, list) else value for key, value in material.items()}
