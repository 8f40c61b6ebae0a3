"""The skin of the template: fine mesh, neutral, operator, lines."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hm08.density import build_fine
from hm08.neutral import close_lips, deepen_nostrils, place_eye, refit_lids, seam_columns, symmetric
from hm08.spread import bilaplacian
from hm08.subdivide import triangulate

VERMILION_RING = 7  # of the mouth's grid: the border of the red
NOSTRIL_RIM_RING = 1


@dataclass(frozen=True)
class Head:
    """The skin alone.

    V (n, 3) neutral; F (m, 3); polygons (p, 4); mirror (n,); S (n, c_skin) control -> fine, without the corrections
    of the neutral; smooth (n, 3) = S @ control; K bi-Laplacian; eye_center (3,) of the left eye
    grid  name -> dict (4 ring, 4 column) -> vertex, for "mouth" (left half), "eye_left", "nostril_left"
    lines name -> (k,)
    """

    V: np.ndarray
    F: np.ndarray
    polygons: np.ndarray
    mirror: np.ndarray
    S: sp.csr_matrix
    K: sp.csr_matrix
    eye_center: np.ndarray
    grid: dict
    lines: dict


def build_head(control):
    """Head of a Control, and the Control with its nostrils deepened."""
    control = replace(control, vertices=deepen_nostrils(control))
    mesh, mirror2, grids = build_fine(control)
    inverse = np.full(len(mirror2), -1)
    inverse[mesh.level2] = np.arange(len(mesh.level2))
    mirror = inverse[mirror2[mesh.level2]]
    grid = {
        name: {key: int(inverse[v]) for key, v in sorted(table.items()) if inverse[v] >= 0}
        for name, table in grids.items()
    }
    V = symmetric(mesh.S @ control.vertices[: control.n_skin], mirror)
    F, polygons = triangulate(mesh.polygons, V, np.append(mirror, -1))
    K = bilaplacian(V, F)
    lines = feature_lines(V, F, grid, mirror)
    margin = ring(grid["eye_left"], 0)
    center = place_eye(V[margin], control.joints["l-eye"])
    moved = refit_lids(V, F, margin, center, K) - V
    V = V + moved + moved[mirror] * [-1, 1, 1]
    V = symmetric(close_lips(V, F, lines["lip_seam_upper"], lines["lip_seam_lower"], K), mirror)
    return Head(V, F, polygons, mirror, mesh.S, K, center, grid, lines), control


def ring(table, k):
    """(n,) vertices of ring k (in control rings) in column order."""
    columns = sorted(c for r, c in table if r == 4 * k)
    return np.array([table[(4 * k, c)] for c in columns])


def feature_lines(V, F, grid, mirror):
    """name -> (k,) of the canonical lines; see docs/template.md."""
    mouth = grid["mouth"]
    lower, upper, row = seam_columns()
    lines = {}
    for name, row in (("lip_seam", row), ("lip_outer", 4 * VERMILION_RING)):
        for side, columns in (("upper", upper), ("lower", lower)):
            left = np.array([mouth[(row, c)] for c in columns if (row, c) in mouth])
            lines[f"{name}_{side}"] = np.concatenate([mirror[left], left[::-1][1:]])
    margin = ring(grid["eye_left"], 0)
    inner, outer = np.argmin(V[margin, 0]), np.argmax(V[margin, 0])
    one = np.roll(margin, -inner)[: (outer - inner) % len(margin) + 1]
    other = np.roll(margin[::-1], inner + 1)[: (inner - outer) % len(margin) + 1]
    low, high = sorted((one, other), key=lambda line: V[line, 1].mean())
    rim = ring(grid["nostril_left"], NOSTRIL_RIM_RING)
    for name, line in (("lid_upper", high), ("lid_lower", low), ("nostril", rim)):
        lines[f"{name}_left"], lines[f"{name}_right"] = line, mirror[line]
    from facewright.mesh.adjacency import border_loops

    neck = border_loops(F)[0]
    start = np.argmin(np.abs(V[neck, 0]) - 1e-3 * V[neck, 2])
    lines["neck_ring"] = np.roll(neck, -start)
    return lines
