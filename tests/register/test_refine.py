"""The Gaussian process that refines the model: its dense and its sparing form agree, and motions cost nothing."""

import numpy as np

from facewright.register import refine


def sites_on_a_ball(k=40, modes=5):
    rng = np.random.default_rng(3)
    points = rng.normal(size=(k, 3))
    points = 90.0 * points / np.linalg.norm(points, axis=1, keepdims=True)
    return refine._Sites(points, rng.normal(size=(modes, k, 3)))


def test_displacement_at_the_sites_is_the_covariance_times_the_forces():
    sites = sites_on_a_ball()
    forces = np.random.default_rng(5).normal(size=sites.points.shape)
    dense = (refine._covariance(sites) @ forces.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(refine._displacement(sites.points, sites.modes, sites, forces), dense, atol=1e-3)


def test_covariance_is_symmetric_and_positive():
    K = refine._covariance(sites_on_a_ball())
    np.testing.assert_allclose(K, K.T, atol=1e-4)
    assert np.linalg.eigvalsh(K).min() > 0


def test_rows_along_a_direction_are_the_projected_covariance():
    sites = sites_on_a_ball(6)
    K = refine._covariance(sites)
    chosen = np.array([4, 1])
    directions = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    rows = refine._along(K, chosen, directions)
    np.testing.assert_allclose(rows[0], 0.6 * K[13] + 0.8 * K[14])
    np.testing.assert_allclose(rows[1], K[3])


def test_frame_goes_there_and_back():
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = 1.3 * turn, [4.0, 5.0, 6.0]
    frame = refine._Frame(T)
    points = np.random.default_rng(2).normal(size=(7, 3))
    np.testing.assert_allclose(frame.outward(points), points @ T[:3, :3].T + T[:3, 3])
    np.testing.assert_allclose(frame.inward(frame.outward(points)), points, atol=1e-12)
