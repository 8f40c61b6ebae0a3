"""Textures that are not aligned to the neutral: found by optical flow, and warped back onto it on request.

Compression blends texels of the same place, so textures a few texels off come out blurred. Wrinkles move no skin in
the texture, they only shade it: the flow is smoothed until it follows the skin and not the shading.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, uniform_filter

from facewright.errors import InputError

FLOW_SIZE = 512
# Width of the window, as a share of the image: finer motion than this is taken for wrinkles.
WINDOW = 1 / 8
# A texture is misaligned where it lies this far off (texels of FLOW_SIZE) and warping takes away this much of the
# difference in detail at the median place. Shifts of a texel gave 0.28 to 0.76 on seven sets; aligned textures 0.09 at
# most, 0.21 where there is little but wrinkles to follow (a displacement map, 56 texels). The share of the whole image,
# which a few strong wrinkles govern, gave 0.20 to 0.65 and up to 0.28.
SHIFT_TEXELS = 0.6
GAIN = 0.24


@dataclass(frozen=True)
class Shift:
    """How far a texture lies off the neutral: flow (h, w, 2) in texels, x and y; median and 95th percentile of its
    length over covered texels; gain, the share of the difference in fine detail that warping takes away, at the median
    place."""

    flow: np.ndarray
    median: float
    p95: float
    gain: float
    misaligned: bool

    def without_flow(self):
        """The figures alone."""
        return replace(self, flow=np.zeros((0, 0, 2), np.float32))


def measure_shift(neutral, texture, covered):
    """Shift of a texture (h, w, C) against the neutral, over covered (h, w) texels.

    raises InputError where OpenCV is missing
    """
    cv2 = _cv2()
    height, width = covered.shape
    scale = min(1.0, FLOW_SIZE / max(height, width))
    size = (max(16, round(width * scale)), max(16, round(height * scale)))
    one, other = (cv2.resize(_detail_source(image), size, interpolation=cv2.INTER_AREA) for image in (neutral, texture))
    cover = cv2.resize(covered.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5
    if not cover.any():
        return Shift(np.zeros((height, width, 2), np.float32), 0.0, 0.0, 0.0, False)
    flow = _flow(cv2, _even(one, cover), _even(other, cover), max(size))
    length = np.hypot(flow[..., 0], flow[..., 1])[cover]
    before, after = (_detail_error(one, image, cover) for image in (other, _warp(cv2, other, flow)))
    gain = float(np.median(1 - np.sqrt(after / np.maximum(before, 1e-9))))
    p95 = float(np.quantile(length, 0.95))
    full = cv2.resize(flow, (width, height), interpolation=cv2.INTER_LINEAR) / np.float32(scale)
    return Shift(full, float(np.median(length) / scale), p95 / scale, gain, p95 > SHIFT_TEXELS and gain > GAIN)


def align_texture(texture, shift):
    """The texture (h, w, C) warped onto the neutral, same depth; Lanczos, borders repeated."""
    cv2 = _cv2()
    image = texture.reshape(*texture.shape[:2], -1)
    warped = _warp(cv2, image, shift.flow, cv2.INTER_LANCZOS4)
    return warped.reshape(texture.shape)


def _cv2():
    try:
        import cv2
    except ImportError:
        raise InputError("compress: finding misaligned textures needs OpenCV; pip install opencv-python") from None
    return cv2


def _detail_source(image):
    image = image.reshape(*image.shape[:2], -1)
    grey = image[:, :, :3].mean(axis=2, dtype=np.float32) if image.shape[2] >= 3 else image[:, :, 0].astype(np.float32)
    return grey * np.float32(255.0 / np.iinfo(image.dtype).max)


def _even(grey, cover, sigma=12.0):
    """uint8: light and hue taken out, contrast made even, what is not covered grey."""
    weight = gaussian_filter(cover.astype(np.float32), sigma) + 1e-3
    mean = gaussian_filter(grey * cover, sigma) / weight
    detail = (grey - mean) * cover
    spread = np.sqrt(gaussian_filter(detail**2, sigma) / weight) + 2.0
    return np.clip(128 + 48 * detail / spread, 0, 255).astype(np.uint8)


def _flow(cv2, one, other, size):
    """(h, w, 2) of Farneback 2003: quadratic forms averaged over a wide window, so that flat places follow others."""
    window = int(size * WINDOW) | 1
    flags = cv2.OPTFLOW_FARNEBACK_GAUSSIAN
    return cv2.calcOpticalFlowFarneback(one, other, None, 0.5, 4, window, 3, 7, 1.5, flags)


def _detail_error(one, other, cover):
    """Mean square of the difference in fine detail around every covered texel."""
    inner = (one - gaussian_filter(one, 4.0)) - (other - gaussian_filter(other, 4.0))
    return uniform_filter(inner**2 * cover, int(max(cover.shape) * WINDOW))[cover]


def _warp(cv2, image, flow, method=None):
    y, x = np.mgrid[: flow.shape[0], : flow.shape[1]].astype(np.float32)
    method = cv2.INTER_LINEAR if method is None else method
    return cv2.remap(image, x + flow[..., 0], y + flow[..., 1], method, borderMode=cv2.BORDER_REPLICATE)
