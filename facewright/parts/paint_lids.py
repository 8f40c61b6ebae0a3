"""Textures with transparency for what rides on the lids: lashes, and soft strips at the eyeball.

Their colour is the same in every texel, only alpha draws: so no light rim appears where a viewer blends or shrinks
them.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.fade import smooth_step

_LASH = (34, 25, 21)
_SHADOW = (30, 14, 12)
_HAIRS = {"upper": 120, "lower": 56}
_BORDER = 0.01  # of the width: a hair on it would wrap round to the other end
_FADE = 1.25
_CORNERS = 0.1  # of a row of lashes at either end: there they get shorter and finer,
_LEAST_LENGTH, _LEAST_WIDTH = 0.35, 0.55  # down to such shares


def paint_lashes(look, size=512):
    """(size, 2 size, 4) uint8: hairs from the root to the tip; the upper lid's in the upper half (root at v = 0.5), the
    lower lid's in the lower half (root at v = 0); u along the lid. look["hair"]: sRGB 0..1, default dark brown.
    """
    alpha = np.zeros((size, 2 * size))
    rng = np.random.default_rng(11)
    half = size // 2
    for lid, rows in (("upper", slice(0, half)), ("lower", slice(half, size))):
        alpha[rows] = _hairs(rng, _HAIRS[lid], half, 2 * size, 1.0 if lid == "upper" else 0.62)
    color = np.array(look["hair"]) * 255 if "hair" in look else np.array(_LASH)
    return _with_alpha(color, alpha)


def _hairs(rng, count, height, width, thickness):
    """(height, width) alpha of hairs that stand on the bottom row; neighbours lean to a common tip now and then."""
    alpha = np.zeros((height, width))
    y = (height - 0.5 - np.arange(height)) / height  # 0 at the root
    roots = _BORDER + (1.0 - 2.0 * _BORDER) * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    clump = np.repeat(rng.uniform(-0.9, 0.9, count // 3 + 1), 3)[:count] / count
    lean = clump * 1.2 + rng.normal(0, 0.5, count) / count
    length = np.clip(rng.normal(0.82, 0.16, count), 0.35, 0.99)
    radius = thickness * rng.uniform(1.3, 2.3, count) * width / 1024
    # A row that ended with hairs as long as the others would end in a straight edge beside the corner of the eye.
    whole = smooth_step(np.minimum(roots, 1.0 - roots), 0.0, _CORNERS)
    length *= _LEAST_LENGTH + (1.0 - _LEAST_LENGTH) * whole
    lean *= whole
    radius *= _LEAST_WIDTH + (1.0 - _LEAST_WIDTH) * whole
    for root, bend, tall, wide in zip(roots, lean, length, radius):
        middle = (root + bend * (1.2 * y + 1.6 * y**2)) * width
        rest = np.maximum(1 - y / tall, 0.0)
        low = max(int(middle.min() - wide - 2), 0)
        x = np.arange(low, min(int(middle.max() + wide + 3), width)) + 0.5
        reach = wide * rest**0.6
        hair = np.clip(reach[:, None] + 0.5 - np.abs(x - middle[:, None]), 0, 1) * np.clip(3 * rest, 0, 1)[:, None]
        piece = alpha[:, low : low + len(x)]
        alpha[:, low : low + len(x)] = 1 - (1 - piece) * (1 - 0.95 * hair)
    return alpha


def paint_occlusion(look, size=64):
    """(size, size, 4) uint8: the lids' shadow on the eyeball. v 1 at the upper and 0 at the lower margin, nothing at
    0.5; u along the lids. look["strength"] = (upper, lower) alpha at the margins."""
    upper, lower = look.get("strength", (0.78, 0.45))
    v, u = _down(size), (np.arange(size) + 0.5) / size
    fall = np.where(v > 0.5, upper * np.maximum(2 * v - 1, 0) ** _FADE, lower * np.maximum(1 - 2 * v, 0) ** _FADE)
    ends = np.minimum(u, 1 - u)  # at the corners the two strips meet and would draw a black line
    corners = 1 + 0.3 * np.exp(-((ends / 0.2) ** 2)) - np.exp(-((ends / 0.06) ** 2))
    return _with_alpha(np.array(_SHADOW), np.clip(fall[:, None] * corners, 0, 1))


def paint_blend(look, size=64):
    """(size, size, 4) uint8: the wet red of the lids' edges fading onto the eyeball; v as in paint_occlusion."""
    v = _down(size)
    fall = 0.85 * np.abs(2 * v - 1) ** 1.2
    color = np.array(look["tint"]) * 255 if "tint" in look else np.array([172.0, 112.0, 104.0])
    return _with_alpha(color, np.repeat(fall[:, None], size, axis=1))


def _down(size):
    """(size,) v of an image's rows."""
    return 1 - (np.arange(size) + 0.5) / size


def _with_alpha(color, alpha):
    image = np.empty((*alpha.shape, 4), np.uint8)
    image[..., :3] = np.clip(np.rint(color), 0, 255).astype(np.uint8)
    image[..., 3] = np.clip(np.rint(alpha * 255), 0, 255).astype(np.uint8)
    return image
