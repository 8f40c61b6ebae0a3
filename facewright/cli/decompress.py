"""Make the texture of a blend of expressions from a packed set.

facewright decompress packed/ --weights smile=0.7,browDown=1 --out frame.png
"""

from __future__ import annotations

import io
import math
from pathlib import Path

from facewright.errors import InputError

HELP = "the texture of a blend from a packed set"


def add_arguments(parser):
    """Arguments of `facewright decompress`."""
    parser.add_argument("packed", metavar="FOLDER", help="a folder that `facewright compress` wrote")
    parser.add_argument("--weights", required=True, metavar="NAME=W,...", help="for example smile=0.7,browDown=1")
    parser.add_argument("--map", metavar="NAME", help="which map of a set with several (default: the first)")
    parser.add_argument("--out", required=True, metavar="PNG", help="the image to write")


def run(options):
    """Decode and write."""
    from PIL import Image

    from facewright.compress import facezip_decode
    from facewright.compress.folder import read_packed
    from facewright.write.files import replace_file

    if Path(options.out).suffix.lower() != ".png":
        raise InputError(f"decompress: --out {options.out}: a PNG is written; give a name that ends in .png")
    image = facezip_decode(read_packed(options.packed, options.map), parse_weights(options.weights))
    stream = io.BytesIO()
    Image.fromarray(image[:, :, 0] if image.shape[2] == 1 else image).save(stream, "PNG")
    replace_file(options.out, stream.getvalue())
    print(f"{options.out}: {image.shape[1]} x {image.shape[0]} pixels")


def parse_weights(text):
    """dict name -> weight of "a=1,b=0.5"; a comma that no "=number" precedes belongs to a name."""
    weights, item = {}, ""
    for part in text.split(","):
        if not item and not part.strip():
            continue
        item += part
        name, equals, value = item.rpartition("=")
        try:
            weight = float(value) if equals else None
        except ValueError:
            weight = None
        if weight is None:
            item += ","
        else:
            if name.strip() in weights:
                raise InputError(f"decompress: --weights names {name.strip()} twice; give every expression one weight")
            weights[name.strip()], item = weight, ""
    if item or not all(map(math.isfinite, weights.values())):
        raise InputError(
            f"decompress: --weights {text!r} is no list of NAME=WEIGHT; write for example smile=0.7,browDown=1"
        )
    return weights
