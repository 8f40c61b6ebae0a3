"""Contrast at the places of a weight texel: what is scaled, and that the places come out alike."""

import numpy as np
import pytest

from facewright.compress import facezip, store
from facewright.compress.contrast import scaled_contrast
from facewright.compress.packed import decode_float
from tests.compress.test_encode import unrelated

CELL = 4


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize("place", range(CELL))
def test_contrast_across_a_place_is_scaled_by_its_share(axis, place):
    image = np.random.default_rng(0).normal(0, 1, (2, 23, 30)).astype(np.float32)
    shares = np.zeros((2, CELL))
    shares[2 - axis, place] = 0.3
    scaled = scaled_contrast(image, np.ones(image.shape[1:], bool), shares)
    steps, wanted = np.diff(scaled, axis=axis), np.diff(image, axis=axis)
    here = np.arange(1, image.shape[axis]) % CELL == place
    assert np.allclose(np.compress(here, steps, axis), 1.3 * np.compress(here, wanted, axis), atol=1e-6)
    assert np.allclose(scaled.sum(axis=axis), image.sum(axis=axis), atol=1e-4)


def test_uncovered_texels_stay_and_change_nothing():
    rng = np.random.default_rng(0)
    image, shares = rng.normal(0, 1, (1, 20, 20)).astype(np.float32), rng.uniform(-0.1, 0.1, (2, CELL))
    covered = rng.random(image.shape[1:]) < 0.7
    other = np.where(covered, image, 50)
    first, second = (scaled_contrast(each, covered, shares) for each in (image, other))
    assert (first[:, ~covered] == image[:, ~covered]).all() and (first[:, covered] == second[:, covered]).all()


@pytest.mark.parametrize("blur,share", [(1, 0.4), (4, 1.0)])
def test_gradients_become_alike_where_that_costs_little(monkeypatch, blur, share):
    neutral, *images = unrelated(20, 128, blur=blur)
    after = facezip(neutral, images)
    monkeypatch.setattr(store, "even_contrast", lambda tiles, weights, d: d)
    before = facezip(neutral, images)
    assert before.cell == after.cell == CELL
    uneven, even = (np.ptp(kept_contrast(packed, neutral, images), axis=1) for packed in (before, after))
    assert (even < share * uneven).all()
    assert after.report["mean_rmse"] < 1.01 * before.report["mean_rmse"]


def kept_contrast(packed, neutral, images):
    """(2, CELL): gradients of 30 blends over those of the originals, by axis and place, over their mean."""
    rng = np.random.default_rng(7)
    sums = np.zeros((2, CELL, 2))
    base = neutral.astype(np.float32)
    for _ in range(30):
        weights = np.zeros(len(images))
        weights[rng.choice(len(images), 3, replace=False)] = rng.uniform(0.2, 0.6, 3)
        original = base + sum(w * (image.astype(np.float32) - base) for w, image in zip(weights, images))
        for which, blend in enumerate((decode_float(packed, weights), original)):
            for axis in (0, 1):
                steps = np.abs(np.diff(blend, axis=axis)).sum(axis=(1 - axis, 2))
                sums[axis, :, which] += np.bincount(np.arange(1, len(steps) + 1) % CELL, steps, CELL)
    ratio = sums[..., 0] / sums[..., 1]
    return ratio / ratio.mean(axis=1, keepdims=True)
