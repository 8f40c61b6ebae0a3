from types import SimpleNamespace

import numpy as np
import pytest

from facewright.evaluate.uv import measure_uv, overlap_texels, seam_edges, signed_uv_areas, stretches

SQUARE = np.array([[0.0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def sheet(uv, uv_faces=FACES, V=SQUARE):
    """A stand-in for a Template: one skin of two triangles."""
    return SimpleNamespace(
        vertices=V,
        faces=FACES,
        uv=np.asarray(uv, float),
        uv_faces=np.asarray(uv_faces),
        regions={"face": np.ones(len(V), bool)},
        skin=SimpleNamespace(face_slice=slice(0, 2)),
    )


def test_even_map_has_no_stretch():
    figures = measure_uv(sheet(SQUARE[:, :2] / 100 * 0.5 + 0.25))
    assert np.isclose(figures["front_share"], 0.25) and np.isclose(figures["used_share"], 0.25)
    assert np.isclose(figures["front_px_per_mm_median"], 0.5 * 4096 / 100)
    assert np.isclose(figures["front_anisotropy_p95"], 1.0)
    assert np.isclose(figures["front_scale_min"], 1.0) and np.isclose(figures["front_scale_max"], 1.0)
    assert (figures["flipped"], figures["overlap_texels"], figures["front_seam_edges"], figures["front_pieces"]) == (
        0,
        0,
        0,
        1,
    )


@pytest.mark.parametrize("factor", [2.0, 5.0])
def test_anisotropy_is_the_ratio_of_the_stretches(factor):
    uv = SQUARE[:, :2] / 100 * [0.8, 0.8 / factor]
    assert np.isclose(measure_uv(sheet(uv))["front_anisotropy_median"], factor)
    tilted = SQUARE @ np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    np.testing.assert_allclose(stretches(tilted, FACES, uv, FACES), [[0.008, 0.008 / factor]] * 2)


def test_a_flipped_triangle_is_counted():
    uv = SQUARE[:, :2] / 100
    uv[3] = [0.9, 0.1]
    figures = measure_uv(sheet(uv))
    assert figures["flipped"] == 1
    assert signed_uv_areas(uv, FACES)[1] < 0


def test_overlap_is_found_and_shared_edges_are_none():
    uv = np.array([[0.1, 0.1], [0.6, 0.1], [0.6, 0.6], [0.1, 0.6]])
    assert overlap_texels(uv, FACES, 256) == 0
    doubled = np.concatenate([uv, uv + 0.05])
    two = np.array([[0, 1, 2], [4, 5, 6]])
    share = overlap_texels(doubled, two, 256) / 256**2
    assert np.isclose(share, 0.5 * 0.45**2, atol=0.01)


def test_a_seam_is_found():
    parted = [[0, 1, 2], [4, 5, 3]]
    assert seam_edges(FACES, np.array(parted)) == 1
    assert seam_edges(FACES, FACES) == 0
    uv = [[0, 0], [0.4, 0], [0.4, 0.4], [0.5, 0.9], [0.5, 0.5], [0.9, 0.9]]
    assert measure_uv(sheet(uv, parted))["front_pieces"] == 2
