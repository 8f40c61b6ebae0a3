import numpy as np

from facewright.bake.pyramid import push_pull


def test_filled_texels_stay_and_a_constant_spreads_everywhere():
    rng = np.random.default_rng(0)
    weights = (rng.random((37, 53)) < 0.05).astype(float)
    values = rng.random((37, 53, 2))
    filled = push_pull(values * weights[..., None], weights)
    np.testing.assert_allclose(filled[weights == 1], values[weights == 1], rtol=1e-6)
    assert filled.min() >= values[weights == 1].min() - 1e-6 and filled.max() <= values[weights == 1].max() + 1e-6
    constant = push_pull(weights[..., None] * 0.3, weights)
    np.testing.assert_allclose(constant, 0.3, rtol=1e-5)


def test_a_border_spreads_its_own_colour():
    weights = np.zeros((64, 64))
    weights[:, :20], weights[:, 44:] = 1, 1
    values = np.zeros((64, 64, 1))
    values[:, 44:] = 1.0
    filled = push_pull(values, weights)
    assert filled[:, 20:22].max() < 0.25 and filled[:, 42:44].min() > 0.75
    assert (np.diff(filled[32, :, 0]) > -0.05).all(), "rises from one side to the other"


def test_nothing_known_and_everything_known():
    values = np.arange(12.0).reshape(2, 3, 2)
    np.testing.assert_array_equal(push_pull(values, np.ones((2, 3))), values)
    np.testing.assert_array_equal(push_pull(values * 0, np.zeros((2, 3))), values * 0)
