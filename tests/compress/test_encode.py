"""facezip(): limits, known structure, and agreement with its own decoder."""

import numpy as np
import pytest

from facewright.compress import FacezipOptions, example_weights, facezip, facezip_decode
from facewright.errors import InputError


def make_set(n=8, shape=(52, 70), channels=3, seed=0, dtype=np.uint8):
    """Textures with bumps at places shared between expressions."""
    rng = np.random.default_rng(seed)
    top = np.iinfo(dtype).max
    y, x = np.mgrid[: shape[0], : shape[1]]
    neutral = rng.integers(0.4 * top, 0.6 * top, (*shape, channels)).astype(dtype)
    images = []
    for _ in range(n):
        image = neutral.astype(float)
        for place in range(5):
            bump = np.exp(-((y - 10 * place - 5) ** 2 + (x - 13 * place - 7) ** 2) / 60.0)
            image += 0.2 * top * rng.normal() * (bump * np.sin(0.9 * x + place))[:, :, None]
        images.append(np.clip(np.rint(image), 0, top).astype(dtype))
    return neutral, images


def rmse(a, b):
    return np.sqrt(np.mean((a.astype(float) - b.astype(float)) ** 2))


@pytest.mark.parametrize("channels,dtype", [(1, np.uint8), (3, np.uint8), (4, np.uint8), (1, np.uint16)])
def test_one_texture_compresses_to_itself(channels, dtype):
    neutral, images = make_set(1, channels=channels, dtype=dtype)
    packed = facezip(neutral, images)
    step = packed.texture_step.max() / packed.unit
    assert np.abs(facezip_decode(packed, [1.0]).astype(int) - images[0]).max() <= 0.5 * step + 1


def test_as_many_textures_as_expressions_reproduce_them():
    neutral, images = make_set(4)
    packed = facezip(neutral, images)
    for n, image in enumerate(images):
        error = np.abs(facezip_decode(packed, np.eye(4)[n]).astype(int) - image).max()
        assert error <= 0.5 * packed.texture_step.max() + 1


def test_equal_textures_share_a_weight_map():
    neutral, images = make_set(3)
    assert len(facezip(neutral, images + images).weights) == 3


def test_textures_equal_to_the_neutral_decode_to_it():
    neutral, _ = make_set(1)
    packed = facezip(neutral, [neutral, neutral])
    assert (facezip_decode(packed, [1.0, 1.0]) == neutral).all()


def test_zero_weights_give_the_neutral_bit_for_bit():
    neutral, images = make_set(8)
    packed = facezip(neutral, images)
    assert (facezip_decode(packed, np.zeros(8)) == neutral).all()


def test_the_report_is_what_decoding_gives_and_better_than_constant_weights():
    neutral, images = make_set(12)
    packed = facezip(neutral, images)
    decoded = [rmse(facezip_decode(packed, np.eye(12)[n]), image) for n, image in enumerate(images)]
    assert np.abs(np.array(decoded) - list(packed.report["rmse"].values())).max() < 0.2
    constant = facezip(neutral, images, options=FacezipOptions(iterations=0))
    assert packed.report["mean_rmse"] < 0.7 * constant.report["mean_rmse"]


def test_a_kept_texture_is_exact():
    neutral, images = make_set(12)
    packed = facezip(neutral, images, names=[f"n{n}" for n in range(12)], keep=["n5"])
    assert packed.report["rmse"]["n5"] <= 0.5 * packed.texture_step[0].max()


def test_example_weights_reproduce_the_expressions():
    neutral, images = make_set(6)
    packed = facezip(neutral, images)
    B = np.random.default_rng(1).random((6, 11))
    back = np.tensordot(B, example_weights(packed, B), 1)
    assert np.abs(back - packed.weight_maps()[packed.layers]).max() < 1e-6


def test_bad_input_is_refused():
    neutral, images = make_set(3)
    with pytest.raises(InputError, match="export all textures alike"):
        facezip(neutral, [images[0][:-1]])
    with pytest.raises(InputError, match="clusters"):
        facezip(neutral, images, options=FacezipOptions(method="paper"))
    with pytest.raises(InputError, match="no such texture"):
        facezip(neutral, images, keep=["smile"])
