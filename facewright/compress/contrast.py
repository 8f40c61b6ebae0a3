"""Local contrast of finer weight maps, made the same at every place of a weight texel.

Two texels on both sides of a weight texel's middle share nearly the same weights, two between the middles do not. Of
the difference between neighbours the solution therefore keeps less at the former: on 20 unrelated faces with weight
maps at a quarter, gradients there are 4 % (blends) to 6 % (single textures) below those elsewhere, a lattice of four
texels. Before rounding, the contrast of neighbours in the difference textures is scaled, by a share for each place on
the lattice and each axis that makes the gradients' ratio to the originals' the same everywhere. It costs 0.01 of the
RMSE 2.53, since the error is flat around its minimum. Smoother weights or another place of the lattice do not help.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from facewright.compress.refine import Pass
from facewright.compress.threads import THREADS, in_threads

# Texels (in windows of so many tiles a side), single textures and blends of three that tell the ratios, and the rounds
# in which the shares are found. Single textures lack more than blends.
SAMPLE, SIDE, SINGLE, BLENDS, ROUNDS = 1 << 16, 8, 4, 16, 3
# What the squared error may grow by. Where textures are smooth their slopes would be scaled, not their grain: without a
# bound fields blurred by 4 texels lose a tenth of their accuracy.
MAY_LOSE = 0.01


def even_contrast(tiles, weights, d):
    """Difference textures whose blends have the same contrast, relative to the originals', all over a weight texel.

    weights  (rows, columns, N, K) float32
    d        (T, K, C, P) float32 in tiles, 0-255
    returns  like d
    """
    grid = tiles.grid
    blends, work = _blends(tiles.count), Pass(tiles, weights.shape[-1])
    mixed = blends @ weights.reshape(-1, *weights.shape[2:])  # (cells, M, K)
    windows = _windows(tiles)
    originals = [_originals(tiles, blends, window) for window in windows]
    wanted = np.zeros((2, grid.cell)) + sum(_gradients(image, inside, grid.cell) for image, inside in originals)

    def scaled(window, shares):
        """Tiles of a window, from those and one more on every side."""
        wide = [slice(max(side.start - 1, 0), min(side.stop + 1, most)) for side, most in zip(window, grid.tiles)]
        inner = [slice((a.start - b.start) * grid.cell, (a.stop - b.start) * grid.cell) for a, b in zip(window, wide)]
        part = _part(grid, wide)
        image = scaled_contrast(_image(d[part]), _image(tiles.scale[part])[0] > 0, shares)
        return _tiles(image[:, inner[0], inner[1]], grid.cell).reshape(-1, *d.shape[1:])

    def measured(shares):
        """Gradients as _gradients() sums them, and the squared error of the single textures."""
        gradients, squares = np.zeros_like(wanted), 0.0
        for window, (original, inside) in zip(windows, originals):
            part = _part(grid, window)
            x = work.blended(mixed, part.ravel(), scaled(window, shares))
            image = _with_neutral(tiles, x, part)
            gradients += _gradients(image, inside, grid.cell)
            error = (image - original)[: -BLENDS * tiles.channels] * inside
            squares += float(np.vdot(error, error))
        return gradients * (wanted > 0), squares

    shares = np.zeros((2, grid.cell))
    found, least = measured(shares)
    for _ in range(ROUNDS):
        aim = wanted * (found.sum(axis=1) / np.maximum(wanted.sum(axis=1), 1e-30))[:, None]
        shares += np.divide(aim, found, out=np.ones_like(found), where=found > 0) - 1
        found, squares = measured(shares)
    # The loss goes with the square of the shares.
    shares *= min(1.0, np.sqrt(MAY_LOSE * least / max(squares - least, 1e-30)))
    rows, columns = grid.tiles
    edges = np.linspace(0, rows, min(rows, 8 * THREADS) + 1).astype(int)
    bands = [(slice(*band), slice(0, columns)) for band in pairwise(edges)]
    return np.concatenate(in_threads(lambda band: scaled(band, shares), bands))


def scaled_contrast(image, covered, shares):
    """Image (C, h, w) with the differences of covered (h, w) neighbours scaled by 1 + share, to first order.

    shares  (2, cell): of x and y; number p is of the texels p - 1 and p of a tile (0: across a weight texel's middle),
            and the image begins with a tile
    """
    result = image.copy()
    for axis, share in ((2, shares[0]), (1, shares[1])):
        first, second = _neighbours(axis)
        place = np.arange(1, image.shape[axis]) % len(share)
        half = np.expand_dims(0.5 * share[place].astype(np.float32), (0, 3 - axis)) * (image[second] - image[first])
        half *= covered[second[1:]] & covered[first[1:]]
        result[second] += half
        result[first] -= half
    return result


def _neighbours(axis):
    """Indices of the first and the second of all pairs of neighbours along axis 1 or 2 of an image (C, h, w)."""
    first, second = [slice(None)] * 3, [slice(None)] * 3
    first[axis], second[axis] = slice(None, -1), slice(1, None)
    return tuple(first), tuple(second)


def _gradients(image, inside, cell):
    """(2, cell) sums of the absolute differences between covered neighbours, by axis (x, y) and place in the tile."""
    sums = []
    for axis in (2, 1):
        first, second = _neighbours(axis)
        steps = np.abs(image[second] - image[first]).sum(axis=0) * (inside[second[1:]] & inside[first[1:]])
        sums.append(np.bincount(np.arange(1, image.shape[axis]) % cell, steps.sum(axis=2 - axis), cell))
    return np.array(sums)


def _blends(count):
    """(M, N) float32 weights: single textures, then BLENDS of three."""
    rng = np.random.default_rng(0)
    single = np.unique(np.linspace(0, count - 1, SINGLE).astype(int))
    blends = np.zeros((len(single) + BLENDS, count), np.float32)
    blends[range(len(single)), single] = 1
    for row in blends[len(single) :]:
        chosen = rng.choice(count, min(3, count), replace=False)
        row[chosen] = rng.uniform(0.2, 0.6, len(chosen))
    return blends


def _windows(tiles):
    """Windows (rows, columns) of SIDE x SIDE tiles, evenly chosen of those that hold a covered texel."""
    rows, columns = tiles.grid.tiles
    covered = tiles.scale.any(axis=(1, 2)).reshape(rows, columns)
    windows = [
        (slice(y, min(y + SIDE, rows)), slice(x, min(x + SIDE, columns)))
        for y in range(0, rows, SIDE)
        for x in range(0, columns, SIDE)
    ]
    windows = [window for window in windows if covered[window].any()]
    count = min(len(windows), SAMPLE // (SIDE * SIDE * tiles.grid.texels))
    return [windows[n] for n in np.linspace(0, len(windows) - 1, count).astype(int)]


def _part(grid, window):
    """(rows, columns) indices of the tiles of a window."""
    return np.arange(np.prod(grid.tiles)).reshape(grid.tiles)[window[0], window[1]]


def _originals(tiles, blends, window):
    """Blends (M C, h, w) of the textures in a window, and which of its texels are covered."""
    part = _part(tiles.grid, window)
    x = blends @ tiles.differences(part.ravel(), whole=True)
    x = x.reshape(part.size, len(blends), tiles.channels, -1)
    return _with_neutral(tiles, x, part), _image(tiles.scale[part])[0] > 0


def _with_neutral(tiles, x, part):
    """Image (M C, h, w) of differences (t, M, C, P) of the tiles in part (rows, columns)."""
    x = x.reshape(*part.shape, *x.shape[1:]) + tiles.neutral[part][:, :, None] * np.float32(tiles.unit)
    return _image(x)


def _image(tiles):
    """(C, h, w) of tiles (rows, columns, ..., P), all between in C."""
    rows, columns = tiles.shape[:2]
    cell = round(tiles.shape[-1] ** 0.5)
    x = tiles.reshape(rows, columns, -1, cell, cell).transpose(2, 0, 3, 1, 4)
    return x.reshape(-1, rows * cell, columns * cell)


def _tiles(image, cell):
    """(t, C, P) of an image (C, h, w) as _image() gives it."""
    channels, height, width = image.shape
    x = image.reshape(channels, height // cell, cell, width // cell, cell).transpose(1, 3, 0, 2, 4)
    return x.reshape(-1, channels, cell * cell)
