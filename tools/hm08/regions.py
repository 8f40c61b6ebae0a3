"""Named regions of the skin, by grids around the openings and by planes between named points."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, dijkstra

from facewright.mesh.adjacency import unique_edges
from hm08.density import NEW_CORNER, SEAM_RING
from hm08.head import NOSTRIL_RIM_RING, VERMILION_RING

LIPS_MARGIN_MM = 5.0
EYES_MARGIN_MM = 12.0
HAIRLINE_SHARE = 0.62  # of the distance from the eye line to the chin, above the eye line
EAR_TARGETS = ("ear-flap-incr", "ear-lobe-incr", "ear-wing-incr")


def geodesic(V, F, sources):
    """(n,) shortest way along edges from any of the source vertices, mm."""
    edges = unique_edges(F)
    length = np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1)
    graph = sp.csr_matrix((length, (edges[:, 0], edges[:, 1])), shape=(len(V), len(V)))
    return dijkstra(graph, directed=False, indices=np.unique(sources), min_only=True)


def enclosed(F, n, wall, seed):
    """(n,) bool: vertices reached from seed without touching the wall vertices (which are not included)."""
    edges = unique_edges(F)
    blocked = np.zeros(n, bool)
    blocked[wall] = True
    edges = edges[~blocked[edges].any(axis=1)]
    graph = sp.csr_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    return label == label[seed]


def both_sides(mask, mirror):
    return mask | mask[mirror]


def skin_regions(head, control, ear_control):
    """name -> (n,) bool on the skin; ear_control (c_skin,) in 0..1: a control vertex belongs to the left ear."""
    V, F, mirror, n = head.V, head.F, head.mirror, len(head.V)
    lines, mouth, eye = head.lines, head.grid["mouth"], head.grid["eye_left"]
    seam = np.concatenate([lines["lip_seam_upper"], lines["lip_seam_lower"]])
    margin = np.concatenate([lines["lid_upper_left"], lines["lid_lower_left"]])
    regions = {
        "mouth_interior": enclosed(F, n, seam, mouth[(4 * (SEAM_RING - 1), 0)]),
        "socket_left": enclosed(F, n, margin, eye[(-4, 0)]),
        "nostrils": both_sides(
            enclosed(F, n, lines["nostril_left"], head.grid["nostril_left"][(4 * (NOSTRIL_RIM_RING - 1), 0)]), mirror
        ),
    }
    regions["socket_right"] = regions["socket_left"][mirror]
    inside = regions["mouth_interior"] | regions["socket_left"] | regions["socket_right"] | regions["nostrils"]
    outer = ~inside
    red = outer & enclosed(F, n, _ring_vertices(head, VERMILION_RING), seam[len(seam) // 4])
    red |= both_sides(np.isin(np.arange(n), _ring_vertices(head, VERMILION_RING)), mirror)
    regions |= {"skin": np.ones(n, bool), "outer": outer}
    regions |= _lip_halves(head, red)
    regions["lips"] = outer & (geodesic(V, F, np.flatnonzero(red)) <= LIPS_MARGIN_MM)
    near = geodesic(V, F, np.concatenate([margin, mirror[margin]])) <= EYES_MARGIN_MM
    regions["eyes"] = outer & near
    regions["ear_left"] = outer & (head.S @ ear_control > 0.35)
    regions["ear_right"] = regions["ear_left"][mirror]
    regions |= _large_regions(V, regions, mirror)
    return {name: both_sides(mask, mirror) if _central(name) else mask for name, mask in regions.items()}


def _central(name):
    return not name.endswith(("_left", "_right"))


def _ring_vertices(head, ring):
    left = np.array([v for (r, _), v in head.grid["mouth"].items() if r == 4 * ring])
    return np.unique(np.concatenate([left, head.mirror[left]]))


def _lip_halves(head, red):
    """lip_upper, lip_lower: the red, each vertex to the nearer half of the seam by columns of the mouth's grid."""
    upper, lower = np.zeros(len(red), bool), np.zeros(len(red), bool)
    for (_, column), v in head.grid["mouth"].items():
        half = upper if column >= 4 * NEW_CORNER else lower
        half[[v, head.mirror[v]]] = True
        if column == 4 * NEW_CORNER:
            lower[[v, head.mirror[v]]] = True
    return {"lip_upper": upper & red, "lip_lower": lower & red}


def _large_regions(V, regions, mirror):
    """face, neck, scalp, skull."""
    y, z = V[:, 1], V[:, 2]
    outer = regions["outer"]
    ear = regions["ear_left"] | regions["ear_right"]
    middle = mirror == np.arange(len(V))
    fold, lobe = fold_under_chin(V, middle & outer), V[ear][np.argmin(V[ear][:, 1])]
    up = np.array([fold[2] - lobe[2], lobe[1] - fold[1]])  # normal in (y, z) of the jaw's plane
    above_jaw = (y - fold[1]) * up[0] + (z - fold[2]) * up[1] > 0
    chin = V[middle & outer & (z > 0)][:, 1].min()
    hairline = -HAIRLINE_SHARE * chin
    before_ears = z > V[ear][:, 2].max() + 3.0 + 0.4 * np.maximum(y - 20.0, 0.0)
    top = hairline - 0.0035 * V[:, 0] ** 2  # the hairline comes down towards the temples
    face = outer & above_jaw & (y < top) & before_ears & ~ear
    neck = outer & ~above_jaw & (y < lobe[1] + 20.0) & ~ear
    scalp = outer & ~face & ~neck & ~ear
    back = z < V[ear][:, 2].mean() - 20
    ring = y < fold[1] - 30
    return {"face": face, "neck": neck, "scalp": scalp, "skull": outer & ((scalp & back) | (neck & ring)) & ~ear}


def fold_under_chin(V, middle):
    """(3,) the point of the midline where the underside of the chin turns into the neck."""
    line = V[middle & (V[:, 1] < -100) & (V[:, 2] > -58) & (V[:, 2] < 25)]
    a, b = line[np.argmax(line[:, 2])], line[np.argmin(line[:, 1])]
    inward = np.array([a[2] - b[2], b[1] - a[1]])  # in (y, z): up and back from the chord
    return line[np.argmax((line[:, 1] - a[1]) * inward[0] + (line[:, 2] - a[2]) * inward[1])]
