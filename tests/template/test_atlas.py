"""Atlases of two small charts."""

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.mesh.polygons import triangulated
from facewright.template.atlas import (
    Chart,
    banded_uv,
    in_unit_square,
    pack_charts,
    uv_islands,
    uv_measures,
    welded_uv,
)


def two_sheets():
    """Two separate strips of two quads each, side by side in x; their UVs lie in tiles 0 and 1."""
    x, y = np.meshgrid([-1.0, 0, 1], [0.0, 1])
    sheet = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    polygons = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    V = np.vstack([sheet, sheet + [0, 5, 0]])
    uv = np.vstack([sheet[:, :2] / 4 + 0.5, sheet[:, :2] / 4 + [1.5, 0.5]])
    polygons = np.vstack([polygons, polygons + 6])
    return V, polygons, uv, polygons.copy()


CHARTS = [
    Chart((0,), (0.0, 0.0, 0.5, 1.0)),
    Chart((6,), (0.5, 0.0, 1.0, 0.5), half="left"),
    Chart((6,), (0.5, 0.5, 1.0, 1.0), half="right", turn=1),
]


def test_charts_fill_their_boxes_without_distortion_or_overlap():
    V, polygons, uv, uv_polygons = two_sheets()
    packed, packed_polygons = pack_charts(V, polygons, uv, uv_polygons, CHARTS)
    faces, _ = triangulated(polygons)
    uv_faces, _ = triangulated(packed_polygons)
    for chart, mine in zip(CHARTS, (slice(0, 4), slice(6, 8), slice(4, 6))):
        corners = packed[uv_faces[mine]].reshape(-1, 2)
        assert (corners >= np.array(chart.box[:2]) - 1e-12).all() and (corners <= np.array(chart.box[2:]) + 1e-12).all()
        measures = uv_measures(V, faces[mine], packed, uv_faces[mine], np.ones(len(faces[mine]), bool))
        assert measures["flipped"] == 0 and measures["anisotropy_p95"] == pytest.approx(1)
    # Cut along the midline: the two middle vertices of the second sheet have two texture coordinates each.
    assert len(packed) == len(uv) + 2
    assert uv_islands(packed_polygons).max() == 2


def test_polygons_without_a_chart_are_refused():
    with pytest.raises(InputError, match="in no"):
        pack_charts(*two_sheets(), CHARTS[:1])


def test_seams_that_are_none_are_welded():
    _, polygons, uv, _ = two_sheets()
    split = uv[polygons].reshape(-1, 2)
    welded, welded_polygons = welded_uv(split, np.arange(16).reshape(4, 4), polygons)
    assert len(welded) == len(uv)
    assert np.allclose(welded[welded_polygons], uv[polygons])


def test_tiles_come_to_the_unit_square():
    assert np.allclose(in_unit_square(np.array([[3.2, 0.1], [3.6, 0.9]])), [[0.2, 0.1], [0.6, 0.9]])


def test_measures_of_a_known_stretch():
    V = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]], float)
    F = np.array([[0, 1, 2], [0, 2, 3]])
    uv = V[:, :2] * [0.05, 0.025]
    measures = uv_measures(V, F, uv, F, np.ones(2, bool), size=1000)
    assert measures["texel_share"] == pytest.approx(0.125)
    assert measures["px_per_mm"] == pytest.approx(1000 * np.sqrt(0.05 * 0.025))
    assert measures["anisotropy_median"] == pytest.approx(2)
    assert uv_measures(V, F[:, ::-1], uv, F, np.ones(2, bool))["flipped"] == 0
    assert uv_measures(V, F, uv, F[:, ::-1], np.ones(2, bool))["flipped"] == 2


def test_bands_of_cards_take_the_layout_of_a_painted_material():
    uv = np.array([[0.5, 0.98], [0.9, 0.84], [0.7, 0.91], [0.5, 0.32], [0.9, 0.18]])
    bands = [(0.84, 0.98, 1.0, 0.5), (0.18, 0.32, 0.5, 0.0)]
    np.testing.assert_allclose(banded_uv(uv, bands), [[0, 0.5], [1, 1], [0.5, 0.75], [0, 0], [1, 0.5]], atol=1e-9)
    with pytest.raises(InputError, match="uv_bands"):
        banded_uv(uv, bands[:1])
