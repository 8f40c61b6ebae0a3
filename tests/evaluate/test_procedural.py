"""Noise is the same on every machine, smooth, and bounded."""

import numpy as np
import pytest

from facewright.evaluate import procedural


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(-50, 50, (4000, 3))


def test_noise_is_bounded_and_centred(points):
    for noise in (procedural.value_noise(points, 5.0, 3), procedural.fractal_noise(points, 5.0, 3)):
        assert np.abs(noise).max() <= 1.0
        assert abs(noise.mean()) < 0.05
        assert noise.std() > 0.15


def test_noise_depends_on_place_and_seed_only(points):
    noise = procedural.value_noise(points, 5.0, 3)
    assert np.array_equal(noise, procedural.value_noise(points, 5.0, 3))
    assert np.array_equal(noise[::7], procedural.value_noise(points[::7], 5.0, 3))
    assert not np.allclose(noise, procedural.value_noise(points, 5.0, 4))


def test_noise_is_the_same_numbers_everywhere():
    values = procedural.lattice_hash(np.array([[0, 0, 0], [1, -2, 3], [-7, 11, 40]]), 5)
    assert np.allclose(values, [0.6578060, 0.7297570, 0.4088659], atol=1e-6)


def test_noise_is_smooth(points):
    step = procedural.value_noise(points + [1e-4, 0, 0], 5.0, 3) - procedural.value_noise(points, 5.0, 3)
    assert np.abs(step).max() < 2e-4


def test_speckles_cover_a_share_and_stay_in_range(points):
    spots = procedural.speckles(points, 4.0, 0.8, 1, share=0.5)
    assert spots.min() >= 0 and spots.max() <= 1
    assert 0.005 < (spots > 0.3).mean() < 0.3
    assert not procedural.speckles(points, 4.0, 0.8, 1, share=0.0).any()
