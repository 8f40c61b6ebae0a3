"""Best rotations, similarities and affine maps recover what made the points."""

import numpy as np

from facewright.solve.procrustes import best_affine, best_rotation, best_similarity

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


def test_an_affine_map_is_recovered_and_held_to_another():
    A, t, ones = np.random.default_rng(4).normal(size=(3, 3)), np.array([3.0, -4, 5]), np.ones(len(POINTS))
    found = best_affine(POINTS, POINTS @ A.T + t, ones, np.eye(3), hold=0.0)
    assert np.allclose(found[0], A) and np.allclose(found[1], t)
    held, shift = best_affine(POINTS, POINTS @ A.T + t, ones, np.eye(3), hold=1e9)
    assert np.allclose(held, np.eye(3), atol=1e-6)
    assert np.allclose((POINTS + shift).mean(axis=0), (POINTS @ A.T + t).mean(axis=0))
