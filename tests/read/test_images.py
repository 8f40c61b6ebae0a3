"""Images: every mode becomes RGB, every fault a sentence."""

import io

import numpy as np
import pytest
from PIL import Image

from facewright.errors import InputError
from facewright.read import images


def encoded(image, kind="PNG"):
    file = io.BytesIO()
    image.save(file, kind)
    return file.getvalue()


def test_modes():
    rgba = Image.new("RGBA", (3, 2), (10, 20, 30, 0))
    assert images.decode_image(encoded(rgba), "x").tolist() == [[[10, 20, 30]] * 3] * 2
    palette = Image.new("RGB", (2, 2), (1, 2, 3)).convert("P", palette=Image.Palette.ADAPTIVE)
    assert images.decode_image(encoded(palette), "x")[0, 0].tolist() == [1, 2, 3]
    deep = Image.fromarray(np.full((2, 2), 0x1234, np.uint16))
    assert images.decode_image(encoded(deep), "x").tolist() == [[[0x12] * 3] * 2] * 2
    assert images.decode_image(encoded(Image.new("CMYK", (2, 2)), "JPEG"), "x").shape == (2, 2, 3)


def test_rows_from_the_top(tmp_path):
    pixels = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    assert np.array_equal(images.read_image(tmp_path / "a.png"), pixels)


def test_bad_input(tmp_path, monkeypatch):
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)
    whole = encoded(Image.fromarray(noise))
    for data, word in (
        (b"", "cannot be decoded"),
        (b"no image", "cannot be decoded"),
        (whole[: len(whole) // 2], "cannot be decoded"),
        (encoded(Image.new("F", (2, 2)), "TIFF"), "floating-point"),
    ):
        with pytest.raises(InputError, match=word):
            images.decode_image(data, "skin.png")
    with pytest.raises(InputError, match="does not exist"):
        images.read_image(tmp_path / "gone.png")
    with pytest.raises(InputError, match="is a folder"):
        images.read_image(tmp_path)
    monkeypatch.setattr(images, "MAX_PIXELS", 100)
    with pytest.raises(InputError, match="64 x 64"):
        images.decode_image(whole, "skin.png")


def test_pillows_own_limit_is_left_as_it_was():
    before = Image.MAX_IMAGE_PIXELS
    images.decode_image(encoded(Image.new("RGB", (2, 2))), "x")
    assert before == Image.MAX_IMAGE_PIXELS
