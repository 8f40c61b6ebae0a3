"""KTX2: the container as the specification has it, blocks near the image, sizes that are no multiples of four."""

import struct

import numpy as np
import pytest

from facewright.compress.ktx2 import (
    IDENTIFIER,
    container,
    decode_blocks,
    encode_blocks,
    encoder_missing,
    mip_levels,
    raw_ktx2,
    texture_ktx2,
)


def smooth_image(height, width, channels=4):
    y, x = np.mgrid[:height, :width]
    image = np.stack([120 + 80 * np.sin(x / 9 + c) * np.cos(y / 7 + c) for c in range(channels)], axis=2)
    return np.rint(image).astype(np.uint8)


def read_levels(data):
    """Independent of the writer: fields at the offsets of the specification."""
    assert data[:12] == IDENTIFIER
    _, _, width, height, _, _, faces, count, scheme = struct.unpack_from("<9I", data, 12)
    assert faces == 1 and scheme == 0
    places = [struct.unpack_from("<3Q", data, 80 + 24 * i) for i in range(count)]
    return width, height, [data[offset : offset + length] for offset, length, _ in places]


def test_levels_come_back_and_are_aligned():
    levels = [bytes([i]) * (16 * 4**i) for i in (3, 2, 1, 0)]
    data = container(levels, "bc7", 32, 32)
    assert read_levels(data) == (32, 32, levels)
    assert all(struct.unpack_from("<Q", data, 80 + 24 * i)[0] % 16 == 0 for i in range(4))
    offset, length = struct.unpack_from("<2I", data, 48)
    assert struct.unpack_from("<I", data, offset)[0] == length


def test_mip_levels_average_the_image():
    image = smooth_image(20, 12)
    levels = mip_levels(image)
    assert [level.shape[:2] for level in levels] == [(20, 12), (10, 6), (5, 3), (2, 1), (1, 1)]
    assert np.abs(levels[1].astype(float) - image.reshape(10, 2, 6, 2, 4).mean(axis=(1, 3))).max() <= 0.51
    square = smooth_image(32, 32)
    assert np.abs(mip_levels(square)[-1] - square.mean(axis=(0, 1))).max() <= 1


def test_raw_images_and_16_bits_lose_nothing():
    image = smooth_image(5, 7)
    data, on_card = raw_ktx2(image)
    assert on_card == image.nbytes and read_levels(data)[2] == [image.tobytes()]
    deep = (np.arange(48).reshape(6, 8, 1) * 1000).astype(np.uint16)
    stored = np.frombuffer(read_levels(texture_ktx2(deep, "bc7")[0])[2][0], "<f4")
    assert (np.rint(stored * 65535).reshape(deep.shape) == deep).all()


@pytest.mark.parametrize("kind", ["bc7", "astc"])
@pytest.mark.parametrize("size", [(32, 48), (37, 50)])
def test_blocks_stay_near_the_image(kind, size):
    if encoder_missing(kind):
        pytest.skip("no encoder")
    image = smooth_image(*size)
    blocks = encode_blocks(image, kind)
    assert len(blocks) == 16 * -(-size[0] // 4) * -(-size[1] // 4)
    error = decode_blocks(blocks, kind, *size).astype(float) - image
    assert np.sqrt(np.mean(error**2)) < 3


def test_a_missing_encoder_is_one_sentence(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert "pip install 'facewright[ktx2]'" in encoder_missing("bc7")
