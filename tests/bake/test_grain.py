import numpy as np

from facewright.bake.grain import MOST, VOXEL_MM, VOXELS, grain, grain_strength


def test_noise_of_unit_strength_that_is_the_same_each_time_and_knows_no_place():
    points = np.random.default_rng(1).uniform(-100, 100, (40000, 3)).astype(np.float32)
    noise = grain(points)
    assert noise.dtype == np.float32 and abs(noise.mean()) < 0.03 and 0.7 < noise.std() < 1.0
    np.testing.assert_array_equal(noise, grain(points))
    np.testing.assert_array_equal(noise[100:200], grain(points[100:200]))
    np.testing.assert_allclose(grain(points[:500] + np.float32(VOXELS * VOXEL_MM)), noise[:500], atol=1e-2)


def test_it_is_smooth_within_a_voxel_and_forgets_over_some():
    points = np.random.default_rng(2).uniform(0, 40, (20000, 3))
    near, far = (np.corrcoef(grain(points), grain(points + [step, 0, 0]))[0, 1] for step in (0.1, 4.0))
    assert near > 0.95 and abs(far) < 0.1


def test_strength_is_that_of_the_details_but_for_moles_and_beards():
    details = np.random.default_rng(3).normal(size=(5000, 3)) * [1.0, 2.0, 3.0]
    details[:300] -= 80.0
    np.testing.assert_allclose(grain_strength(details), [1.0, 2.0, 3.0], rtol=0.15)
    np.testing.assert_array_equal(grain_strength(details * 100), MOST)
    np.testing.assert_array_equal(grain_strength(details[:0]), 0.0)
    np.testing.assert_array_equal(grain_strength(np.full((50, 3), 7.0)), 0.0)
