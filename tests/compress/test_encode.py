"""facezip(): limits, known structure, and agreement with its own decoder."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from facewright.compress import FacezipOptions, example_weights, facezip, facezip_decode
from facewright.compress.masks import build_masks
from facewright.compress.synthetic import expression_set
from facewright.compress.tiles import Grid
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
    assert len(packed.textures) == 1


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


def test_no_texture_is_worse_than_with_constant_weights():
    """Strengths of 0.3 to 27 codes: constant weights hold the strongest almost exactly; half a code is rounding."""
    rng = np.random.default_rng(7)
    neutral = np.full((128, 128, 3), 128, np.uint8)
    places = gaussian_filter(rng.standard_normal((16, 8, 128, 128)), (0, 0, 12, 12)) / 0.024
    grain = gaussian_filter(rng.standard_normal((8, 128, 128)), (0, 1, 1)) / 0.28
    fields = np.einsum("nphw,phw->nhw", places, grain) / np.sqrt(8)
    images = [128 + 0.3 * 1.35**n * field[:, :, None] * np.ones(3) for n, field in enumerate(fields)]
    images = [np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in images]
    constant = facezip(neutral, images, options=FacezipOptions("pca")).report
    packed = facezip(neutral, images).report
    assert packed["mean_rmse"] < 0.8 * constant["mean_rmse"]
    assert all(packed["rmse"][name] < max(constant["rmse"][name], 0.5) for name in constant["rmse"])


def test_what_four_textures_span_nearly_is_not_damped():
    """Five components of which the last is weak: the error is PCA(4) in float and the rounding of eight bits."""
    rng = np.random.default_rng(1)
    parts = gaussian_filter(rng.standard_normal((5, 96, 96, 3)), (0, 3, 3, 0))
    parts *= np.array([40, 25, 20, 20, 1.0])[:, None, None, None] / parts.std()
    images = [128 + np.tensordot(row, parts, 1) for row in rng.normal(0, 1, (16, 5)).clip(-0.7, 0.7)]
    images = [np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in images]
    neutral = np.full((96, 96, 3), 128, np.uint8)
    x = np.stack(images).reshape(16, -1) - 128.0
    left = np.linalg.eigvalsh(x @ x.T)[:-4].clip(0)
    float_rms = np.sqrt(left.sum() / x.size)
    constant, refined = (facezip(neutral, images, options=FacezipOptions(method)) for method in ("pca", "refined"))
    assert refined.report["mean_rmse"] < constant.report["mean_rmse"] < float_rms + 0.03


@pytest.mark.parametrize("shape", [(8, 8), (3, 2), (40, 7), (7, 40)])
def test_images_no_wider_than_a_weight_texel(shape):
    images = [np.random.default_rng(n).integers(0, 256, (*shape, 3)).astype(np.uint8) for n in range(12)]
    packed = facezip(images[0], images[1:])
    constant = facezip(images[0], images[1:], options=FacezipOptions("pca"))
    assert packed.report["mean_rmse"] <= constant.report["mean_rmse"] + 0.3


def unrelated(n, size=96, seed=0, blur=2):
    """A neutral and n textures of blurred noise each its own."""
    rng = np.random.default_rng(seed)
    fields = [gaussian_filter(rng.normal(0, 1, (size, size, 3)), (blur, blur, 0)) for _ in range(n + 1)]
    return [np.clip(128 + 200 * field, 0, 255).astype(np.uint8) for field in fields]


def test_unrelated_textures_take_finer_weights_in_no_more_memory_and_leave_less():
    neutral, *images = unrelated(20)
    published = facezip(neutral, images, options=FacezipOptions(textures=4))
    finer = facezip(neutral, images)
    assert (published.cell, published.memory_bytes()) == (8, (15 + 20 / 16) * 96 * 96)
    assert (finer.cell, len(finer.textures)) == (4, 3) and finer.memory_bytes() <= published.memory_bytes()
    assert finer.report["mean_rmse"] < 0.95 * published.report["mean_rmse"]
    for n, image in enumerate(images):
        told = finer.report["rmse"][f"texture{n}"]
        assert abs(rmse(facezip_decode(finer, np.eye(20)[n]), image) - told) < 0.02 * told


@pytest.mark.parametrize("n,shapes", [(28, None), (20, 60)])
def test_finer_weights_never_take_more_memory(n, shapes):
    neutral, *images = unrelated(n, 48)
    packed = facezip(neutral, images, options=FacezipOptions(shapes=shapes))
    assert (packed.cell, len(packed.textures)) == (8, 4)


def test_finer_weights_are_open_to_a_budget_that_they_fit():
    neutral, *images = unrelated(20)
    finer, published = (facezip(neutral, images, options=FacezipOptions(textures=k)) for k in (None, 4))
    budget = (finer.memory_bytes() + published.memory_bytes()) // 2  # too small for four difference textures
    packed, fewer = (facezip(neutral, images, options=FacezipOptions(budget=b)) for b in (budget, budget // 2))
    assert (packed.cell, packed.memory_bytes()) == (4, finer.memory_bytes()) and packed.memory_bytes() <= budget
    assert fewer.cell == 8 and fewer.memory_bytes() <= budget // 2


def test_textures_that_share_their_structure_keep_four_difference_textures():
    made = expression_set(96, 16, strength=20, noise=0)
    packed = facezip(made.neutral, made.textures, covered=made.covered)
    assert (packed.cell, len(packed.textures)) == (8, 4)


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


def test_misuse_is_refused():
    neutral, images = make_set(2)
    with pytest.raises(ValueError, match="3 names for 2"):
        facezip(neutral, images, names=["a", "b", "c"])
    with pytest.raises(ValueError, match="same name"):
        facezip(neutral, images, names=["a", "a"])


def test_a_region_without_a_face_is_refused():
    made = expression_set(64, 6)
    with pytest.raises(InputError, match="holds no face"):
        build_masks(made.mesh, Grid(64, 64), 12, region=np.zeros((64, 64), bool))


def test_a_region_of_priority_is_met_better():
    neutral, images = make_set(14, shape=(64, 64))
    priority = np.ones((64, 64))
    priority[:32] = 10
    options = FacezipOptions(textures=4)
    plain, urgent = (facezip(neutral, images, priority=each, options=options) for each in (None, priority))

    def top(packed):
        return np.mean([rmse(facezip_decode(packed, np.eye(14)[n])[:32], image[:32]) for n, image in enumerate(images)])

    assert top(urgent) < 0.97 * top(plain)


def test_fine_lines_gain_most_by_priority_and_what_lies_beside_them_loses_little():
    made = expression_set(192, 14, strength=30, noise=0)
    lines = made.covered & (np.arange(192) % 24 < 3)[:, None]
    priority = np.where(lines, 10.0, 1.0)
    plain, urgent = (facezip(made.neutral, made.textures, covered=made.covered, priority=p) for p in (None, priority))

    def error(packed, part):
        decoded = [facezip_decode(packed, np.eye(14)[n]) for n in range(14)]
        return np.mean([rmse(image[part], texture[part]) for image, texture in zip(decoded, made.textures)])

    beside = made.covered & ~lines
    assert error(urgent, lines) < 0.85 * error(plain, lines)
    assert error(urgent, beside) < 1.2 * error(plain, beside)


def test_masks_are_sampled_in_the_region():
    made = expression_set(64, 6)
    region = np.zeros((64, 64), bool)
    region[:, :32] = True
    about = [build_masks(made.mesh, Grid(64, 64), 12, region=r)[1] for r in (None, region)]
    assert about[1]["radius_mm"] < 0.85 * about[0]["radius_mm"]


@pytest.mark.parametrize(
    "n,shape,channels,dtype",
    [
        (100, (24, 40), 3, np.uint8),
        (7, (1, 9), 3, np.uint8),
        (6, (33, 17), 1, np.uint16),
        (9, (30, 8), 4, np.uint8),
    ],
)
def test_every_size_and_depth_is_no_worse_than_pca(n, shape, channels, dtype):
    neutral, images = make_set(n, shape=shape, channels=channels, dtype=dtype)
    ours = facezip(neutral, images)
    pca = facezip(neutral, images, options=FacezipOptions("pca"))
    assert ours.report["mean_rmse"] <= pca.report["mean_rmse"] + 0.05


def test_noise_alone_is_no_worse_than_pca():
    rng = np.random.default_rng(0)
    neutral, *images = rng.integers(0, 255, (13, 40, 40, 3)).astype(np.uint8)
    pca = facezip(neutral, images, options=FacezipOptions("pca"))
    assert facezip(neutral, images).report["mean_rmse"] <= pca.report["mean_rmse"] + 0.05
