"""Localised identity modes: the variance stays, places come apart."""

import numpy as np

from facewright.register.localize import localized_basis


def wave_head(n=600):
    rng = np.random.default_rng(4)
    vertices = rng.normal(size=(n, 3))
    vertices = 90.0 * vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    basis = np.stack([np.ones((n, 3)) * [0, 3.0, 0], np.sin(vertices / 60.0) * 2.0])
    return vertices, basis, np.ones(n, bool)


def covariance(basis, a, b):
    return np.einsum("ic,id->cd", basis[:, a], basis[:, b])


def localized(vertices, basis, everywhere, **options):
    """The localised modes written out."""
    return localized_basis(vertices, basis, everywhere, everywhere, **options).at(np.arange(len(vertices)))


def test_variance_of_every_vertex_is_kept():
    vertices, basis, everywhere = wave_head()
    local = localized(vertices, basis, everywhere, modes=10**6)
    for vertex in (0, 17, 300):
        kept, whole = covariance(local, vertex, vertex), covariance(basis, vertex, vertex)
        np.testing.assert_allclose(kept, whole, rtol=1e-5, atol=1e-5)


def test_far_places_come_apart_by_the_share():
    vertices, basis, everywhere = wave_head()
    far = np.linalg.norm(vertices - vertices[0], axis=1).argmax()
    local = localized(vertices, basis, everywhere, share=0.4, length_mm=30.0, modes=10**6)
    ratio = covariance(local, 0, far)[1, 1] / covariance(basis, 0, far)[1, 1]
    assert 0.6 - 1e-6 < ratio < 0.62


def test_no_share_gives_the_same_covariance():
    vertices, basis, everywhere = wave_head()
    local = localized(vertices, basis, everywhere, share=0.0)
    np.testing.assert_allclose(covariance(local, 3, 90), covariance(basis, 3, 90), rtol=1e-5, atol=1e-5)


def test_a_template_without_modes_stays_without():
    vertices, basis, everywhere = wave_head()
    assert len(localized_basis(vertices, basis[:0], everywhere, everywhere)) == 0


def test_a_mixture_of_modes_is_the_sum_of_them():
    vertices, basis, everywhere = wave_head()
    local = localized_basis(vertices, basis, everywhere, everywhere)
    alpha = np.random.default_rng(0).normal(size=len(local))
    written_out = np.tensordot(alpha, local.at(np.arange(len(vertices))), 1)
    np.testing.assert_allclose(local.along(alpha), written_out, atol=1e-4)
