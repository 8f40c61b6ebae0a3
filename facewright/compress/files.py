"""Reading what a user has: folders of textures, meshes with UVs, masks, tables of example weights."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
from PIL import Image

from facewright.errors import InputError
from facewright.read.images import MAX_PIXELS, decode_image
from facewright.read.obj import read_obj

SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".tga", ".webp"}


def read_texture(path):
    """(h, w, C) as stored: uint8 with 1, 3 or 4 channels, or uint16 with one; InputError where that would lose bits."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: this image cannot be read ({error.strerror}); check the name") from None
    pixels = None
    limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height <= MAX_PIXELS:
                pixels = _as_stored(image, data, path)
    except (OSError, SyntaxError, ValueError, EOFError):
        pass  # decode_image says what is wrong
    finally:
        Image.MAX_IMAGE_PIXELS = limit
    return decode_image(data, path.name) if pixels is None else pixels


def _as_stored(image, data, path):
    """(h, w, C) of an opened image, None where it is to be read as RGB; InputError where that would lose bits."""
    if image.format == "PNG":
        deep = data[24] == 16 and data[25] != 0  # bit depth and colour type, 0 for grey, of the first chunk
    else:
        bits = getattr(image, "tag_v2", {}).get(258, (8,))  # BitsPerSample of a TIFF
        deep = len(bits) > 1 and max(bits) > 8
    if image.mode in ("LA", "PA") or (image.mode == "P" and "transparency" in image.info):
        image = image.convert("RGBA")
    pixels = np.array(image) if image.mode in ("L", "RGBA", "I;16", "I;16B", "I") else None
    if deep or (pixels is not None and (pixels.min() < 0 or pixels.max() > 65535)):
        raise InputError(f"{path}: more than 8 bits of colour or 16 of grey; save it as 8 bits RGB or 16 bits grey")
    if pixels is None:
        return None
    depth = np.uint8 if pixels.dtype == np.uint8 else np.uint16
    return pixels.astype(depth, copy=False).reshape(image.height, image.width, -1)


def list_textures(folder, neutral):
    """Paths of the images in a folder by name, without the neutral; names are the file names without suffix."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder; give the folder that holds the expression textures")
    neutral = Path(neutral).resolve()
    try:
        files = sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); check its permissions") from None
    # "._smile.png" is what macOS notes about smile.png on other systems' disks.
    paths = [
        p for p in files if p.suffix.lower() in SUFFIXES and not p.name.startswith("._") and p.resolve() != neutral
    ]
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
    if not len(mesh.faces):
        raise InputError(f"{path.name}: holds no faces; give an OBJ mesh with UVs")
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
    """Shape names (M) and B (N, M) of a CSV: a header with the shapes, then a row for each texture, its name first; and
    the names of rows that belong to no texture."""
    try:
        rows = [row for row in csv.reader(Path(path).read_text(encoding="utf-8-sig").splitlines()) if any(row)]
        shapes = [name.strip() for name in rows[0][1:]]
        table = [(row[0].strip(), [float(value) for value in row[1:]]) for row in rows[1:]]
    except (OSError, ValueError, IndexError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a table of weights ({error}); see docs/compress.md") from None
    if not shapes or not all(shapes) or len(set(shapes)) < len(shapes):
        raise InputError(f"{path}: the first line must name the shapes, each once, after a first cell for the textures")
    weights = dict(table)
    for name in names:
        rows = sum(row == name for row, _ in table)
        if rows != 1:
            raise InputError(f"{path}: has {rows or 'no'} rows for {name}; every texture of the set needs one")
        if len(weights[name]) != len(shapes):
            raise InputError(
                f"{path}: shapes in the first line: {len(shapes)}, weights for {name}: {len(weights[name])}"
            )
    B = np.array([weights[name] for name in names])
    if not np.isfinite(B).all():
        raise InputError(f"{path}: holds a weight that is no finite number")
    return shapes, B, [name for name in weights if name not in names]
