"""Textures cut into tiles between weight texels, where the GPU's bilinear upsampling is one constant matrix.

A weight map is stored eight times smaller, or four times where that pays. Every texel of the full map lies between the
centres of four weight texels (cells); the P = 8 x 8 (or 4 x 4) texels that share the same four are a tile. Upsampling
is then, for every tile alike, w(p) = sum over c of B[c, p] w_c with a constant B (4, P), and all sums over texels
become small matrix products.
"""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from facewright.errors import InputError

# Texels along a weight texel: as published, and the finer choice.
CELL, FINE_CELL = 8, 4
CLAIM = 1 << 24


def bilinear_basis(cell=CELL):
    """B (4, P) float32: share of the corner cells (top left, top right, bottom left, bottom right) in each texel."""
    t = (np.arange(cell) + 0.5) / cell
    line = np.stack([1 - t, t])
    return np.einsum("ay,bx->abyx", line, line).reshape(4, -1).astype(np.float32)


@dataclass(frozen=True)
class Grid:
    """Sizes of a texture: height, width in texels; rows, columns of cells of so many texels; tiles are one more each
    way."""

    height: int
    width: int
    cell: int = CELL

    @property
    def texels(self):
        """Texels of a tile."""
        return self.cell * self.cell

    @property
    def cells(self):
        """(rows, columns) of the weight map."""
        return -(-self.height // self.cell), -(-self.width // self.cell)

    @property
    def tiles(self):
        """(rows, columns) of tiles."""
        rows, columns = self.cells
        return rows + 1, columns + 1

    def cut(self, image, first=0, last=None):
        """(tiles in rows first..last, C, P) of an image (h, w, C); outside the image the tiles hold 0."""
        rows, columns = self.tiles
        last = rows if last is None else last
        channels, cell, half = image.shape[2], self.cell, self.cell // 2
        padded = np.zeros(((last - first) * cell, columns * cell, channels), image.dtype)
        top = min(max(first * cell - half, 0), self.height)
        bottom = min(last * cell - half, self.height)
        start = top - (first * cell - half)
        padded[start : start + bottom - top, half : half + self.width] = image[top:bottom]
        tiles = padded.reshape(last - first, cell, columns, cell, channels).transpose(0, 2, 4, 1, 3)
        return tiles.reshape((last - first) * columns, channels, self.texels)

    def join(self, tiles):
        """(h, w, C) of all tiles (T, C, P)."""
        rows, columns = self.tiles
        channels, cell, half = tiles.shape[1], self.cell, self.cell // 2
        image = tiles.reshape(rows, columns, channels, cell, cell).transpose(0, 3, 1, 4, 2)
        image = image.reshape(rows * cell, columns * cell, channels)
        return np.ascontiguousarray(image[half : half + self.height, half : half + self.width])

    def corner_cells(self):
        """(T, 4) index of the four cells around each tile; cells beyond the border are the border's own (clamp)."""
        rows, columns = self.cells
        y = np.clip(np.arange(-1, rows + 1), 0, rows - 1)
        x = np.clip(np.arange(-1, columns + 1), 0, columns - 1)
        top, left = y[:-1], x[:-1]
        bottom, right = y[1:], x[1:]
        corners = [top[:, None] * columns + left, top[:, None] * columns + right]
        corners += [bottom[:, None] * columns + left, bottom[:, None] * columns + right]
        return np.stack([corner.ravel() for corner in corners], axis=1)

    def upsample(self, weights):
        """(h, w, k) float32 of a weight map (rows, columns, k), bilinear and clamped as a GPU reads it."""
        # One axis after the other: the same numbers, a quarter of the work.
        down = _upsample_axis(weights.astype(np.float32), self.height, 0, self.cell)
        return _upsample_axis(down, self.width, 1, self.cell)


def _upsample_axis(values, size, axis, cell):
    place = (np.arange(size) + 0.5) / cell - 0.5
    lower = np.floor(place).astype(np.int64)
    share = (place - lower).astype(np.float32)
    count = values.shape[axis]
    low = np.take(values, np.clip(lower, 0, count - 1), axis=axis)
    high = np.take(values, np.clip(lower + 1, 0, count - 1), axis=axis)
    shape = [1, 1, 1]
    shape[axis] = size
    return low + (high - low) * share.reshape(shape)


@contextmanager
def scratch_file(size, limit):
    """An open scratch file of so many bytes, or None where size is within the limit.

    It has no name where the system allows that, so that not even a killed process leaves it behind.
    """
    if size <= limit:
        yield None
        return
    with tempfile.TemporaryFile(prefix="facezip-") as stream:
        try:
            # The space is claimed now: a full disk met while writing to mapped memory would end the process.
            for _ in range(-(-size * 5 // 4 // CLAIM)):
                stream.write(bytes(CLAIM))
            stream.flush()
        except OSError as error:
            raise InputError(
                f"compress: {size / 1e9:.0f} GB of scratch space are needed in {tempfile.gettempdir()} "
                f"({error.strerror}); free space or set TMPDIR to another disk"
            ) from error
        yield stream


class TextureTiles:
    """All textures of a set in tiles, 8 or 16 bits a channel as given; differences are made chunk by chunk.

    neutral   (h, w, C) uint8 or uint16
    count     number of textures that put() may bring
    scale     (h, w) float32: 0 where no triangle covers the texel, else the square root of its priority
    scratch   open file to keep the tiles in instead of memory, so that memory does not grow with N
    levels    (C,) largest code that a channel is stored with
    cell      texels along a weight texel
    """

    def __init__(self, neutral, count, scale, scratch=None, levels=None, cell=CELL):
        self.shape = neutral.shape
        most = np.iinfo(neutral.dtype).max
        self.levels = np.full(neutral.shape[2], most) if levels is None else np.asarray(levels)
        self.gain = np.ones((neutral.shape[2], 1), np.float32)  # how much a difference of a channel counts
        self.emphasis = None  # (N, 1) float32, how much a texture's differences count; None: all alike
        height, width, self.channels = neutral.shape
        self.grid = Grid(height, width, cell)
        self.count = count
        self.unit = 255.0 / np.iinfo(neutral.dtype).max
        rows, columns = self.grid.tiles
        shape = (rows * columns, count, self.channels, self.grid.texels)
        if scratch is None:
            self.data = np.empty(shape, neutral.dtype)
        else:
            self.data = np.memmap(scratch, neutral.dtype, "r+", shape=shape)
        self.neutral = self.grid.cut(neutral)
        self.scale = self.grid.cut(scale.astype(np.float32)[:, :, None])

    @classmethod
    def of(cls, neutral, textures, covered):
        """All of a list of textures, texels outside covered (h, w) left out."""
        tiles = cls(neutral, len(textures), covered.astype(np.float32))
        for n, texture in enumerate(textures):
            tiles.put(n, texture)
        return tiles

    def put(self, n, texture):
        """Cut texture n."""
        rows, columns = self.grid.tiles
        for row in range(rows):
            self.data[row * columns : (row + 1) * columns, n] = self.grid.cut(texture, row, row + 1)

    def recut(self, cell, scratch=None):
        """The same textures in tiles of another size."""
        neutral, scale = self.grid.join(self.neutral), self.grid.join(self.scale)[:, :, 0]
        tiles = TextureTiles(neutral, self.count, scale, scratch, self.levels, cell)
        tiles.gain, tiles.emphasis = self.gain, self.emphasis
        for n in range(self.count):
            tiles.put(n, self.grid.join(self.data[:, n]))
        return tiles

    def keep(self, count):
        """Only the first textures."""
        self.data, self.count = self.data[:, :count], count

    def balance(self, channels):
        """Let the maps of so many channels each, side by side in one image, count alike, as much as the first."""
        squares = np.zeros(self.channels)
        for part in self.chunks():
            x = self.differences(part).reshape(-1, self.channels, self.grid.texels)
            squares += np.einsum("ncp,ncp->c", x, x, dtype=np.float64)
        first = np.cumsum([0, *channels[:-1]])
        rms = np.sqrt(np.add.reduceat(squares, first) / channels)
        gain = np.where(rms > 0, rms[0] / np.where(rms > 0, rms, 1), 1) if rms[0] > 0 else np.ones(len(rms))
        self.gain = np.repeat(gain, channels).astype(np.float32)[:, None]

    def __len__(self):
        return len(self.data)

    def chunks(self, size=96):
        """Slices of tiles that fit the processor's cache."""
        size = max(8, size * 20 // max(self.count, 20) * (CELL * CELL) // self.grid.texels)
        return [slice(start, min(start + size, len(self))) for start in range(0, len(self), size)]

    def covered_chunks(self, every=1):
        """Indices, chunk by chunk, of the tiles that hold a covered texel, or of every so many of them."""
        tiles = np.flatnonzero(self.scale.any(axis=(1, 2)))[::every]
        size = self.chunks()[0].stop
        return [tiles[start : start + size] for start in range(0, len(tiles), size)]

    def differences(self, part, whole=False):
        """(tiles, N, C * P) float32 in 0-255, times emphasis, scale and gain; whole: uncovered texels too, without
        scale and gain."""
        x = self.data[part].astype(np.float32)
        x -= self.neutral[part, None].astype(np.float32)
        x *= np.float32(self.unit) if whole else self.scale[part, None] * (self.gain * np.float32(self.unit))
        x = x.reshape(len(x), self.count, -1)
        if self.emphasis is not None:
            x *= self.emphasis
        return x
