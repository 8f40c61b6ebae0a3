"""Textures as they lie on a disk: every bit is kept or the file is refused, and notes of the system are no images."""

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from facewright.compress.files import list_textures, read_texture
from facewright.errors import InputError

GREY = np.arange(35, dtype=np.uint8).reshape(5, 7)


def test_grey_with_alpha_and_palettes_that_are_seen_through_keep_their_alpha(tmp_path):
    pair = np.dstack([GREY, GREY[::-1]])
    Image.fromarray(pair, "LA").save(tmp_path / "la.png")
    got = read_texture(tmp_path / "la.png")
    assert (got[:, :, :3] == GREY[:, :, None]).all() and (got[:, :, 3] == pair[:, :, 1]).all()
    palette = Image.fromarray(GREY % 2, "P")
    palette.putpalette([10, 20, 30, 40, 50, 60])
    palette.save(tmp_path / "p.png", transparency=1)
    got = read_texture(tmp_path / "p.png")
    assert (got[:, :, 3] == 255 * (1 - GREY % 2)).all() and tuple(got[0, 1, :3]) == (40, 50, 60)


def test_grey_of_16_bits_is_exact(tmp_path):
    deep = GREY.astype(np.uint16) * 1871
    for name in ("deep.png", "deep.tif"):
        Image.fromarray(deep).save(tmp_path / name)
        assert (read_texture(tmp_path / name)[:, :, 0] == deep).all()


def deep_png(path):
    rows = b"".join(b"\0" + bytes(6 * 7) for _ in range(5))
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", 7, 5, 16, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    data = b"".join(struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + data)


def test_what_would_lose_bits_is_refused(tmp_path):
    deep_png(tmp_path / "deep.png")
    Image.fromarray(GREY.astype(np.int32) * 100000).save(tmp_path / "integers.tif")
    Image.fromarray(GREY.astype(np.float32)).save(tmp_path / "floats.tif")
    for name in ("deep.png", "integers.tif", "floats.tif"):
        with pytest.raises(InputError, match="save it as"):
            read_texture(tmp_path / name)


def test_hidden_files_are_no_textures(tmp_path):
    for name in ("smile.png", "._smile.png"):
        (tmp_path / name).write_bytes(b"")
    assert [path.name for path in list_textures(tmp_path, tmp_path / "neutral.png")] == ["smile.png"]


def test_images_beyond_pillows_own_limit_keep_their_alpha(tmp_path, monkeypatch):
    Image.fromarray(np.dstack([GREY] * 4)).save(tmp_path / "large.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 10)
    assert read_texture(tmp_path / "large.png").shape == (5, 7, 4)
