"""Texture sets from folders, packed sets to and from a folder of PNG and one JSON that names every channel."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
from PIL import Image

from facewright.compress.packed import Packed
from facewright.compress.runtime import GLSL, HLSL
from facewright.errors import InputError
from facewright.read.images import MAX_PIXELS, decode_image
from facewright.read.obj import read_obj
from facewright.write.files import file_name

FORMAT = "facezip-1"
SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".tga", ".webp"}


def read_texture(path):
    """(h, w, C) as stored: uint8 with 1, 3 or 4 channels, or uint16 with one."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: this image cannot be read ({error.strerror}); check the name") from None
    try:
        with Image.open(io.BytesIO(data)) as image:
            mode, (width, height) = image.mode, image.size
            if width * height <= MAX_PIXELS and mode in ("L", "RGBA", "I;16", "I;16B", "I"):
                pixels = np.array(image)
                if pixels.dtype != np.uint8:
                    pixels = np.clip(pixels, 0, 65535).astype(np.uint16)
                return pixels.reshape(height, width, -1)
    except (OSError, SyntaxError, ValueError, EOFError, Image.DecompressionBombError):
        pass  # decode_image says what is wrong
    return decode_image(data, path.name)


def list_textures(folder, neutral):
    """Paths of the images in a folder by name, without the neutral; names are the file names without suffix."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder; give the folder that holds the expression textures")
    neutral = Path(neutral).resolve()
    paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and p.resolve() != neutral)
    if not paths:
        raise InputError(f"{folder}: holds no images; PNG, JPEG, TIFF, BMP, TGA and WebP are read")
    names = [path.stem for path in paths]
    if len(set(names)) < len(names):
        raise InputError(f"{folder}: two images have the same name without suffix; rename one")
    return paths


def read_uv_mesh(path):
    """The OBJ mesh at path, checked: it has UVs inside the image."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: this mesh does not exist; give an OBJ file with UVs")
    mesh = read_obj(path)
    if mesh.uv is None or mesh.uv_faces is None or (mesh.uv_faces < 0).any():
        raise InputError(f"{path.name}: faces without UVs; export the mesh with texture coordinates")
    bad = (mesh.faces < 0).any() or (mesh.faces >= len(mesh.vertices)).any() or (mesh.uv_faces >= len(mesh.uv)).any()
    if bad or not np.isfinite(mesh.vertices).all():
        raise InputError(f"{path.name}: faces name points that do not exist or are not finite; export it again")
    used = mesh.uv[np.unique(mesh.uv_faces)]
    if not np.isfinite(used).all() or used.min() < -1e-4 or used.max() > 1 + 1e-4:
        raise InputError(
            f"{path.name}: UVs reach from {used.min():.3f} to {used.max():.3f}, beyond the image (0 to 1); "
            "lay them out in one tile"
        )
    return mesh


def read_mask(path, shape):
    """(h, w) float 0-1 of a grey image that must have the textures' size."""
    mask = read_texture(path)
    if mask.shape[:2] != shape:
        raise InputError(f"{path}: the mask has {mask.shape[1]} x {mask.shape[0]} pixels, not {shape[1]} x {shape[0]}")
    return mask[:, :, 0].astype(np.float32) / np.iinfo(mask.dtype).max


def read_examples(path, names):
    """Shape names (M) and B (N, M) of a CSV: a header with the shapes, then a row for each texture, its name first."""
    try:
        rows = [row for row in csv.reader(Path(path).read_text(encoding="utf-8-sig").splitlines()) if row]
        table = {row[0].strip(): [float(value) for value in row[1:]] for row in rows[1:]}
        shapes = [name.strip() for name in rows[0][1:]]
    except (OSError, ValueError, IndexError) as error:
        raise InputError(f"{path}: cannot be read as a table of weights ({error}); see docs/compress.md") from None
    missing = [name for name in names if name not in table]
    if missing or any(len(table[name]) != len(shapes) for name in names):
        raise InputError(
            f"{path}: needs a row of {len(shapes)} weights for every texture; look at {missing[:1] or names[0]}"
        )
    return shapes, np.array([table[name] for name in names])


def write_packed(packed, folder):
    """Write a Packed into an existing folder: neutral, differences, weights (PNG), facezip.json, shaders."""
    folder = Path(folder)
    k = len(packed.textures)
    files = {"neutral.png": packed.neutral, **{f"difference{i}.png": packed.textures[i] for i in range(k)}}
    layer_files = []
    for layer, codes in enumerate(packed.weights):
        first = packed.names[int(np.flatnonzero(packed.layers == layer)[0])]
        names = []
        for start in range(0, k, 4):
            name = f"weights/{layer:03d}_{file_name(first)}" + (f"_{start // 4}" if k > 4 else "") + ".png"
            padded = np.zeros((*codes.shape[:2], 4), np.uint8)
            padded[:, :, : min(4, k - start)] = codes[:, :, start : start + 4]
            files[name] = padded
            names.append(name)
        layer_files.append(names)
    try:
        (folder / "weights").mkdir(exist_ok=True)
        for name, pixels in files.items():
            Image.fromarray(np.squeeze(pixels, 2) if pixels.shape[2] == 1 else pixels).save(
                folder / name, "PNG", compress_level=1
            )
        (folder / "facezip.glsl").write_text(GLSL, encoding="utf-8")
        (folder / "facezip.hlsl").write_text(HLSL, encoding="utf-8")
        (folder / "facezip.json").write_text(json.dumps(describe(packed, layer_files), indent=1), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot write ({error.strerror}); free space or choose another --out") from error


def describe(packed, layer_files):
    """facezip.json as a dict."""
    rows, columns = packed.weights.shape[1:3]
    height, width, channels = packed.neutral.shape
    return {
        "format": FORMAT,
        "size": [width, height],
        "channels": "RGBA"[:channels] if channels > 1 else "R",
        "bits": packed.neutral.dtype.itemsize * 8,
        "colour_space": "values as in the input images; blended as stored, not linearised",
        "meaning": "a code q stands for (q - zero) * step; differences in 0-255 units",
        "neutral": "neutral.png",
        "differences": [
            {"file": f"difference{i}.png", "step": list(step), "zero": list(zero)}
            for i, (step, zero) in enumerate(zip(packed.texture_step.tolist(), packed.texture_zero.tolist()))
        ],
        "weight_size": [columns, rows],
        "weight_uv_scale": [width / (8 * columns), height / (8 * rows)],
        "weights": [
            {"files": names, "step": step, "zero": zero}
            for names, step, zero in zip(layer_files, packed.weight_step.tolist(), packed.weight_zero.tolist())
        ],
        "expressions": {name: int(layer) for name, layer in zip(packed.names, packed.layers)},
        "memory_bytes": packed.memory_bytes(),
        "report": packed.report,
    }


def read_packed(folder):
    """The Packed that write_packed wrote; reads no file outside the folder."""
    folder = Path(folder)
    try:
        about = json.loads((folder / "facezip.json").read_text(encoding="utf-8"))
        if about["format"] != FORMAT:
            raise InputError(f"{folder}: facezip.json has format {about['format']!r}, expected {FORMAT!r}")
        k = len(about["differences"])
        neutral = read_texture(_inside(folder, about["neutral"]))
        textures = np.stack([read_texture(_inside(folder, d["file"])) for d in about["differences"]])
        weights = [
            np.concatenate([read_texture(_inside(folder, f)) for f in w["files"]], axis=2)[:, :, :k]
            for w in about["weights"]
        ]
        return Packed(
            neutral=neutral,
            textures=textures,
            texture_step=np.array([d["step"] for d in about["differences"]]),
            texture_zero=np.array([d["zero"] for d in about["differences"]]),
            weights=np.stack(weights),
            weight_step=np.array([w["step"] for w in about["weights"]]),
            weight_zero=np.array([w["zero"] for w in about["weights"]]),
            names=tuple(about["expressions"]),
            layers=np.array(list(about["expressions"].values())),
            report=about["report"],
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{folder}: is no packed set ({error}); give a folder that `facewright compress` wrote"
        ) from None


def _inside(folder, name):
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise InputError(f"{folder}: facezip.json names {name!r}, which lies outside the folder")
    return path
