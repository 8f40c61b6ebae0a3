"""Best rotations and similarities recover what made the points."""

import numpy as np

from facewright.solve.procrustes import best_rotation, best_similarity

POINTS = np.random.default_rng(0).normal(size=(20, 3))


def rotation(seed):
    Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def test_a_rotation_is_recovered_and_no_reflection_returned():
    R = rotation(1)
    assert np.allclose(best_rotation(POINTS, POINTS @ R.T + 5), R, atol=1e-12)
    assert np.linalg.det(best_rotation(POINTS, POINTS * [-1, 1, 1])) > 0


def test_a_similarity_is_recovered():
    R, t = rotation(2), np.array([3.0, -4, 5])
    found = best_similarity(POINTS, 1.7 * POINTS @ R.T + t)
    assert np.allclose(found[0], R, atol=1e-12) and np.isclose(found[1], 1.7) and np.allclose(found[2], t)


def test_points_without_weight_do_not_count():
    R = rotation(3)
    target = POINTS @ R.T
    target[:5] += 100
    weights = np.append(np.zeros(5), np.ones(15))
    assert np.allclose(best_rotation(POINTS, target, weights), R, atol=1e-12)


def test_the_scale_is_kept_within_its_limits():
    R, scale, t = best_similarity(POINTS, 3 * POINTS + 1, scale_limits=(0.9, 1.2))
    assert scale == 1.2
    moved = scale * POINTS @ R.T + t
    assert np.allclose(moved.mean(axis=0), (3 * POINTS + 1).mean(axis=0))
