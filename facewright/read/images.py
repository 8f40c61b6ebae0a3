"""Images as uint8 RGB arrays, by Pillow."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
from PIL import Image

from facewright.errors import InputError
from facewright.read.raw import path_beside

# A side of 16,384 pixels is the largest that graphics cards take; more is a mistake or a decompression bomb.
MAX_PIXELS = 16384 * 16384


def read_image(path):
    """(h, w, 3) uint8 of an image file, as stored: alpha dropped, no colour profile applied."""
    return decode_image(_content(Path(path)), Path(path).name)


def check_image(path):
    """InputError where a file cannot be an image of use; told from its head, without decoding it."""
    _opened(_content(Path(path)), Path(path).name, lambda image, label: None)


def read_named_image(source):
    """(h, w, 3) uint8 of an ImageSource."""
    if source.data is not None:
        return decode_image(source.data, source.label)
    return read_image(path_beside(source.beside, source.label))


def decode_image(data, label):
    """(h, w, 3) uint8 of an image file's bytes; label names it in messages."""
    return _opened(data, label, _as_rgb)


def _content(path):
    if path.is_dir():
        raise InputError(f"{path}: is a folder, an image was expected; give a PNG or JPEG file")
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: this image does not exist; check the name") from None
    except OSError as error:
        raise InputError(f"{path}: this image cannot be read ({error.strerror}); check its permissions") from None


def _opened(data, label, use):
    """use(image, label) of an image file's bytes opened by Pillow."""
    limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data))
            width, height = image.size
            if width * height > MAX_PIXELS:
                raise InputError(
                    f"{label}: the image has {width} x {height} pixels, more than 16384 x 16384; shrink it"
                )
            return use(image, label)
    except (OSError, SyntaxError, ValueError, EOFError, MemoryError) as error:
        raise InputError(
            f"{label}: the image cannot be decoded ({_short(error)}); save it again as PNG or JPEG"
        ) from None
    finally:
        Image.MAX_IMAGE_PIXELS = limit


def _as_rgb(image, label):
    if image.mode in ("I", "I;16", "I;16B", "I;16L", "I;16N"):
        grey = np.asarray(image).astype(np.int64) >> 8
        return np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
    if image.mode == "F":
        raise InputError(f"{label}: holds floating-point pixels; save it as an 8-bit PNG")
    if image.mode != "RGB":
        # Through RGBA, or a palette's transparent entries would come out in the wrong colour.
        image = image.convert("RGBA").convert("RGB") if image.mode == "P" else image.convert("RGB")
    return np.array(image)


def _short(error):
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    return text if "BytesIO" not in text else "unknown format"
