"""Push-pull: every empty texel of an image takes the mean of the nearest filled ones (Gortler et al. 1996)."""

from __future__ import annotations

import numpy as np


def push_pull(values, weights, wanted=None):
    """(h, w, c) float32 without gaps, of values (h, w, c) with weights (h, w) in 0..1, 0 where a texel is empty.

    Texels of weight 1 stay as they are. Averages down to one texel, then fills upwards bilinearly: smooth, and at a
    chart's border close to the border's own colour, which is what gutters want. wanted (h, w) bool limits which empty
    texels are filled; the others keep what they have.
    """
    height, width = weights.shape
    if weights.min() >= 1.0:
        return np.asarray(values, np.float32)
    if height * width == 1 or not weights.any():
        return np.asarray(values, np.float32)
    values = np.asarray(values, np.float32)
    weights = np.asarray(weights, np.float32)
    coarse, coarse_weights = _reduce(values, weights)
    filled = push_pull(coarse, coarse_weights)
    empty = weights < 1.0 if wanted is None else (weights < 1.0) & wanted
    result = values.copy()
    rows, columns = np.nonzero(empty)
    below = _bilinear_parent(filled, rows, columns)
    share = weights[rows, columns, None]
    result[rows, columns] = values[rows, columns] * share + below * (1.0 - share)
    return result


def _reduce(values, weights):
    """Weighted means of 2 x 2 texels and their weights, which saturate: one filled texel fills its parent."""
    height, width = weights.shape
    rows, columns = -(-height // 2), -(-width // 2)
    padded = np.zeros((2 * rows, 2 * columns, values.shape[2] + 1), np.float32)
    padded[:height, :width, :-1] = values * weights[..., None]
    padded[:height, :width, -1] = weights
    sums = padded[0::2, 0::2] + padded[0::2, 1::2] + padded[1::2, 0::2] + padded[1::2, 1::2]
    total = sums[..., -1]
    return sums[..., :-1] / np.maximum(total, 1e-6)[..., None], np.minimum(total, 1.0)


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
