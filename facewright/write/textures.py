"""Maps as PNG files with a manifest that says how to read them."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from facewright.write.files import file_name, png_bytes, replace_file

LAYOUT = "the template's skin atlas: u to the right, v up, row 0 of an image is v = 1"
CONVENTIONS = {
    "albedo": {
        "color_space": "sRGB",
        "means": "the scan's colours as they are, light included; filled where coverage is below 255",
    },
    "normal": {
        "color_space": "linear",
        "means": "tangent-space normals, (value - 128) / 127; flat is (128, 128, 255)",
        "green": "+Y (OpenGL, glTF)",
        "tangents": "MikkTSpace on the skin mesh with area-weighted vertex normals",
    },
    "coverage": {
        "color_space": "linear",
        "means": "255 seen by the scan, 128 filled from the other side or the surroundings, "
        "0 inside mouth, sockets and nostrils and outside the charts",
    },
}


def write_textures(maps, folder, manifest=None, png=png_bytes):
    """Write maps, name -> (h, w) or (h, w, c) uint8, as folder/name.png, and folder/manifest.json.

    manifest  dict of further entries for the manifest, such as bake.describe_maps
    png       how maps are encoded (files.PngOnce)
    returns   dict, what manifest.json holds
    raises    InputError when the folder cannot be written
    """
    folder = Path(folder)
    names = sorted(maps)
    with ThreadPoolExecutor(2) as pool:
        for name, content in zip(names, pool.map(png, (maps[name] for name in names))):
            replace_file(folder / f"{file_name(name)}.png", content)
    entries = {name: _entry(name, maps[name]) for name in names}
    document = {"format": 1, "layout": LAYOUT, "maps": entries, **(manifest or {})}
    replace_file(folder / "manifest.json", (json.dumps(document, indent=2) + "\n").encode())
    return document


def _entry(name, image):
    height, width = image.shape[:2]
    channels = image.shape[2] if image.ndim == 3 else 1
    described = CONVENTIONS.get(name, {})
    return {"file": f"{file_name(name)}.png", "width": width, "height": height, "channels": channels, **described}
