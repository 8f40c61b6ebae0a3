"""A tongue that comes out, for a template that has none: drawn out along a line over the lower teeth and lip."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.interpolate import PchipInterpolator
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import unique_edges
from facewright.mesh.laplacian import cotangent_laplacian
from facewright.solve.procrustes import best_rotation
from facewright.solve.quadratic import Factorization

_TIP_MM = 1.0  # what is as far forward as this is the tip
_BORDER_MM = 6.0  # farther from where it is joined the body moves as a whole
_BODY, _FLOOR = 1.35, 2.0  # ways to the tip along the surface, in straight ones: round the underside they are long
_ROOT = 0.15  # share of the length, from the root, that stays; the tip keeps its shape, what is between is drawn out
_LIES_MM = 20.0  # of its underside on the teeth and lip


def tongue_out(vertices, faces, border, jaw, over, tip, *, share, thin):
    """Displacements (k, 3) that bring a tongue out over the lower teeth and lip while the jaw opens by a share.

    vertices (k, 3) mm and faces of the tongue alone; border (b,) indices where it joins the gums
    jaw        (k, 3) what a jaw that opens wholly does to the tongue; the border and the floor beneath it go with it
    over, tip  (3,) what its underside comes to lie on and where its tip comes to lie while the jaw is shut; the opening
               jaw then carries both along
    thin       share of its thickness that the tip loses; it loses half as much of its width
    """
    free = _free_share(vertices, faces, border)[:, None]
    out = _laid_over(vertices, free[:, 0] == 1.0, np.asarray(over, float), np.asarray(tip, float), thin)
    R = best_rotation(vertices, vertices + jaw)
    carried = (out - vertices.mean(axis=0)) @ R.T + (vertices + jaw).mean(axis=0)
    return free * (out + share * (carried - out) - vertices) + (1.0 - free) * share * jaw


def _free_share(vertices, faces, border):
    """(k,) 1 on the body of a tongue, 0 at its border and on the floor of the mouth beneath it, even between.

    The floor lies as far forward as the body above it, but along the surface, round the underside, the tip is far.
    """
    edges = unique_edges(faces)
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    graph = sp.coo_matrix((length, edges.T), shape=(len(vertices), len(vertices))).tocsr()
    tip = np.setdiff1d(np.flatnonzero(vertices[:, 2] > vertices[:, 2].max() - _TIP_MM), border)
    along = dijkstra(graph, directed=False, indices=tip, min_only=True)
    straight = np.maximum(cKDTree(vertices[tip]).query(vertices)[0], _TIP_MM)
    held = along > _FLOOR * straight
    held[border] = True
    body = ~held & (along < _BODY * straight) & (cKDTree(vertices[border]).query(vertices)[0] > _BORDER_MM)
    body[tip] = True
    share = np.where(body, 1.0, 0.0)
    between = np.flatnonzero(~held & ~body)
    if len(between):
        L, known = cotangent_laplacian(vertices, faces), np.flatnonzero(held | body)
        share[between] = Factorization(L[between][:, between]).solve(-(L[between][:, known] @ share[known]))
    return np.clip(share, 0.0, 1.0)


def _laid_over(vertices, body, over, tip, thin):
    """Vertices (k, 3) of a tongue drawn out along a line that leads over a point and droops to the tip.

    body  (k,) bool: what its line at rest is measured by
    """
    x, y, z = vertices.T
    root, front = z[body].min(), z[body].max()
    line = np.polynomial.Polynomial.fit(z[body], y[body], 3)
    t = np.clip((z - root) / (front - root), 0.0, 1.0)
    height = (1.0 - thin * t) * (y - line(z))

    u = np.clip((t - _ROOT) / (1.0 - _ROOT), 0.0, 1.0)
    to = z + (tip[2] - front) * u * u * (3 - 2 * u)
    beneath = body & (to > over[2] - _LIES_MM) & (to < over[2])
    on_top = over[1] - height[beneath].min(initial=0.0)
    stays = root + _ROOT * (front - root)
    at = [root, stays, over[2] - _LIES_MM, over[2], tip[2]]
    new_line = PchipInterpolator(at, [line(root), line(stays), on_top, on_top, tip[1]])
    turn = np.arctan(new_line.derivative()(to)) - np.arctan(line.deriv()(z))
    return np.stack(
        [(1.0 - 0.5 * thin * t) * x, new_line(to) + np.cos(turn) * height, to - np.sin(turn) * height], axis=1
    )
