"""Gradients of blends across borders of blocks and masks, beside those inside: a part of bench/compression.py."""

from __future__ import annotations

import numpy as np
from common import print_table

from facewright.compress import facezip
from facewright.compress.evaluation import decode_float
from facewright.compress.masks import build_masks


def seams(sets, verdict):
    """Mean gradient across borders of blocks and masks, relative to the original's, against that inside."""
    rows, ratios = [], {}
    for name, textures, _ in sets:
        packed = facezip(textures.neutral, textures.textures, mesh=textures.mesh, covered=textures.covered)
        ratios = border_ratios(textures, packed)
        rows.append([name, *ratios.values()])
        for where, ratio in ratios.items():
            verdict.check(name, f"gradient across {where}", abs(ratio - 1), 0.02)
    print_table("Gradient across borders / inside, relative to the original", ["set", *ratios], rows)


def border_ratios(textures, packed, blends=30, seed=0):
    """dict: (gradient of the blend / of the original) at the borders of blocks and masks, over that elsewhere.

    Weights are interpolated between the middles of weight texels: there, between the borders, they kink.
    """
    rng = np.random.default_rng(seed)
    height, width = textures.neutral.shape[:2]
    grid = packed.grid
    masks, _ = build_masks(textures.mesh, grid, 53)
    owner = grid.upsample(masks).argmax(axis=2)
    inside = textures.covered[:, 1:] & textures.covered[:, :-1], textures.covered[1:] & textures.covered[:-1]
    edges = list(zip(_edges(height, width), inside))
    lines = {"blocks of 8": (8, 0), "weight texels": (grid.cell, 0), "kinks": (grid.cell, grid.cell // 2)}
    borders = {
        where: [np.broadcast_to(k % step == first, ok.shape) for k, ok in edges]
        for where, (step, first) in lines.items()
    }
    borders["masks"] = [owner[:, 1:] != owner[:, :-1], owner[1:] != owner[:-1]]
    sums = {where: np.zeros(4) for where in borders}
    d = packed.difference_textures()
    for _ in range(blends):
        chosen = rng.choice(len(packed.names), 3, replace=False)
        weights = np.zeros(len(packed.names))
        weights[chosen] = rng.uniform(0.2, 0.6, 3)
        image = decode_float(packed, weights, d)
        base = textures.neutral.astype(np.float32)
        original = base + sum(np.float32(weights[n]) * (textures.textures[n].astype(np.float32) - base) for n in chosen)
        for axis in (1, 0):
            mine, wanted = (np.abs(np.diff(x, axis=axis)).mean(axis=2) for x in (image, original))
            ok = inside[1 - axis]
            for where, edges in borders.items():
                edge = edges[1 - axis]
                sums[where] += [
                    mine[ok & edge].sum(),
                    wanted[ok & edge].sum(),
                    mine[ok & ~edge].sum(),
                    wanted[ok & ~edge].sum(),
                ]
    return {where: (s[0] / s[1]) / (s[2] / s[3]) for where, s in sums.items()}


def _edges(height, width):
    return np.arange(1, width)[None], np.arange(1, height)[:, None]
