"""facezip.hlsl against the decoder in numpy: compiled to SPIR-V, translated to GLSL ES, run in headless Chromium.

    python bench/compression_hlsl.py       needs glslang-tools, spirv-cross, node, npm ci and Chromium (CHROMIUM=path)

Each set is drawn twice: as Direct3D has it (row 0 on top) and as docs/compress-engines.md tells it for Unity, where
rows count from below.
"""

from __future__ import annotations

import base64
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from common import Verdict
from compression_web import cases, node

from facewright.compress import facezip_decode
from facewright.compress.folder import atlas_places, uv_scale, weight_atlas, weight_layers
from facewright.compress.ktx2 import as_rgba
from facewright.compress.runtime import HLSL

PLACES = 128
ENTRIES = (
    "float4 main(float4 position : SV_Position) : SV_Target { return FacezipWeights(int2(position.xy)); }",
    "float4 main(float2 uv : TEXCOORD0) : SV_Target { return Facezip(uv); }",
)


def main():
    verdict, rng = Verdict(), np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for upwards in (False, True):
            passes = [translated(folder, entry, upwards) for entry in ENTRIES]
            for name, packed, _ in cases(None):
                count = len(packed.names)
                blends = np.eye(count)[0], rng.uniform(-0.5, 1, count) * (rng.random(count) < 4 / count)
                gap = max(largest_gap(folder, passes, packed, blend, upwards) for blend in blends)
                verdict.check(name + (", Unity rows" if upwards else ""), "HLSL - numpy, codes of 255", gap, 1)
    verdict.print()


def translated(folder, entry, upwards):
    """GLSL ES 3.00 of the fragment shader with this entry."""
    head = f"#define FACEZIP_PLACES {PLACES}\n" + ("#define FACEZIP_UPWARDS\n" if upwards else "")
    (folder / "shader.hlsl").write_text(head + HLSL + entry)
    command = [
        "glslangValidator",
        "-D",
        "-V",
        "--auto-map-bindings",
        "--auto-map-locations",
        "-S",
        "frag",
        "-e",
        "main",
    ]
    subprocess.run(
        [*command, "-o", folder / "shader.spv", folder / "shader.hlsl"], check=True, stdout=subprocess.DEVNULL
    )
    command = ["spirv-cross", folder / "shader.spv", "--es", "--version", "300", "--no-420pack-extension"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def largest_gap(folder, passes, packed, blend, upwards):
    """Largest difference between the shader and facezip_decode, codes."""
    rows, columns = packed.weights.shape[1:3]
    height, width = packed.neutral.shape[:2]
    gains, offset = np.zeros((PLACES, 4)), np.zeros(4)
    k, layers = len(packed.textures), weight_layers(packed)
    for weight, layer in zip(blend, packed.layers):
        for i, (step, zero, (place, channel)) in enumerate(zip(*layers[layer].values())):
            gains[place, channel] += 255 * step * weight
            offset[i] += step * weight * zero
    steps, zeros = (channels(x, packed.neutral.shape[2]) for x in (packed.texture_step, packed.texture_zero))
    floats = [gains.ravel(), offset, steps.ravel(), zeros.ravel() / 255, uv_scale(packed)]
    floats = np.concatenate(floats).astype("<f4")
    # A vector of two integers begins at a multiple of eight bytes, the block ends at one of sixteen.
    integers = np.array([columns, rows, *atlas_places(packed), k == 3, 0, 0, 0], "<i4")
    images = {"facezipAtlas": weight_atlas(packed), "facezipNeutral": as_rgba(packed.neutral)}
    drawn = [as_rgba(image) for image in packed.textures]
    for i in range(4):
        images[f"facezipD{i}"] = drawn[i] if i < k else np.zeros((1, 1, 4), np.uint8)
    turn = slice(None, None, -1) if upwards else slice(None)
    job = {
        "passes": passes,
        "images": {name: as_json(image[turn]) for name, image in images.items()},
        "block": text_of(floats.tobytes() + integers.tobytes()),
        "cells": [columns, rows],
        "size": [width, height],
    }
    (folder / "job.json").write_text(json.dumps(job))
    node("hlsl.mjs", folder / "job.json", folder / "out.rgba")
    got = np.fromfile(folder / "out.rgba", np.uint8).reshape(height, width, 4)[turn]
    return int(np.abs(got.astype(int) - as_rgba(facezip_decode(packed, blend))).max())


def channels(values, count):
    """(4, 4) of (K, C): grey repeats, RGB has 0 for alpha, missing textures have 0."""
    full = np.zeros((4, 4))
    full[: len(values), : max(count, 3)] = values
    return full


def as_json(image):
    height, width = image.shape[:2]
    return {"width": width, "height": height, "data": text_of(np.ascontiguousarray(image).tobytes())}


def text_of(data):
    return base64.b64encode(data).decode()


if __name__ == "__main__":
    main()
