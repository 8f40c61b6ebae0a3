"""How files appear: whole or not at all, and only inside the folder they belong to."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np
from PIL import Image

from facewright.errors import InputError


def replace_file(path, content):
    """Write bytes so that the file appears whole or not at all; makes its folder. InputError when it cannot."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            temporary.write_bytes(content)
            os.replace(temporary, path)
        except OSError:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InputError(f"write: cannot write {path}: {error.strerror}; choose a folder you may write to") from error


def file_name(name):
    """A name of the rig (a mesh, a map, a target) as a file name: whatever it holds, it cannot leave its folder."""
    safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in str(name)).lstrip(".")
    return safe or "unnamed"


def png_bytes(pixels, level=3):
    """A uint8 image (h, w), (h, w, 1), (h, w, 3) or (h, w, 4) as PNG; a low level is quick rather than small."""
    if pixels.dtype != np.uint8:
        raise ValueError(f"maps are uint8, got {pixels.dtype}")
    stream = io.BytesIO()
    Image.fromarray(np.squeeze(pixels)).save(stream, "PNG", compress_level=level)
    return stream.getvalue()


class PngOnce:
    """png_bytes that encodes an image once, however many files hold it."""

    def __init__(self):
        self._known = {}

    def __call__(self, pixels, level=3):
        key = id(pixels), level
        if key not in self._known:
            self._known[key] = pixels, png_bytes(pixels, level)  # kept, or its id might become another's
        return self._known[key][1]
