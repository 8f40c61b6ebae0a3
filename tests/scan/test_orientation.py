"""The similarity fits, and the search's cameras."""

import numpy as np
import pytest

from facewright.scan.detector import canonical_landmarks
from facewright.scan.landmarks import STABLE
from facewright.scan.orientation import SEARCH_SIZE, _unturn, fit_canonical, fit_similarity, search_directions
from facewright.scan.sightings import transform


def random_similarity(seed):
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T = np.eye(4)
    T[:3, :3] = rotation * np.linalg.det(rotation) * rng.uniform(0.01, 50)
    T[:3, 3] = rng.normal(size=3) * 300
    return T


def test_similarity_is_recovered():
    points = np.random.default_rng(0).normal(size=(9, 3))
    for seed in range(5):
        T = random_similarity(seed)
        assert np.allclose(fit_similarity(points, transform(T, points)), T, atol=1e-9)


def test_no_mirroring():
    points = np.random.default_rng(0).normal(size=(9, 3))
    assert np.linalg.det(fit_similarity(points, points * [-1, 1, 1])[:3, :3]) > 0


def test_canonical_frame_in_spite_of_outliers():
    canonical = np.vstack([canonical_landmarks(), np.zeros((10, 3))])
    weights = np.ones(478)
    for seed in range(3):
        T = random_similarity(seed)
        points = transform(T, canonical)
        guess = fit_canonical(points, weights)
        assert np.allclose(guess.T @ T, np.eye(4), atol=1e-6) and guess.residual_mm < 1e-6
        moved = canonical.copy()
        moved[list(STABLE[:8])] += [0, 25, 10]  # part of the lips is wrong
        guess = fit_canonical(transform(T, moved), weights)
        assert np.abs((guess.T @ T - np.eye(4))[:3, :3]).max() < 0.06


def test_directions_cover_the_sphere():
    frames = np.array(list(search_directions()))
    assert frames.shape == (52, 3, 3)
    assert np.allclose(frames @ frames.transpose(0, 2, 1), np.eye(3)) and np.allclose(np.linalg.det(frames), 1)
    directions = np.random.default_rng(0).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    nearest = np.degrees(np.arccos((directions @ frames[:, 2].T).max(axis=1)))
    assert nearest.max() < 28.0
    assert np.allclose(frames[0], np.eye(3))  # upright and to the front, as most files are, comes first


@pytest.mark.parametrize("quarter", range(4))
def test_pixels_of_turned_pictures(quarter):
    image = np.zeros((SEARCH_SIZE, SEARCH_SIZE))
    image[40, 100] = 1
    y, x = np.argwhere(np.rot90(image, quarter))[0]
    assert np.allclose(_unturn(np.array([[x + 0.5, y + 0.5]]), quarter), [[100.5, 40.5]])
