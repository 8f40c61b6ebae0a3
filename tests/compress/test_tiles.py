"""Tiles: cutting and joining for every size, and the constant basis against the upsampling of a weight map."""

import io

import numpy as np
import pytest

from facewright.compress.tiles import Grid, TextureTiles, bilinear_basis, scratch_file
from facewright.errors import InputError


@pytest.mark.parametrize("cell", [4, 8])
@pytest.mark.parametrize("height", [1, 3, 4, 5, 8, 11, 12, 13, 16, 203])
def test_what_is_cut_joins_again_row_by_row_too(height, cell):
    image = np.random.default_rng(0).integers(0, 255, (height, 21, 2)).astype(np.uint8)
    grid = Grid(height, 21, cell)
    whole = grid.cut(image)
    assert (grid.join(whole) == image).all()
    rows = [grid.cut(image, row, row + 1) for row in range(grid.tiles[0])]
    assert (np.concatenate(rows) == whole).all()


@pytest.mark.parametrize("cell", [4, 8])
@pytest.mark.parametrize("size", [(16, 24), (19, 13)])
def test_the_basis_is_the_upsampling_of_the_graphics_card(size, cell):
    grid = Grid(*size, cell)
    weights = np.random.default_rng(0).random((*grid.cells, 3)).astype(np.float32)
    corners = weights.reshape(-1, 3)[grid.corner_cells()]
    tiles = np.einsum("tck,cp->tkp", corners, bilinear_basis(cell))
    assert np.abs(grid.join(tiles) - grid.upsample(weights)).max() < 1e-6


def test_finer_tiles_hold_the_same_textures():
    rng = np.random.default_rng(0)
    neutral, *textures = rng.integers(0, 255, (4, 20, 30, 3)).astype(np.uint8)
    covered = rng.random((20, 30)) < 0.7
    fine = TextureTiles.of(neutral, textures, covered).recut(4)
    assert fine.grid.cell == 4 and (fine.grid.join(fine.neutral) == neutral).all()
    assert ((fine.grid.join(fine.scale)[:, :, 0] > 0) == covered).all()
    for n, texture in enumerate(textures):
        assert (fine.grid.join(fine.data[:, n]) == texture).all()


def test_tiles_in_a_scratch_file_are_those_in_memory(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    neutral, *textures = rng.integers(0, 255, (4, 20, 30, 3)).astype(np.uint8)
    memory = TextureTiles.of(neutral, textures, np.ones((20, 30), bool))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with scratch_file(memory.data.nbytes, 0) as stream:
        filed = TextureTiles(neutral, 3, np.ones((20, 30), np.float32), stream)
        for n, texture in enumerate(textures):
            filed.put(n, texture)
        filed.keep(2)
        assert (filed.data == memory.data[:, :2]).all() and filed.count == 2
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_one_sentence(monkeypatch):
    class Full(io.BytesIO):
        def write(self, data):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryFile", lambda prefix: Full())
    with pytest.raises(InputError, match="No space left on device"), scratch_file(10**9, 0):
        pass
