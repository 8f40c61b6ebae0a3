"""Push-pull: every empty texel of an image takes the mean of the nearest filled ones (Gortler et al. 1996)."""

from __future__ import annotations

import numpy as np

from facewright.bake.texels import CHUNK


def push_pull(values, weights, wanted=None):
    """(h, w, c) float32 without gaps, of values (h, w, c) with weights (h, w) in 0..1, 0 where a texel is empty.

    Texels of weight 1 stay as they are. Averages down to one texel, then fills upwards bilinearly: smooth, and at a
    chart's border close to the border's own colour, which is what gutters want. wanted (h, w) bool limits which empty
    texels are filled; the others keep what they have.
    """
    if weights.min() >= 1.0 or weights.size == 1 or not weights.any():
        return np.asarray(values, np.float32)
    result = np.array(values, np.float32)
    weights = np.asarray(weights, np.float32)
    filled = push_pull(*_reduce(result, weights))
    empty = weights < 1.0 if wanted is None else (weights < 1.0) & wanted
    places = np.flatnonzero(empty)
    for start in range(0, len(places), CHUNK):
        rows, columns = np.divmod(places[start : start + CHUNK], weights.shape[1])
        share = weights[rows, columns, None]
        result[rows, columns] = result[rows, columns] * share + _bilinear_parent(filled, rows, columns) * (1.0 - share)
    return result


def _reduce(values, weights):
    """Weighted means of 2 x 2 texels and their weights, which saturate: one filled texel fills its parent."""
    height, width, channels = values.shape
    sums = np.zeros((-(-height // 2), -(-width // 2), channels), np.float32)
    total = np.zeros(sums.shape[:2], np.float32)
    for row in (0, 1):
        for column in (0, 1):
            weight = weights[row::2, column::2]
            here = np.s_[: weight.shape[0], : weight.shape[1]]
            sums[here] += values[row::2, column::2] * weight[..., None]
            total[here] += weight
    return sums / np.maximum(total, 1e-6)[..., None], np.minimum(total, 1.0)


def _bilinear_parent(coarse, rows, columns):
    """Values of the next coarser level (h, w, c) at texels (rows, columns) of this one, between its four nearest."""
    height, width = coarse.shape[:2]
    y, x = (rows - 0.5) / 2.0, (columns - 0.5) / 2.0
    y0, x0 = np.floor(y).astype(np.int64), np.floor(x).astype(np.int64)
    fy, fx = (y - y0).astype(np.float32)[:, None], (x - x0).astype(np.float32)[:, None]
    top, bottom = np.clip(y0, 0, height - 1), np.clip(y0 + 1, 0, height - 1)
    left, right = np.clip(x0, 0, width - 1), np.clip(x0 + 1, 0, width - 1)
    upper = coarse[top, left] * (1 - fx) + coarse[top, right] * fx
    lower = coarse[bottom, left] * (1 - fx) + coarse[bottom, right] * fx
    return upper * (1 - fy) + lower * fy
