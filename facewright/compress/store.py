"""From a solution in float to what is stored: weights first, then the textures that suit them best, then the error."""

from __future__ import annotations

import numpy as np

from facewright.compress.contrast import even_contrast
from facewright.compress.packed import code_scale, nearest_codes, quantise
from facewright.compress.refine import Pass
from facewright.compress.threads import in_threads
from facewright.compress.tiles import CELL

# Values of difference textures beyond this share at either end are clipped, of more while weights settle (2.913 against
# 2.920 on the faces); so many texels tell where that is.
TAIL, SETTLING_TAIL = 1e-4, 3e-4
SAMPLE = 1 << 18


def store_solution(tiles, weights, ridge, *, held=(), exact=False, report):
    """Quantised weights, and the quantised difference textures that suit them best (ridge: per texture).

    exact  every difference texture is as near to its values as the step allows, for they are those of textures
    """
    weights = np.ascontiguousarray(weights.transpose(2, 0, 1, 3))  # (N, rows, columns, K)
    codes, step, zero = quantise_weights(weights)
    stored = ((codes.astype(np.float32) - zero[:, None, None]) * step[:, None, None]).astype(np.float32)
    seen = stored if tiles.emphasis is None else stored * tiles.emphasis[:, None, None]
    parts = _stored_textures(tiles, seen.transpose(1, 2, 0, 3), ridge, held, exact)
    return stored_parts(tiles, parts, (codes, step, zero), report)


class Rounding:
    """What difference textures can be stored as: codes with a step and a zero (K, C) each."""

    def __init__(self, tiles, step, zero):
        self.tiles, self.step, self.zero = tiles, step, zero
        self._step, self._zero = (x.astype(np.float32)[:, :, None] for x in (step, zero))
        self._levels = tiles.levels[:, None]

    def codes(self, values):
        """Codes (..., K, C, P) of values like them in 0-255 units."""
        return nearest_codes(values, self._step, self._zero, self._levels)

    def nearest(self, i, values):
        """The values (..., C, P) nearest to those of texture i."""
        return (nearest_codes(values, self._step[i], self._zero[i], self._levels) - self._zero[i]) * self._step[i]

    def of_part(self, part):
        """nearest() for tiles whose values are scaled as their differences are."""
        scale = self.tiles.scale[part] * self.tiles.gain
        inverse = np.divide(1, scale, out=np.zeros_like(scale), where=scale > 0)
        return lambda i, values: self.nearest(i, values * inverse) * scale


def texture_rounding(tiles, weights, ridge, held=(), whole=(), tail=TAIL):
    """Rounding that suits the difference textures for weights (rows, columns, N, K).

    held   textures that the first ones hold; whole: indices of difference textures of which nothing is clipped
    tail   share of the others' values beyond either end, which are clipped
    """
    k = weights.shape[-1]
    work, flat = Pass(tiles, k, held), np.ascontiguousarray(weights, np.float32).reshape(-1, tiles.count, k)

    def one(part):
        d, _, _ = work.solve_textures(flat, part, ridge * tiles.count, tiles.differences(part, whole=True))
        return d.transpose(0, 3, 1, 2)[tiles.scale[part, 0] > 0]  # (texels, K, C)

    every = 1 if len(whole) else max(1, tiles.scale.size // SAMPLE)
    samples = np.concatenate(in_threads(one, tiles.covered_chunks(every)))
    return Rounding(tiles, *_texture_scale(tiles, samples, tail, whole))


def _stored_textures(tiles, weights, ridge, held, exact):
    """Codes (K, h, w, C), step and zero of the difference textures for weights (rows, columns, N, K)."""
    k = weights.shape[-1]
    whole = range(k) if exact else range(len(held))
    rounding = texture_rounding(tiles, weights, ridge, held, whole)
    nearest = None if exact else rounding.nearest
    work, flat = Pass(tiles, k, held), np.ascontiguousarray(weights, np.float32).reshape(-1, tiles.count, k)
    damping, dtype = ridge * tiles.count, tiles.data.dtype

    def solved(part, nearest):
        # Every texel has a system of its own, so scales fall out, and what lies just outside the covered texels,
        # which filters and mip-maps read too, is met as well.
        return work.solve_textures(flat, part, damping, tiles.differences(part, whole=True), nearest)[0]

    def gathered(function, dtype):
        result = np.empty((len(tiles), k, tiles.channels, tiles.grid.texels), dtype)

        def one(part):
            result[part] = function(part)

        in_threads(one, tiles.chunks())
        return result

    if tiles.grid.cell < CELL:
        d = even_contrast(tiles, weights, gathered(lambda part: solved(part, None), np.float32))
        codes = gathered(lambda part: rounding.codes(work.round_textures(flat, part, damping, d[part], nearest)), dtype)
    else:
        codes = gathered(lambda part: rounding.codes(solved(part, nearest)), dtype)
    image = tiles.grid.join(codes.reshape(len(tiles), -1, tiles.grid.texels))
    image = image.reshape(*image.shape[:2], k, tiles.channels)
    return np.ascontiguousarray(image.transpose(2, 0, 1, 3)), rounding.step, rounding.zero


def _texture_scale(tiles, samples, tail=TAIL, whole=()):
    """Step and zero (K, C) from samples (texels, K, C)."""
    low, high = np.quantile(samples[:: max(1, len(samples) // SAMPLE)], [tail, 1 - tail], axis=0)
    for i in whole:
        low[i], high[i] = samples[:, i].min(axis=0), samples[:, i].max(axis=0)
    return code_scale(low, high, tiles.levels)


def stored_parts(tiles, textures, weights, report):
    keys = ("textures", "texture_step", "texture_zero", "weights", "weight_step", "weight_zero")
    return {**dict(zip(keys, (*textures, *weights))), "cell": tiles.grid.cell, "report": report}


def quantise_weights(weights):
    low, high = weights.min(axis=(1, 2)), weights.max(axis=(1, 2))
    low, high = np.minimum(low, 0.0).astype(np.float64), np.maximum(high, 0.0).astype(np.float64)
    codes, step, zero = quantise(weights, low[:, None, None], high[:, None, None], 255, np.uint8)
    return codes, step[:, 0, 0], zero[:, 0, 0]


def quantise_textures(tiles, d):
    """Codes (K, h, w, C), step and zero of difference textures (h, w, K, C)."""
    height, width = d.shape[:2]
    covered = tiles.grid.join(tiles.scale)[:, :, 0] > 0
    every = (slice(None, None, max(1, height // 512)), slice(None, None, max(1, width // 512)))
    step, zero = _texture_scale(tiles, d[every][covered[every]])
    codes = in_threads(
        lambda i: nearest_codes(d[:, :, i], step[i], zero[i], tiles.levels).astype(tiles.data.dtype), range(d.shape[2])
    )
    return np.stack(codes), step, zero


def _predicted(tiles, part, textures, weights, work):
    """(t, N, C, P) 0-255 reconstruction of tiles from stored values, clipped."""
    x = work.blended(weights, part, textures)
    x += tiles.neutral[part, None] * np.float32(tiles.unit)
    return np.clip(x, 0, 255, out=x)


def _difference_tiles(grid, encoded, row):
    """(columns, K, C, P) of one row of tiles, 0-255 units."""
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
    columns, size = tiles.grid.tiles[1], tiles.chunks()[0].stop

    def one(row):
        part = slice(row * columns, (row + 1) * columns)
        covered = tiles.scale[part, None] > 0
        total = np.zeros((tiles.count, tiles.channels))
        textures = _difference_tiles(tiles.grid, encoded, row)
        for start in range(0, columns, size):
            some = slice(start, min(start + size, columns))
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
