"""The skin of the template: fine mesh, neutral, operator, lines."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import border_loops
from hm08.density import NEW_CORNER, SEAM_RING, build_fine
from hm08.neutral import (
    CONTACT,
    clear_of_ball,
    close_lips,
    deepen_nostrils,
    part_lips,
    place_eye,
    refit_lids,
    round_corner,
    seam_columns,
    separate_lips,
    symmetric,
)
from hm08.spread import bilaplacian
from hm08.subdivide import triangulate

VERMILION_RING = 6.5  # of the mouth's grid: the border of the red
NOSTRIL_RIM_RING = 1


@dataclass(frozen=True)
class Head:
    """The skin alone.

    V (n, 3) neutral; V_open (n, 3) the same with lips parted; F (m, 3); polygons (p, 4); mirror (n,)
    S (n, c_skin) control -> fine, without the corrections of the neutral; K bi-Laplacian
    eye_center (3,) of the left eye
    grid  name -> dict (4 ring, 4 column) -> vertex, for "mouth" (left half), "eye_left", "nostril_left"
    lines name -> (k,)
    """

    V: np.ndarray
    V_open: np.ndarray
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
    moved = clear_of_ball(refit_lids(V, F, margin, center, K), margin, center) - V
    V = V + moved + moved[mirror] * [-1, 1, 1]
    V = closed_mouth(V, F, mirror, lines, grid["mouth"], K)
    parted = symmetric(part_lips(V, lines["lip_seam_upper"], lines["lip_seam_lower"], K), mirror)
    return Head(V, parted, F, polygons, mirror, mesh.S, K, center, grid, lines), control


def closed_mouth(V, F, mirror, lines, mouth, K):
    """V (n, 3) with lips closed, corners rounded, no lip through the other."""
    upper, lower = lines["lip_seam_upper"], lines["lip_seam_lower"]
    seam = np.concatenate([upper, lower])
    corner = round(4 * NEW_CORNER)
    rows = [seam_row(mouth, mirror, 4 * SEAM_RING - 2 * i) for i in range(len(CONTACT))]
    V = symmetric(close_lips(V, rows, K), mirror)
    for step in (
        lambda V: round_corner(V, F, upper[-1], seam),
        lambda V: separate_lips(V, mouth, corner, seam, K),
    ):
        moved = step(V) - V
        V = symmetric(V + moved + moved[mirror] * [-1, 1, 1], mirror)
    return V


def ring(table, k):
    """(n,) vertices of ring k (in control rings) in column order."""
    columns = sorted(c for r, c in table if r == 4 * k)
    return np.array([table[(4 * k, c)] for c in columns])


def seam_row(mouth, mirror, row):
    """Upper and lower half (k,) of one ring of the mouth's grid, from the right corner to the left."""
    halves = []
    for columns in reversed(seam_columns()):
        left = np.array([mouth[(row, c)] for c in columns])
        halves.append(np.concatenate([mirror[left], left[::-1][1:]]))
    return halves


def feature_lines(V, F, grid, mirror):
    """name -> (k,) of the canonical lines; see docs/template.md."""
    lines = {}
    for name, row in (("lip_seam", 4 * SEAM_RING), ("lip_outer", 4 * VERMILION_RING)):
        lines[f"{name}_upper"], lines[f"{name}_lower"] = seam_row(grid["mouth"], mirror, row)
    margin = ring(grid["eye_left"], 0)
    inner, outer = np.argmin(V[margin, 0]), np.argmax(V[margin, 0])
    one = np.roll(margin, -inner)[: (outer - inner) % len(margin) + 1]
    other = np.roll(margin[::-1], inner + 1)[: (inner - outer) % len(margin) + 1]
    low, high = sorted((one, other), key=lambda line: V[line, 1].mean())
    rim = ring(grid["nostril_left"], NOSTRIL_RIM_RING)
    for name, line in (("lid_upper", high), ("lid_lower", low), ("nostril", rim)):
        lines[f"{name}_left"], lines[f"{name}_right"] = line, mirror[line]
    neck = border_loops(F)[0]
    start = np.argmin(np.abs(V[neck, 0]) - 1e-3 * V[neck, 2])
    lines["neck_ring"] = np.roll(neck, -start)
    return lines
