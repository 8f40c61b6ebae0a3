"""From a solution in float to what is stored: weights first, then the textures that suit them best, then the error."""

from __future__ import annotations

import numpy as np

from facewright.compress.packed import quantise
from facewright.compress.refine import Pass
from facewright.compress.threads import in_threads
from facewright.compress.tiles import TEXELS


def store_solution(tiles, weights, k, ridge, *, held=(), exact=False, report):
    """Quantised weights, the difference textures that suit them best (ridge: per texture), and these quantised."""
    weights = np.ascontiguousarray(weights.transpose(2, 0, 1, 3))  # (N, rows, columns, K)
    codes, step, zero = quantise_weights(weights)
    stored = ((codes.astype(np.float32) - zero[:, None, None]) * step[:, None, None]).astype(np.float32)
    seen = stored if tiles.emphasis is None else stored * tiles.emphasis[:, None, None]
    d = Pass(tiles, k, held).textures(seen.transpose(1, 2, 0, 3), ridge * tiles.count)
    parts = quantise_textures(tiles, d, held=range(k) if exact else range(len(held)))
    return stored_parts(parts, (codes, step, zero), report)


def stored_parts(textures, weights, report):
    keys = ("textures", "texture_step", "texture_zero", "weights", "weight_step", "weight_zero")
    return {**dict(zip(keys, (*textures, *weights))), "report": report}


def quantise_weights(weights):
    low, high = weights.min(axis=(1, 2)), weights.max(axis=(1, 2))
    low, high = np.minimum(low, 0.0).astype(np.float64), np.maximum(high, 0.0).astype(np.float64)
    codes, step, zero = quantise(weights, low[:, None, None], high[:, None, None], 255, np.uint8)
    return codes, step[:, 0, 0], zero[:, 0, 0]


def quantise_textures(tiles, d, held=()):
    """Codes (K, h, w, C) of D (h, w, K, C); all but held textures at the 99.99 percentile range of covered texels."""
    height, width, k, channels = d.shape
    covered = tiles.grid.join(tiles.scale)[:, :, 0] > 0
    # A few hundred thousand texels tell the percentiles.
    every = (slice(None, None, max(1, height // 512)), slice(None, None, max(1, width // 512)))
    sample = d[every][covered[every]]
    sample = sample if len(sample) else np.zeros((1, k, channels), np.float32)
    low, high = np.quantile(sample, 0.0001, axis=0), np.quantile(sample, 0.9999, axis=0)
    for i in held:
        low[i], high[i] = d[covered, i].min(axis=0), d[covered, i].max(axis=0)
    parts = in_threads(
        lambda i: quantise(d[:, :, i], low[i], high[i], tiles.levels, tiles.data.dtype),
        range(k),
    )
    codes, steps, zeros = (np.stack([part[j] for part in parts]) for j in range(3))
    return codes, steps, zeros


def _predicted(tiles, part, textures, weights, work):
    """(t, N, C, 64) 0-255 reconstruction of tiles from stored values, clipped."""
    k = weights.shape[-1]
    corner = weights[work.corners[part]].transpose(0, 2, 1, 3)  # (t, N, 4, K)
    e = (textures[:, None] * work.basis[:, None, None]).reshape(len(corner), 4 * k, -1)
    x = (corner.reshape(len(corner), -1, 4 * k) @ e).reshape(len(corner), -1, tiles.channels, TEXELS)
    x += tiles.neutral[part, None] * np.float32(tiles.unit)
    return np.clip(x, 0, 255, out=x)


def _difference_tiles(grid, encoded, row):
    """(columns, K, C, 64) of one row of tiles, 0-255 units."""
    step, zero = (encoded[key].astype(np.float32)[:, None] for key in ("texture_step", "texture_zero"))
    # Tiles reach beyond the image, where nothing counts.
    return np.stack(
        [
            (grid.cut(image, row, row + 1).astype(np.float32) - z[0, :, None]) * s[0, :, None]
            for image, s, z in zip(encoded["textures"], step, zero)
        ],
        axis=1,
    )


def measure_tiles(tiles, encoded):
    """(N, C) RMSE of every texture and channel on covered texels, 0-255, after storage, upsampling and clipping."""
    step, zero = (encoded[key].astype(np.float32) for key in ("weight_step", "weight_zero"))
    weights = (encoded["weights"].astype(np.float32) - zero[:, None, None]) * step[:, None, None]
    weights = np.ascontiguousarray(weights.transpose(1, 2, 0, 3)).reshape(-1, tiles.count, weights.shape[-1])
    work = Pass(tiles, weights.shape[-1])
    columns = tiles.grid.tiles[1]

    def one(row):
        part = slice(row * columns, (row + 1) * columns)
        covered = tiles.scale[part, None] > 0
        total = np.zeros((tiles.count, tiles.channels))
        textures = _difference_tiles(tiles.grid, encoded, row)
        for start in range(0, columns, 96):
            some = slice(start, min(start + 96, columns))
            at = slice(part.start + some.start, part.start + some.stop)
            x = _predicted(tiles, at, textures[some], weights, work)
            x -= tiles.data[at].astype(np.float32) * np.float32(tiles.unit)
            x *= covered[some]
            total += np.einsum("tncp,tncp->nc", x, x)
        return total

    total = sum(in_threads(one, range(tiles.grid.tiles[0])))
    return np.sqrt(total / max((tiles.scale > 0).sum(), 1))


def root_mean(errors):
    """(N,) RMSE over the channels of errors (N, C)."""
    return np.sqrt((errors**2).mean(axis=1))
