"""FaceZip in a browser: preview.html against the decoder in numpy, KTX2 in three.js and in a reader of its own.

    python bench/compression_web.py [--set FOLDER]       needs node, npm ci and Chromium (CHROMIUM=path)

Blends are random, half of them with weights beyond 0 to 1; the page is opened from its file without a network.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import ROOT, Verdict, print_table
from compression import TEXTURES, read_set
from PIL import Image

from facewright.compress import FacezipOptions, facezip, facezip_decode, facezip_maps
from facewright.compress.folder import read_packed, write_packed
from facewright.compress.ktx2 import as_rgba, decode_blocks, encoder_missing
from facewright.compress.packed import with_examples
from facewright.compress.preview import preview_page
from facewright.compress.synthetic import expression_set

WEB = ROOT / "tests" / "web"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", type=Path, help="a folder with neutral.png, mesh.obj and textures/")
    options = parser.parse_args()
    verdict, rows = Verdict(), []
    with tempfile.TemporaryDirectory() as folder:
        for name, packed, images in cases(options.set):
            rows.append([name, *check_page(name, packed, images, Path(folder) / name.replace(" ", "_"), verdict)])
        check_ktx2(Path(folder), verdict)
    header = ["set", "float target", "half target", "original pane"]
    print_table("Largest difference to numpy, codes of 255", header, rows)
    verdict.print()


def cases(folder):
    """(name, Packed, originals) of sets that try every path of the shader."""
    real = folder or next(iter(sorted(TEXTURES.glob("*/"))), None)
    if real is not None:
        textures = read_set(real)
        yield real.name, facezip(textures.neutral, textures.textures, mesh=textures.mesh), textures.textures
    made = expression_set((203, 150), 12)
    packed = facezip(made.neutral, made.textures, names=made.names)
    yield "odd size", packed, made.textures
    three = facezip(made.neutral, made.textures, options=FacezipOptions(textures=3))
    yield "three difference textures", three, made.textures
    B = np.random.default_rng(0).random((12, 30))
    yield "example shapes", with_examples(packed, [f"s{m}" for m in range(30)], B), None
    alpha = [np.dstack([t, np.roll(t[:, :, 0], 9)]) for t in [made.neutral, *made.textures]]
    yield "alpha", facezip(alpha[0], alpha[1:]), alpha[1:]
    grey = [t[:, :, :1] for t in [made.neutral, *made.textures]]
    yield "grey", facezip(grey[0], grey[1:]), grey[1:]
    yield "one texture", facezip(made.neutral, made.textures[:1]), made.textures[:1]
    many = expression_set(128, 100)
    yield "100 textures", facezip(many.neutral, many.textures), many.textures


def check_page(name, packed, images, folder, verdict):
    """Largest differences of the compressed pane (both targets) and the original pane."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    count = len(packed.names)
    blends = [np.eye(count)[rng.integers(count)]]
    blends += [rng.random(count) * (rng.random(count) < 0.3) for _ in range(4)]
    blends += [rng.uniform(-1, 1.5, count) * (rng.random(count) < 4 / count) for _ in range(5)]
    originals = images or [packed.neutral] * count
    page = preview_page(packed, lambda n: originals[n], count)
    (folder / "preview.html").write_text(page, encoding="utf-8")
    (folder / "blends.json").write_text(json.dumps([b.tolist() for b in blends]))
    node("facezip.mjs", folder / "preview.html", folder / "blends.json", folder)
    shape = (*packed.neutral.shape[:2], 4)
    worst = {"float": 0, "half": 0, "original": 0}
    for i, blend in enumerate(blends):
        base = packed.neutral.astype(float)
        whole = base + sum(w * (t.reshape(base.shape) - base) for w, t in zip(blend, originals))
        wanted = {"float": facezip_decode(packed, blend), "original": np.rint(np.clip(whole, 0, 255)).astype(np.uint8)}
        wanted["half"] = wanted["float"]
        for kind in worst:
            got = np.fromfile(folder / f"blend{i}.{kind}", np.uint8).reshape(shape)
            worst[kind] = max(worst[kind], int(np.abs(got.astype(int) - as_rgba(wanted[kind])).max()))
    verdict.check(name, "shader - numpy, float target", worst["float"], 1)
    verdict.check(name, "shader - numpy, half target", worst["half"], 1)
    return worst["float"], worst["half"], worst["original"] if images else None


def check_ktx2(folder, verdict):
    """Sizes and pixels of KTX2 files as three.js and ktx-parse have them, against the report and Pillow."""
    made = expression_set(256, 8)
    grey = [t[:, :, :1].astype(np.uint16) * 257 for t in [made.neutral, *made.textures]]
    maps = {"color": (made.neutral, lambda n: made.textures[n]), "height": (grey[0], lambda n: grey[n + 1])}
    for kind, count in (("bc7", 4), ("astc", 3)):
        if encoder_missing(kind):
            print(encoder_missing(kind))
            continue
        packed = facezip_maps(maps, made.names, share=True, options=FacezipOptions(textures=count))
        place = folder / kind
        place.mkdir()
        about = write_packed(packed, place, kind)
        images = [e for m in about["maps"].values() for e in (m["neutral"], *m["differences"])] + about["weights"][
            "atlas"
        ]
        blend = {made.names[0]: 0.6, made.names[3]: 0.8}
        node("ktx2.mjs", place / "out", place, json.dumps(blend), *(place / image["ktx2"] for image in images))
        drawn = np.asarray(Image.open(place / "out" / "blend.png").convert("RGB")).astype(int)
        wanted = facezip_decode(as_drawn(packed["color"], place / "out"), blend)
        verdict.check(kind, "blend in three.js - numpy", int(np.abs(drawn - wanted).max()), 1)
        on_disk, on_card = 0, 0
        for image in images:
            data = (place / image["ktx2"]).read_bytes()
            told = json.loads((place / "out" / f"{image['ktx2']}.json").read_text())
            same = (
                told["three"]["levels"] == told["parsed"]["levels"]
                and sum(told["parsed"]["levels"]) == image["ktx2_memory"]
            )
            verdict.check(image["ktx2"], f"{kind}: levels differ from the report", int(not same), 0)
            on_disk, on_card = on_disk + len(data), on_card + sum(told["parsed"]["levels"])
            drawn = np.fromfile(place / "out" / f"{image['ktx2']}.rgba", np.uint8).reshape(
                told["three"]["height"], -1, 4
            )
            verdict.check(image["ktx2"], f"{kind}: pixels in three.js", pixel_gap(place, image, told, kind, drawn), 1)
        verdict.check(kind, "bytes on disk - report", abs(on_disk - about["bytes"]["ktx2"]), 0)
        verdict.check(kind, "bytes on the card - report", abs(on_card - about["bytes"]["memory_ktx2"]), 0)
        differs = (read_packed(place).textures != packed["color"].textures).any()
        verdict.check(kind, "set read back differs", int(differs), 0)


def as_drawn(packed, folder):
    """The Packed with the textures that three.js drew: two decoders of ASTC may differ by one code."""

    def drawn(name, like):
        pixels = np.fromfile(folder / f"{name}.ktx2.rgba", np.uint8).reshape(*like.shape[:2], 4)
        return pixels[:, :, : like.shape[2]]

    textures = [drawn(f"difference{i}", image) for i, image in enumerate(packed.textures)]
    return replace(packed, neutral=drawn("neutral", packed.neutral), textures=np.stack(textures))


def pixel_gap(place, image, told, kind, drawn):
    """Largest difference of level 0 as three.js draws it and as Pillow or the raw file has it."""
    parsed = told["parsed"]
    data = (place / image["ktx2"]).read_bytes()
    offset, length = np.frombuffer(data[80:96], "<u8")
    level = data[int(offset) : int(offset + length)]
    height, width = parsed["height"], parsed["width"]
    if parsed["vkFormat"] == 100:
        wanted = np.rint(np.frombuffer(level, "<f4").reshape(height, width) * 255).astype(int)
        return int(np.abs(drawn[:, :, 0] - wanted).max())
    if parsed["vkFormat"] == 37:
        wanted = np.frombuffer(level, np.uint8).reshape(height, width, 4)
    else:
        wanted = decode_blocks(level, kind, height, width)
    return int(np.abs(drawn.astype(int) - wanted).max())


def node(script, *arguments):
    subprocess.run(["node", str(WEB / script), *map(str, arguments)], check=True)


if __name__ == "__main__":
    main()
