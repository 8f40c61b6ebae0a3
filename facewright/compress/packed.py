"""Packed: what is stored (integers with a step and a zero each), and what decoding makes of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from facewright.compress.tiles import CELL, Grid
from facewright.errors import InputError

LARGEST_SIDE = 16384


@dataclass(frozen=True)
class Packed:
    """A compressed set. A stored code q means (q - zero) * step, in 0-255 units for textures whatever their depth.

    neutral       (h, w, C) uint8 or uint16
    textures      (K, h, w, C) codes like neutral; texture_step, texture_zero (K, C)
    weights       (L, rows, columns, K) uint8 codes; weight_step, weight_zero (L, K)
    names         of the N expressions; layers (N,) the weight map of each (equal textures share one)
    cell          texels along a weight texel: 8 as published, or 4
    report        numbers of the encoder
    """

    neutral: np.ndarray
    textures: np.ndarray
    texture_step: np.ndarray
    texture_zero: np.ndarray
    weights: np.ndarray
    weight_step: np.ndarray
    weight_zero: np.ndarray
    names: tuple[str, ...]
    layers: np.ndarray
    cell: int = CELL
    report: dict = field(default_factory=dict)

    @property
    def grid(self):
        """The lattice of texels and cells."""
        return Grid(*self.neutral.shape[:2], self.cell)

    @property
    def unit(self):
        """0-255 units of one code of the neutral."""
        return 255.0 / np.iinfo(self.neutral.dtype).max

    def difference_textures(self):
        """(K, h, w, C) float32, 0-255 units."""
        zero = self.texture_zero[:, None, None].astype(np.float32)
        return (self.textures.astype(np.float32) - zero) * self.texture_step[:, None, None].astype(np.float32)

    def weight_maps(self):
        """(L, rows, columns, K) float32."""
        zero = self.weight_zero[:, None, None].astype(np.float32)
        return (self.weights.astype(np.float32) - zero) * self.weight_step[:, None, None].astype(np.float32)

    def memory_bytes(self):
        """Bytes on a graphics card without block compression: RGB or what the maps have, weights four to an RGBA."""
        return memory_bytes([self.neutral], len(self.textures), len(self.weights), cell=self.cell)


def weight_places(layers, k):
    """(layers, K, 2): the place of every weight in the atlas, and its channel there.

    A layer has a place of its own with a channel for each difference texture (the fifth and on are in a second image);
    with three difference textures, four layers lie in three places, so that no channel is left empty.
    """
    if k == 3:
        channel = np.arange(3 * layers).reshape(layers, 3)
        return np.stack([channel // 4, channel % 4], axis=2)
    layer, channel = np.meshgrid(np.arange(layers), np.arange(k) % 4, indexing="ij")
    return np.stack([layer, channel], axis=2)


def place_count(layers, k):
    """Places that so many weight maps of K difference textures take."""
    return -(-3 * layers // 4) if k == 3 else layers


def atlas_shape(count, rows, columns):
    """(across, down) places of an atlas: place n lies at (n % across, n // across)."""
    fits = [
        (across * -(-count // across), max(across * columns, -(-count // across) * rows), across)
        for across in range(1, count + 1)
        if across * columns <= LARGEST_SIDE and -(-count // across) * rows <= LARGEST_SIDE
    ]
    if not fits:
        raise InputError(
            f"compress: {count} weight maps of {columns} x {rows} do not fit an image of {LARGEST_SIDE}; "
            "split the set or use smaller textures"
        )
    across = min(fits)[2]
    return across, -(-count // across)


def memory_bytes(neutrals, k, layers, sets=1, cell=CELL):
    """Bytes of maps with neutrals like these and k difference textures each, and of so many sets of weight maps."""
    rows, columns = Grid(*neutrals[0].shape[:2], cell).cells
    across, down = atlas_shape(place_count(layers, k), rows, columns)
    images = sum(neutral.nbytes for neutral in neutrals)
    return int(images * (1 + k) + sets * across * down * -(-k // 4) * 4 * rows * columns)


def textures_within(budget, neutrals, layers, most, sets=1):
    """The most difference textures of every map whose bytes (memory_bytes) stay within the budget; InputError where
    one does not."""
    for k in range(most, 0, -1):
        if memory_bytes(neutrals, k, layers, sets) <= budget:
            return k
    least = memory_bytes(neutrals, 1, layers, sets)
    raise InputError(
        f"compress: a budget of {budget / 1e6:.4g} MB is too small; one difference texture needs {least / 1e6:.4g} MB, "
        "so give a larger budget or smaller textures"
    )


def facezip_decode(packed, weights):
    """The texture of a blend (Eq. 8): neutral + sum_i D_i U(sum_n b_n W_in), clipped and rounded to the stored depth.

    weights  dict name -> weight, or (N,) array in the order of packed.names
    returns  (h, w, C) like packed.neutral
    raises   InputError for a name that is not in the set, or weights too large to add up
    """
    with np.errstate(over="ignore", invalid="ignore"):
        image = decode_float(packed, weights)
    if not np.isfinite(image).all():
        raise InputError("decompress: these weights are too large to blend; 0 to 1 is usual")
    return np.rint(np.clip(image, 0, 255) / packed.unit).astype(packed.neutral.dtype)


def decode_float(packed, weights, textures=None):
    """As facezip_decode, in 0-255 units, neither clipped nor rounded; textures (K, h, w, C) if already at hand."""
    beta = blend_vector(packed, weights)
    per_layer = np.bincount(packed.layers, weights=beta, minlength=len(packed.weights))
    used = np.flatnonzero(per_layer)
    image = packed.neutral.astype(np.float32) * np.float32(packed.unit)
    if not len(used):
        return image
    maps = (packed.weights[used].astype(np.float32) - packed.weight_zero[used, None, None]) * (
        packed.weight_step * per_layer[:, None]
    )[used, None, None]
    full = packed.grid.upsample(maps.sum(axis=0).astype(np.float32))
    textures = packed.difference_textures() if textures is None else textures
    for i in range(len(textures)):
        image += textures[i] * full[:, :, i, None]
    return image


def blend_vector(packed, weights):
    """(N,) weights from a dict of names or an array."""
    if not isinstance(weights, dict):
        beta = np.asarray(weights, dtype=np.float64)
        if beta.shape != (len(packed.names),):
            raise ValueError(f"weights have shape {beta.shape}, expected ({len(packed.names)},)")
        return beta
    beta = np.zeros(len(packed.names))
    for name, value in weights.items():
        if name not in packed.names:
            known = ", ".join(packed.names[:12]) + (", ..." if len(packed.names) > 12 else "")
            raise InputError(f"decompress: the set has no expression {name!r}; it has {known}")
        beta[packed.names.index(name)] = value
    return beta


def code_scale(low, high, levels):
    """Step and zero of codes 0 to levels for values between low and high, with 0 itself a code."""
    low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    step = (high - low) / levels
    step = np.where(step > 0, step, 1.0)
    return step, np.rint(-low / step)


def nearest_codes(values, step, zero, levels):
    """Codes 0 to levels (float, whole numbers) nearest to values (float32)."""
    return np.clip(np.rint(values / step.astype(np.float32) + zero.astype(np.float32)), 0, levels)


def quantise(values, low, high, levels, dtype):
    """Integer codes 0 to levels of values between low and high (broadcast), with 0 itself a code: codes, step, zero."""
    step, zero = code_scale(low, high, levels)
    return nearest_codes(values, step, zero, levels).astype(dtype), step, zero


def example_weights(packed, B):
    """Weight maps (M, rows, columns, K) of M example-based shapes: W* = B+ W (Eq. 11).

    B  (N, M), row n: what blend of the shapes makes expression n (Eq. 9); the pseudo-inverse is the one of least
       norm, so Eq. 10 holds wherever B has full row rank
    """
    B = np.asarray(B, dtype=np.float64)
    if B.ndim != 2 or B.shape[0] != len(packed.names):
        raise ValueError(f"B has shape {B.shape}, expected ({len(packed.names)}, M)")
    maps = packed.weight_maps()[packed.layers].astype(np.float64)
    return np.tensordot(np.linalg.pinv(B), maps, 1)


def with_examples(packed, shapes, B):
    """The Packed whose expressions are example-based shapes (names, M of them): weight maps of Eq. 11, 8 bits each."""
    maps = example_weights(packed, B)
    low, high = (f(maps, axis=(1, 2))[:, None, None] for f in (np.min, np.max))
    codes, step, zero = quantise(maps, low, high, 255, np.uint8)
    back = np.tensordot(np.asarray(B, float), (codes - zero) * step, 1)
    report = {
        **packed.report,
        "shapes": len(shapes),
        "full_row_rank": bool(np.linalg.matrix_rank(B) == len(packed.names)),
        # Eq. 10: how far blends of the shapes are from the textures' own weight maps
        "largest_weight_error": float(np.abs(back - packed.weight_maps()[packed.layers]).max()),
    }
    return replace(
        packed,
        weights=codes,
        weight_step=step[:, 0, 0],
        weight_zero=zero[:, 0, 0],
        names=tuple(shapes),
        layers=np.arange(len(shapes)),
        report=report,
    )


def naive_example(neutral, textures, B, m):
    """Shape m by blending whole textures, the baseline of Fig. 8: I_0 + sum_n B+_mn (I_n - I_0); (h, w, C) float."""
    share = np.linalg.pinv(np.asarray(B, dtype=np.float64))[m]
    image = neutral.astype(np.float64)
    for weight, texture in zip(share, textures):
        image = image + weight * (texture.astype(np.float64) - neutral)
    return image


__all__ = [
    "Packed",
    "blend_vector",
    "decode_float",
    "example_weights",
    "facezip_decode",
    "naive_example",
    "with_examples",
]
