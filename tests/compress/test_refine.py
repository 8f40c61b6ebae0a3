"""The refinement: exact steps, its objective, rounding one after the other, and what it leaves out."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from facewright.compress import FacezipOptions, facezip
from facewright.compress.refine import MOST, PASSES, Pass, gram_matrix, passes_within, pca_weights, refine, settle
from facewright.compress.solve import LEAST_RIDGE
from facewright.compress.store import measure_tiles, root_mean, store_solution, texture_rounding
from facewright.compress.synthetic import expression_set
from facewright.compress.tiles import TextureTiles

RIDGE = 0.3


def tiles_of(shape=(40, 56), n=12, seed=0, covered=None):
    """Tiles of a generated set, and the images."""
    made = expression_set(shape, n, strength=20, noise=1, seed=seed)
    covered = np.ones(shape, bool) if covered is None else covered
    return TextureTiles.of(made.neutral, made.textures, covered), made


def random_weights(tiles, k=3, seed=0):
    """Weights (rows, columns, N, K) of no particular kind."""
    return np.random.default_rng(seed).normal(0, 1, (*tiles.grid.cells, tiles.count, k)).astype(np.float32)


def upsampled(tiles, weights):
    """(h, w, N, K) of weights (rows, columns, N, K)."""
    flat = weights.reshape(*tiles.grid.cells, -1)
    return tiles.grid.upsample(flat).reshape(*tiles.shape[:2], tiles.count, -1)


@pytest.mark.parametrize("held", [(), (4,)])
def test_textures_and_objective_are_those_of_a_dense_solve(held):
    tiles, made = tiles_of()
    k, weights = 3, random_weights(tiles)
    value, _, _ = Pass(tiles, k, held).gather(weights.reshape(-1, tiles.count, k), RIDGE)
    u = upsampled(tiles, weights).astype(float)
    x = np.stack([image.astype(float) - made.neutral for image in made.textures], axis=2)  # (h, w, N, C)
    fixed = x[:, :, list(held)]
    free, kept = u[..., len(held) :], u[..., : len(held)]
    rest = x - kept @ fixed
    normal = np.swapaxes(free, -1, -2) @ free + RIDGE * np.eye(k - len(held))
    d = np.concatenate([fixed, np.linalg.solve(normal, np.swapaxes(free, -1, -2) @ rest)], axis=2)
    wanted = ((x - u @ d) ** 2).sum() + RIDGE * (d[:, :, len(held) :] ** 2).sum()
    assert value + (x**2).sum() == pytest.approx(wanted, rel=1e-4)


def test_what_is_rounded_is_made_up_for_by_the_next():
    tiles, _ = tiles_of()
    k = 4
    weights = np.float32(1) + 0.2 * random_weights(tiles, k)  # alike, so that one texture can stand for another
    work, flat, step = Pass(tiles, k), weights.reshape(-1, tiles.count, k), np.float32(4)
    part, errors = np.arange(len(tiles)), {}
    plain = work.solve_textures(flat, part, 1e-3)[0]
    one_by_one = work.solve_textures(flat, part, 1e-3, nearest=lambda i, values: np.rint(values / step) * step)[0]
    assert np.abs(one_by_one / step - np.rint(one_by_one / step)).max() < 1e-4
    corner = flat[tiles.grid.corner_cells()]
    full = np.einsum("tcnk,cp->tpnk", corner, work.basis)
    for name, d in (("each", np.rint(plain / step) * step), ("one by one", one_by_one)):
        errors[name] = ((full @ (d - plain).transpose(0, 3, 1, 2)) ** 2).mean()
    assert errors["one by one"] < 0.6 * errors["each"]


def test_what_is_rounded_towards_the_solution_is_the_rounded_solution():
    tiles, _ = tiles_of()
    k, part, step = 3, np.arange(len(tiles)), np.float32(4)

    def nearest(_, values):
        return np.rint(values / step) * step

    work, flat = Pass(tiles, k), random_weights(tiles, k).reshape(-1, tiles.count, k)
    plain, rounded = (work.solve_textures(flat, part, RIDGE, nearest=each)[0] for each in (None, nearest))
    again = work.round_textures(flat, part, RIDGE, plain, nearest)
    assert (again != rounded).mean() < 1e-3  # but for what lies on the edge between two steps
    assert (work.round_textures(flat, part, RIDGE, rounded, nearest) == rounded).all()


def test_settled_weights_suit_what_is_stored():
    tiles, _ = tiles_of((96, 96), 16)
    gram = gram_matrix(tiles)
    weights, _ = refine(tiles, pca_weights(gram, 4), energy=gram.trace(), iterations=30)
    rounding = texture_rounding(tiles, weights, 3e-3)
    before, after = (
        root_mean(measure_tiles(tiles, store_solution(tiles, w, 3e-3, report={}))).mean()
        for w in (weights, settle(tiles, weights, rounding.of_part))
    )
    assert after < before


def test_what_lies_on_uncovered_texels_changes_no_weight():
    covered = np.zeros((72, 88), bool)
    covered[20:50, 10:60] = True
    tiles, made = tiles_of(covered.shape, 9, covered=covered)
    chunks = np.concatenate(tiles.covered_chunks())
    assert (chunks == np.flatnonzero(tiles.scale.any(axis=(1, 2)))).all() and len(chunks) < len(tiles)
    other = [np.where(covered[:, :, None], image, 255 - image) for image in made.textures]
    first, second = (facezip(made.neutral, images, covered=covered) for images in (made.textures, other))
    assert (first.weights == second.weights).all()
    assert first.report["rmse"] == second.report["rmse"]


def test_small_sets_take_more_passes_as_long_as_they_pay():
    rng = np.random.default_rng(0)
    neutral = np.full((64, 64, 3), 128, np.uint8)
    noise = [np.clip(128 + rng.normal(0, 12, neutral.shape), 0, 255).astype(np.uint8) for _ in range(20)]
    smooth = [gaussian_filter(rng.normal(0, 12, neutral.shape), (3, 3, 0)) * 9 for _ in range(20)]
    smooth = [np.clip(128 + image, 0, 255).astype(np.uint8) for image in smooth]
    passes = {name: facezip(neutral, images).report.get("passes") for name, images in (("n", noise), ("s", smooth))}
    assert PASSES <= passes["n"] < passes["s"] <= MOST
    fixed = facezip(neutral, smooth, options=FacezipOptions(iterations=7)).report
    assert fixed["passes"] <= 7


def test_passes_fall_with_the_size_of_a_set():
    sizes = (16, 256, 400)
    counts = [passes_within(tiles_of((size, size), 20)[0]) for size in sizes]
    assert counts[0] == MOST and counts == sorted(counts, reverse=True) and counts[-1] >= PASSES


def test_a_held_texture_has_weight_one_on_its_own_difference_texture():
    tiles, _ = tiles_of()
    gram = gram_matrix(tiles)
    start = pca_weights(gram, 3)
    start[5], start[:, 0] = 0, 0
    start[5, 0] = 1
    weights, _ = refine(tiles, start, energy=gram.trace(), iterations=4, keep=(5,))
    settled = settle(tiles, weights, texture_rounding(tiles, weights, LEAST_RIDGE, (5,), range(1)).of_part, keep=(5,))
    for w in (weights, settled):
        assert (w[:, :, 5, 0] == 1).all() and (w[:, :, 5, 1:] == 0).all()
