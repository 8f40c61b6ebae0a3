"""Texture coordinates of a template: UDIM tiles brought to 0..1, and several tiles packed into one atlas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from facewright.errors import InputError
from facewright.mesh.polygons import polygon_centers


@dataclass(frozen=True)
class Chart:
    """One piece of an atlas: some islands of the source UVs, scaled evenly into a box.

    islands vertices, each inside of a UV island that belongs to this chart
    box     (u0, v0, u1, v1) in the atlas; the islands' bounding box is scaled to the largest size that fits, centred
    half    "", or "left" / "right": only polygons on that side of x = 0 (cuts along the midline)
    turn    quarter turns counter-clockwise
    """

    islands: tuple[int, ...]
    box: tuple[float, float, float, float]
    half: str = ""
    turn: int = 0


def uv_islands(uv_polygons):
    """(p,) label of the UV island of each polygon."""
    p, t = len(uv_polygons), int(uv_polygons.max()) + 1
    real = uv_polygons >= 0
    rows = np.nonzero(real)[0]
    graph = sp.coo_matrix((np.ones(len(rows)), (rows, uv_polygons[real])), shape=(p, t)).tocsr()
    return connected_components(graph @ graph.T, directed=False)[1]


def islands_with(polygons, labels, vertices):
    """(p,) bool: polygons of the islands (p,) labels that hold any of the given vertices."""
    return np.isin(labels, np.unique(labels[np.isin(polygons, vertices).any(axis=1)]))


def pack_charts(vertices, polygons, uv, uv_polygons, charts):
    """UVs of an atlas: (t, 2), (p, 4) of a part with source UVs, cut and placed as charts say.

    raises InputError if a polygon belongs to no chart
    """
    labels = uv_islands(uv_polygons)
    side = polygon_centers(vertices, polygons)[:, 0]
    chart_of = np.full(len(polygons), -1)
    for index, chart in enumerate(charts):
        mine = islands_with(polygons, labels, chart.islands) & (chart_of < 0)
        if chart.half:
            mine &= (side > 0) == (chart.half == "left")
        chart_of[mine] = index
    if (chart_of < 0).any():
        lost = uv[uv_polygons[chart_of < 0][0, 0]].round(3).tolist()
        count = int((chart_of < 0).sum())
        raise InputError(f"template description: {count} polygons, the first at UV {lost}, are in no [[atlas]] chart")
    real = uv_polygons >= 0
    corners = np.column_stack([np.repeat(chart_of, 4).reshape(-1, 4)[real], uv_polygons[real]])
    unique, inverse = np.unique(corners, axis=0, return_inverse=True)
    packed_polygons = np.full_like(uv_polygons, -1)
    packed_polygons[real] = inverse.ravel()
    packed = np.empty((len(unique), 2))
    for index, chart in enumerate(charts):
        mine = unique[:, 0] == index
        packed[mine] = _placed(uv[unique[mine, 1]], chart)
    return packed, packed_polygons


def _placed(uv, chart):
    """Source UVs of one chart in the atlas."""
    for _ in range(chart.turn % 4):
        uv = np.stack([-uv[:, 1], uv[:, 0]], axis=1)
    low, high = uv.min(axis=0), uv.max(axis=0)
    box_low, box_high = np.array(chart.box[:2]), np.array(chart.box[2:])
    scale = np.min((box_high - box_low) / (high - low))
    return (box_low + box_high) / 2 + scale * (uv - (low + high) / 2)


def banded_uv(uv, bands):
    """UVs (t, 2) of a part whose rows of v are moved: each band (v0, v1, w0, w1) brings v0..v1 to w0..w1, turned over
    where w0 > w1; u is stretched to 0..1. So a source's cards take the layout that a painted material asks for.

    raises InputError if some v is in no band
    """
    slack = 1e-3
    moved, free = uv.copy(), np.ones(len(uv), bool)
    for v0, v1, w0, w1 in bands:
        mine = free & (uv[:, 1] > v0 - slack) & (uv[:, 1] < v1 + slack)
        moved[mine, 1] = np.clip(w0 + (uv[mine, 1] - v0) / (v1 - v0) * (w1 - w0), min(w0, w1), max(w0, w1))
        free &= ~mine
    if free.any():
        raise InputError(f"template description: v = {uv[free][0, 1]:.3f} is in none of the part's uv_bands")
    low, high = uv[:, 0].min(), uv[:, 0].max()
    moved[:, 0] = (uv[:, 0] - low) / max(high - low, 1e-9)
    return moved


def welded_uv(uv, uv_polygons, polygons):
    """UVs without seams that are none: corners of one vertex at one place share one entry. (t, 2), (p, 4)."""
    real = uv_polygons >= 0
    corner_uv = uv[uv_polygons[real]]
    keys = np.column_stack([polygons[real], np.round(corner_uv * 1e6)]).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    welded = np.full_like(uv_polygons, -1)
    welded[real] = inverse.ravel()
    return corner_uv[first], welded


def in_unit_square(uv):
    """UVs of one UDIM tile brought to 0..1."""
    return uv - np.floor(uv.mean(axis=0))


def uv_measures(vertices, faces, uv, uv_faces, chosen, size=4096):
    """dict of what a layout does to chosen (m,) faces: texel share, px/mm, anisotropy, area scale, flips.

    texel_share  of the whole square; px_per_mm median at a map of size; anisotropy_p95 ratio of singular values;
    area_scale   (5th, 95th percentile) of texel area per mm2 relative to the median; flipped faces
    """
    a, b, c = (vertices[faces[chosen][:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    length = np.linalg.norm(e1, axis=1)
    x = np.maximum(length, 1e-12)
    along = e1 / x[:, None]
    px = np.einsum("ij,ij->i", e2, along)
    py = np.linalg.norm(e2 - px[:, None] * along, axis=1)
    t = uv[uv_faces[chosen]]
    d1, d2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    double = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    area = x * py / 2
    good = area > 1e-9
    J = np.empty((len(x), 2, 2))
    J[:, :, 0] = d1 / x[:, None]
    J[:, :, 1] = (d2 - d1 * (px / x)[:, None]) / np.maximum(py, 1e-12)[:, None]
    singular = np.linalg.svd(J[good], compute_uv=False)
    density = np.abs(double[good]) / 2 / area[good]
    median = np.median(np.repeat(density, 1))
    return {
        "texel_share": float(np.abs(double).sum() / 2),
        "px_per_mm": float(np.sqrt(median) * size),
        "px_per_mm_p5": float(np.sqrt(np.percentile(density, 5)) * size),
        "anisotropy_median": float(np.median(singular[:, 0] / singular[:, 1])),
        "anisotropy_p95": float(np.percentile(singular[:, 0] / singular[:, 1], 95)),
        "area_scale_p5": float(np.percentile(density / median, 5)),
        "area_scale_p95": float(np.percentile(density / median, 95)),
        "flipped": int((double <= 0).sum()),
    }
