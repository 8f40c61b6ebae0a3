"""preview.html: a page that needs nothing else and no network; its WebGL 2 shader is facezip.glsl itself."""

from __future__ import annotations

import base64
import io
import json
from importlib import resources

import numpy as np
from PIL import Image

from facewright.compress.folder import atlas_places, uv_scale, weight_atlas, weight_layers
from facewright.compress.ktx2 import as_rgba
from facewright.compress.packed import place_count
from facewright.compress.runtime import GLSL

# Texels of all originals together; above it they are shown at half the size, and so on.
MOST_TEXELS = 12_000_000
# The weight pass holds a vector for each place of the atlas among its uniforms; WebGL 2 grants 224 vectors.
MOST_PLACES = 200


def preview_missing(packed):
    """Why a Packed cannot be shown, in one sentence, or ""."""
    if len(packed.textures) > 4:
        return f"preview.html is left out: the shader reads 4 difference textures, not {len(packed.textures)}"
    if place_count(len(packed.weights), len(packed.textures)) > MOST_PLACES:
        return f"preview.html is left out: {len(packed.weights)} weight maps are more than a shader's uniforms hold"
    return ""


def preview_page(packed, fetch, count, *, title="FaceZip", examples=None):
    """The page as text.

    fetch     function n -> (h, w, C) original texture, asked for count of them in order
    examples  B (count, M) of example-based shapes (Eq. 9), whose originals are the naive blends of Fig. 8; or None
    """
    height, width = packed.neutral.shape[:2]
    factor = 1
    while (height // factor) * (width // factor) * count > MOST_TEXELS and min(height, width) // factor > 16:
        factor *= 2
    rows, columns = packed.weights.shape[1:3]
    across, down = atlas_places(packed)
    wide = np.iinfo(packed.neutral.dtype).max / 255  # 16 bits are shown in 8
    shares = np.eye(count) if examples is None else np.linalg.pinv(examples)
    channels = packed.neutral.shape[2]
    about = f"{len(packed.names)} expressions, {packed.memory_bytes() / 1e6:.1f} MB in memory uncompressed"
    about += f", shown at 1/{factor} of {width} x {height}" if factor > 1 else f", {width} x {height}"
    data = {
        "title": title,
        "about": about + (", 8 of 16 bits" if wide > 1 else ""),
        "originalName": "Original" if examples is None else "Blend of whole textures",
        "size": [width // factor, height // factor],
        "opaque": channels != 4,
        "names": list(packed.names),
        "rmse": packed.report.get("rmse", {}),
        "first": 0,
        "neutral": _png(packed.neutral, factor),
        "differences": [
            {
                "image": _png(image, factor),
                "step": _four(step * wide, channels, 0.0),
                "zero": _four(zero / wide / 255, channels, 0.0),
            }
            for image, step, zero in zip(packed.textures, packed.texture_step, packed.texture_zero)
        ],
        "atlas": _encode(weight_atlas(packed)),
        "across": across,
        "places": across * down,
        "weightSize": [columns, rows],
        "uvScale": uv_scale(packed),
        "layerOf": packed.layers.tolist(),
        "layers": weight_layers(packed),
        "mix": [[[int(n), float(row[n])] for n in np.flatnonzero(row)] for row in shares],
        "originals": [_png(fetch(n), factor) for n in range(count)],
    }
    page = resources.files("facewright").joinpath("web/facezip.html").read_text(encoding="utf-8")
    # "</" would end the script element that holds the data.
    return page.replace("FACEZIP_DATA", json.dumps(data).replace("</", "<\\/")).replace("FACEZIP_GLSL", GLSL)


def _four(values, channels, rest):
    """Values of the channels as the four of a shader; grey counts for red, green and blue."""
    values = np.repeat(values, 3) if channels == 1 else values
    return [*map(float, values), *[rest] * (4 - len(values))]


def _png(image, factor):
    """Base64 PNG of an image, 8 bits a channel, factor times smaller."""
    image = image if image.ndim == 3 else image[:, :, None]
    h, w, c = image.shape
    h, w = h // factor, w // factor
    if factor > 1:
        blocks = image[: h * factor, : w * factor].reshape(h, factor, w, factor, c)
        image = np.rint(blocks.mean(axis=(1, 3), dtype=np.float32)).astype(image.dtype)
    if image.dtype == np.uint16:
        image = np.rint(image / 257.0).astype(np.uint8)
    return _encode(image if c != 2 else as_rgba(image))


def _encode(image):
    stream = io.BytesIO()
    Image.fromarray(np.squeeze(image, 2) if image.shape[2] == 1 else image).save(stream, "PNG", compress_level=6)
    return base64.b64encode(stream.getvalue()).decode()
