"""A packed set as a folder: PNG and KTX2 images, shaders, and facezip.json, which names every channel."""

from __future__ import annotations

import io
import json
import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image

from facewright.compress.files import read_texture
from facewright.compress.ktx2 import encoder_missing, raw_ktx2, texture_ktx2
from facewright.compress.packed import Packed, atlas_shape, place_count, weight_places
from facewright.compress.runtime import GLSL, HLSL
from facewright.compress.threads import in_threads
from facewright.compress.tiles import CELL, FINE_CELL, Grid
from facewright.errors import InputError
from facewright.write.files import file_name

FORMAT = "facezip-2"
INDEX = "facezip.json"
HIDDEN = ".facezip-"
# How hard PNG tries: 1 takes a quarter of the time of 6 and is 12 % larger (five images of 512 x 512).
PNG_LEVEL = 1


def write_packed(packed, folder, ktx2=None, progress=None):
    """Write a Packed, or a dict name -> Packed of several maps, into an existing folder.

    ktx2     "bc7", "astc" or None: block-compressed images beside the PNG
    progress function (stage, share done)
    returns  facezip.json as a dict
    """
    folder = Path(folder)
    maps = packed if isinstance(packed, dict) else {"color": packed}
    about = {"format": FORMAT, **_shared(next(iter(maps.values())))}
    store, first = _Store(folder, ktx2, sum(len(one.textures) + 2 for one in maps.values()), progress), None
    about["maps"] = {}
    for number, (name, one) in enumerate(maps.items()):
        prefix = "" if number == 0 else file_name(name) + "_"
        entry = _write_map(store, one, prefix)
        if first is None:
            first, about["weights"] = one, _write_weights(store, one, "")
        elif one.weights is not first.weights:
            entry["weights"] = _write_weights(store, one, prefix)
        about["maps"][name] = entry
    store.flush()
    about["bytes"] = store.totals()
    store.text("facezip.glsl", GLSL)
    store.text("facezip.hlsl", HLSL)
    store.text(INDEX, json.dumps(about, indent=1))
    return about


def _shared(packed):
    rows, columns = packed.weights.shape[1:3]
    height, width = packed.neutral.shape[:2]
    return {
        "size": [width, height],
        "meaning": "a stored code q stands for (q - zero) * step, in units of 1/255 of full scale for textures",
        "origin": "row 0 is the top of the image; weights are upsampled bilinearly, clamped to the edge",
        "weight_cell": packed.cell,
        "weight_size": [columns, rows],
        "weight_uv_scale": uv_scale(packed),
        "expressions": {name: int(layer) for name, layer in zip(packed.names, packed.layers)},
    }


def _write_map(store, packed, prefix):
    channels = packed.neutral.shape[2]
    return {
        "channels": {1: "R", 2: "RG", 3: "RGB", 4: "RGBA"}[channels],
        "bits": packed.neutral.dtype.itemsize * 8,
        "colour_space": "as the input images; import as linear data, decode sRGB after facezip() where they were sRGB",
        "neutral": store.image(f"{prefix}neutral", packed.neutral),
        "differences": [
            {**store.image(f"{prefix}difference{i}", image), "step": step, "zero": zero}
            for i, (image, step, zero) in enumerate(
                zip(packed.textures, packed.texture_step.tolist(), packed.texture_zero.tolist())
            )
        ],
        "report": packed.report,
    }


def _write_weights(store, packed, prefix):
    atlas = [
        store.image(f"{prefix}weights{start // 4 or ''}", weight_atlas(packed, start), raw=True)
        for start in range(0, len(packed.textures), 4)
    ]
    return {"atlas": atlas, "places": list(atlas_places(packed)), "layers": weight_layers(packed)}


def uv_scale(packed):
    """[x, y]: what uv is multiplied by to read a weight map, whose last cells may reach beyond the image."""
    rows, columns = packed.weights.shape[1:3]
    height, width = packed.neutral.shape[:2]
    return [width / (packed.cell * columns), height / (packed.cell * rows)]


def weight_layers(packed):
    """For each weight map the step, the zero and the [place, channel] in the atlas of every difference texture."""
    keys = ("step", "zero", "at")
    places = weight_places(len(packed.weights), packed.weights.shape[3])
    rows = zip(packed.weight_step.tolist(), packed.weight_zero.tolist(), places.tolist())
    return [dict(zip(keys, row)) for row in rows]


def atlas_places(packed):
    """(across, down) places of the atlas of a Packed."""
    layers, rows, columns, k = packed.weights.shape
    return atlas_shape(place_count(layers, k), rows, columns)


def weight_atlas(packed, start=0):
    """(h, w, 4) uint8: the weight maps of difference textures start to start + 3, all layers in one image."""
    layers, rows, columns, k = packed.weights.shape
    across, down = atlas_places(packed)
    image = np.zeros((down, across, 4, rows, columns), np.uint8)
    for weights, places in zip(packed.weights, weight_places(layers, k)):
        for i in range(start, min(start + 4, k)):
            place, channel = places[i]
            image[place // across, place % across, channel] = weights[:, :, i]
    return np.ascontiguousarray(image.transpose(0, 3, 1, 4, 2)).reshape(down * rows, across * columns, 4)


class _Store:
    """Writes the files of a folder and adds up their bytes."""

    def __init__(self, folder, ktx2, count, progress):
        self.folder, self.ktx2, self.count, self.progress = folder, ktx2, count, progress
        self.done = 0
        self.bytes = {"png": 0, "ktx2": 0, "memory": 0, "memory_ktx2": 0}
        self.waiting = {}

    def image(self, name, pixels, raw=False):
        """Write an image as KTX2, and as PNG with the next flush(); returns the names of the files."""
        self.waiting[f"{name}.png"] = pixels
        self.bytes["memory"] += pixels.nbytes
        if self.ktx2 is None:
            return {"file": f"{name}.png"}
        data, on_card = raw_ktx2(pixels) if raw else texture_ktx2(pixels, self.ktx2)
        write_result(self.folder / f"{name}.ktx2", data)
        self.bytes["ktx2"] += len(data)
        self.bytes["memory_ktx2"] += on_card
        self.done += 1
        if self.progress is not None:
            self.progress("writing KTX2", min(self.done / self.count, 1.0))
        return {"file": f"{name}.png", "ktx2": f"{name}.ktx2", "ktx2_bytes": len(data), "ktx2_memory": on_card}

    def flush(self):
        """Write the PNG files, a few at a time."""
        for name, data in zip(self.waiting, in_threads(_png, self.waiting.values())):
            write_result(self.folder / name, data)
            self.bytes["png"] += len(data)
        self.waiting = {}

    def totals(self):
        """Bytes on disk and on the card; what was not written is left out."""
        return {key: value for key, value in self.bytes.items() if self.ktx2 is not None or "ktx2" not in key}

    def text(self, name, text):
        """Write a text file."""
        write_result(self.folder / name, text.encode())


def _png(pixels):
    stream = io.BytesIO()
    Image.fromarray(np.squeeze(pixels, 2) if pixels.shape[2] == 1 else pixels).save(
        stream, "PNG", compress_level=PNG_LEVEL
    )
    return stream.getvalue()


def write_result(path, data):
    """Write the bytes of a result; the InputError of a disk that takes no more names its place in the end."""
    try:
        path.write_bytes(data)
    except OSError as error:
        raise cannot_write(path, error) from error


def cannot_write(path, error):
    """The InputError of a file or folder that cannot be written, named without the hidden folder it waits in."""
    shown = Path(*(part for part in Path(path).parts if not part.startswith(HIDDEN)))
    return InputError(f"{shown}: cannot write ({error.strerror}); free space or choose another --out")


def png_size(packed):
    """Bytes of the PNG files of a Packed."""
    atlas = [weight_atlas(packed, start) for start in range(0, len(packed.textures), 4)]
    return sum(len(data) for data in in_threads(_png, [packed.neutral, *packed.textures, *atlas]))


def choose_ktx2(kind):
    """The kind ("bc7", "astc", "none") that can be written, or None; and the sentence that says what is missing."""
    if kind == "none":
        return None, ""
    missing = encoder_missing(kind)
    return (None, missing) if missing else (kind, "")


@contextmanager
def publishing(out, earlier=()):
    """A hidden folder inside out to write into; in the end its files move to out, facezip.json last.

    earlier  paths of what an earlier run left, removed before: while files of two runs lie side by side there is no
             index, so it comes first
    """
    out = Path(out)
    try:
        for left in out.glob(HIDDEN + "*"):  # of a run that was killed
            shutil.rmtree(left, ignore_errors=True)
        workshop = Path(tempfile.mkdtemp(prefix=HIDDEN, dir=out))
    except OSError as error:
        raise cannot_write(out, error) from error
    try:
        yield workshop
        try:
            for path in earlier:
                path.unlink(missing_ok=True)
            for path in sorted(workshop.iterdir(), key=lambda p: p.name == INDEX):
                os.replace(path, out / path.name)
        except OSError as error:
            raise cannot_write(out, error) from error
    finally:
        shutil.rmtree(workshop, ignore_errors=True)


def preview_name(number, name):
    """File name of the preview of the map with this number and name."""
    return "preview.html" if number == 0 else f"preview_{file_name(name)}.html"


def files_of(folder):
    """Paths of a packed set in a folder, the index first: the images that it names, inside the folder only, and the
    previews."""
    folder = Path(folder)
    try:
        about = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        names = [preview_name(number, name) for number, name in enumerate(about["maps"])]
    except (OSError, ValueError, KeyError, TypeError):
        return [folder / INDEX]

    def collect(value):
        if isinstance(value, dict):
            names.extend(v for k, v in value.items() if k in ("file", "ktx2") and isinstance(v, str))
            value = list(value.values())
        if isinstance(value, list):
            for each in value:
                collect(each)

    collect(about)
    return [folder / INDEX, *(folder / name for name in names if Path(name).name == name)]


def read_packed(folder, which=None):
    """The Packed that write_packed wrote, of the map called which (default: the first); reads only inside folder."""
    folder = Path(folder)
    try:
        about = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        if about["format"] != FORMAT:
            raise InputError(f"{folder}: {INDEX} has format {about['format']!r}, expected {FORMAT!r}")
        maps = about["maps"]
        if which is not None and which not in maps:
            raise InputError(f"{folder}: holds no map {which!r}; there are {', '.join(maps)}")
        return _read_map(folder, about, maps[which or next(iter(maps))])
    except (OSError, ValueError, KeyError, TypeError, StopIteration, IndexError) as error:
        why = str(error) or "it holds no map"
        raise InputError(
            f"{folder}: is no packed set ({why}); give a folder that `facewright compress` wrote"
        ) from None


def _read_map(folder, about, entry):
    differences = entry["differences"]
    weights = entry.get("weights", about["weights"])
    columns, rows = about["weight_size"]
    across, down = weights["places"]
    count, k, cell = len(weights["layers"]), len(differences), about["weight_cell"]
    atlas = np.concatenate([read_texture(_inside(folder, a["file"])) for a in weights["atlas"]], axis=2)
    neutral = read_texture(_inside(folder, entry["neutral"]["file"]))
    textures = np.stack([read_texture(_inside(folder, d["file"])) for d in differences])
    steps, zeros = (np.array([d[key] for d in differences], float) for key in ("step", "zero"))
    weight_steps, weight_zeros = (np.array([w[key] for w in weights["layers"]], float) for key in ("step", "zero"))
    layers = np.array(list(about["expressions"].values()))
    fits = (
        textures.shape[1:] == neutral.shape
        and textures.dtype == neutral.dtype
        and cell in (CELL, FINE_CELL)
        and (rows, columns) == Grid(*neutral.shape[:2], cell).cells
        and atlas.shape == (down * rows, across * columns, 4 * -(-k // 4))
        and across * down >= place_count(count, k)
        and steps.shape == zeros.shape == (k, neutral.shape[2])
        and weight_steps.shape == weight_zeros.shape == (count, k)
        and all(np.isfinite(x).all() for x in (steps, zeros, weight_steps, weight_zeros))
        and layers.dtype.kind == "i"
        and layers.min() >= 0
        and layers.max() < count
    )
    if not fits:
        raise ValueError(f"images and {INDEX} do not fit each other")
    maps = atlas.reshape(down, rows, across, columns, -1, 4).transpose(0, 2, 4, 5, 1, 3)
    maps = maps.reshape(down * across, -1, 4, rows, columns)
    place, channel = weight_places(count, k).transpose(2, 0, 1)
    return Packed(
        neutral=neutral,
        textures=textures,
        texture_step=steps,
        texture_zero=zeros,
        weights=np.ascontiguousarray(maps[place, np.arange(k) // 4, channel].transpose(0, 2, 3, 1)),
        weight_step=weight_steps,
        weight_zero=weight_zeros,
        names=tuple(about["expressions"]),
        layers=layers,
        cell=cell,
        report=entry["report"],
    )


def _inside(folder, name):
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise InputError(f"{folder}: {INDEX} names {name!r}, which lies outside the folder")
    return path
