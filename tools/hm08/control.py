"""The control mesh: hm08's head cut off at a clean neck ring, in our frame, with real nostrils.

Everything is found by walking the quads from a few vertices of hm08 named here; left is +X.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hm08.source import adult_mean
from hm08.topology import QuadTopology

NECK_EDGE = (797, 7508)  # the head group's own border loop
COLLAR_RINGS = 3  # strips kept below it
NOSE_TIP = 302
MOUTH_EDGE = (540, 7279)  # the loop around the opening, from the middle of the lower lip to the left
EYE_MARGIN_EDGE = (7747, 7748)  # the narrowest loop between the lids
NOSTRIL_EDGE = (7089, 7090)  # the rim of the left nostril
INTERPUPILLARY_MM = 62.5
EYE_SHIFT_MM = 1.0  # eyeballs sit this much further out than hm08's, else the outer corner shows a hole


@dataclass(frozen=True)
class Grid:
    """A regular band of quads around an opening: rings[k][i], k = 0 the opening's own loop, negative inside."""

    rings: dict
    strips: dict


@dataclass(frozen=True)
class Control:
    """The control mesh of the skin and of the simple parts.

    vertices (c, 3) mm in our frame; quads (m, 4) of the skin; mirror (c,); original (c,) hm08 index of each vertex
    n_skin   skin vertices come first, then teeth_upper, teeth_lower, tongue
    part_quads  name -> (k, 4) for the simple parts
    mouth, eye_left, nostril_left  Grids; joints name -> (3,); scale  mm here per mm of the file
    """

    vertices: np.ndarray
    quads: np.ndarray
    mirror: np.ndarray
    original: np.ndarray
    n_skin: int
    part_quads: dict
    mouth: Grid
    eye_left: Grid
    nostril_left: Grid
    joints: dict
    scale: float


PARTS = {"teeth_upper": "helper-upper-teeth", "teeth_lower": "helper-lower-teeth", "tongue": "helper-tongue"}
JOINTS = ("neck", "head", "jaw", "l-eye", "r-eye")


def build_control(base, macros):
    """Control of the adult mean."""
    V = adult_mean(macros, base.vertices)
    body = base.group_quads("body")
    topology = QuadTopology(body)
    kept = _cut(topology)
    quads = body[kept]
    skin = np.unique(quads)
    part_quads = {name: base.group_quads(group) for name, group in PARTS.items()}
    original = np.concatenate([skin] + [np.unique(q) for q in part_quads.values()])
    new = np.full(len(V), -1)
    new[original] = np.arange(len(original))
    joints = {name: V[base.group_vertices(f"joint-{name}")].mean(axis=0) for name in JOINTS}
    scale = (INTERPUPILLARY_MM - 2 * EYE_SHIFT_MM) / (joints["l-eye"][0] - joints["r-eye"][0])
    center = 0.5 * (joints["l-eye"] + joints["r-eye"])
    quads = new[quads]
    topology = QuadTopology(quads)
    return Control(
        vertices=(V[original] - center) * scale,
        quads=quads,
        mirror=new[base.mirror[original]],
        original=original,
        n_skin=len(skin),
        part_quads={name: new[q] for name, q in part_quads.items()},
        mouth=_grid(topology, [new[v] for v in MOUTH_EDGE], new[NOSE_TIP], 10, 10),
        eye_left=_grid(topology, [new[v] for v in EYE_MARGIN_EDGE], new[NOSE_TIP], 11, 11),
        nostril_left=_grid(topology, [new[v] for v in NOSTRIL_EDGE], new[NOSE_TIP], 2, 2),
        joints={name: (position - center) * scale for name, position in joints.items()},
        scale=scale,
    )


def _cut(topology):
    """(m,) bool: faces of the head above the collar."""
    loop = topology.edge_loop(*NECK_EDGE)
    head = topology.side_of_loop(loop, NOSE_TIP)
    _, strips = topology.rings(loop, head, 0, COLLAR_RINGS)
    kept = head.copy()
    for strip in strips.values():
        kept[strip] = True
    return kept


def _grid(topology, edge, outside_seed, n_in, n_out):
    loop = topology.edge_loop(*edge)
    outer = topology.side_of_loop(loop, outside_seed)
    return Grid(*topology.rings(loop, ~outer, n_in, n_out))
