"""Catmull-Clark subdivision as sparse operators, and a conforming mesh whose density follows a wish.

Vertices of level 2 are numbered: control vertices, edge points of level 1, face points of level 1, then the same of
level 2. A vertex that a coarser cell uses takes its place on the twice-subdivided surface too, so cells of all levels
meet without a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True)
class Level:
    """One subdivision step: S (n_fine, n), quads (4 m, 4) with the children of face f at 4 f .. 4 f + 3 (child i at
    corner i), edge_point (m, 4) vertex on edge i, face_point (m,)."""

    S: sp.csr_matrix
    quads: np.ndarray
    edge_point: np.ndarray
    face_point: np.ndarray


def catmull_clark(Q, n):
    """One step on quads Q (m, 4) over n vertices; borders become cubic B-splines (Catmull & Clark 1978)."""
    m = len(Q)
    half = np.stack([Q, np.roll(Q, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, which, count = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    which = which.reshape(m, 4)
    e = len(edges)
    face_of = sp.csr_matrix((np.full(4 * m, 0.25), (np.repeat(np.arange(m), 4), Q.ravel())), shape=(m, n))
    middle = sp.csr_matrix((np.full(2 * e, 0.5), (np.repeat(np.arange(e), 2), edges.ravel())), shape=(e, n))
    edge_face = sp.csr_matrix((np.ones(4 * m), (which.ravel(), np.repeat(np.arange(m), 4))), shape=(e, m))
    border = count == 1
    inner = sp.diags((~border).astype(float))
    edge_rule = inner @ (0.5 * middle + 0.25 * (edge_face @ face_of)) + sp.diags(border.astype(float)) @ middle
    vertex_rule = _vertex_rule(Q, edges, border, face_of, middle, n)
    S = sp.vstack([vertex_rule, edge_rule, face_of]).tocsr()
    edge_point = n + which
    face_point = n + e + np.arange(m)
    children = np.stack([Q, edge_point, np.repeat(face_point[:, None], 4, 1), np.roll(edge_point, 1, axis=1)], axis=2)
    return Level(S, children.reshape(-1, 4), edge_point, face_point)


def _vertex_rule(Q, edges, border, face_of, middle, n):
    """(n, n): (F + 2 R + (k - 3) P) / k inside, the cubic spline's 1/8, 6/8, 1/8 on a border."""
    e, m = len(edges), len(Q)
    at_edge = sp.csr_matrix((np.ones(2 * e), (edges.ravel(), np.repeat(np.arange(e), 2))), shape=(n, e))
    at_face = sp.csr_matrix((np.ones(4 * m), (Q.ravel(), np.repeat(np.arange(m), 4))), shape=(n, m))
    valence = np.asarray(at_face.sum(axis=1)).ravel()
    on_border = np.asarray(at_edge @ border.astype(float)).ravel() > 0
    k = np.where(valence > 0, valence, 1.0)
    smooth = sp.diags(1 / k**2) @ (at_face @ face_of) + sp.diags(2 / k**2) @ (at_edge @ middle) + sp.diags((k - 3) / k)
    at_border = at_edge @ sp.diags(border.astype(float))
    crease = 0.25 * (at_border @ middle) + sp.diags(np.full(n, 0.5))
    lonely = valence == 0
    inside = sp.diags((~on_border & ~lonely).astype(float))
    return inside @ smooth + sp.diags(on_border.astype(float)) @ crease + sp.diags(lonely.astype(float))


@dataclass(frozen=True)
class AdaptiveMesh:
    """S (n, n_control); polygons (p, 4), -1 pads a triangle; level2 (n,) index of each vertex at level 2;
    control_face (p,) the control quad each polygon lies in."""

    S: sp.csr_matrix
    polygons: np.ndarray
    level2: np.ndarray
    control_face: np.ndarray


def balanced(first, refine_first, refine_second):
    """Grow the marks until cells that share an edge differ by one level at most: (m,), (4 m,) bool."""
    edges = np.unique(np.sort(first.edge_point, axis=1).ravel())
    refine_first = refine_first | refine_second.reshape(-1, 4).any(axis=1)
    # A child cell's outer edges are halves of its parent's edges; both cells at that edge must exist at level 1.
    for _ in range(2):
        split = np.zeros(int(edges.max()) + 1, bool)
        for i in range(4):
            marked = refine_second.reshape(-1, 4)[:, i]
            split[first.edge_point[marked, i]] = True
            split[first.edge_point[marked, i - 1]] = True
        refine_first = refine_first | split[first.edge_point].any(axis=1)
    return refine_first, refine_second & np.repeat(refine_first, 4)


def adaptive(Q, n, first, second, refine_first, refine_second, R=None):
    """The conforming mesh: control quads where refine_first (m,) is false, their children where refine_second
    (4 m,) is false, grandchildren elsewhere; cells with a finer neighbour are cut so that no vertex hangs.

    first, second  the two Levels; R (n_level2, n_level2) moves level-2 vertices along the surface before use
    """
    cells, owner = [], []
    split_first = np.zeros(first.S.shape[0], bool)
    split_first[first.edge_point[refine_first]] = True
    coarse = ~refine_first
    cells += [_cut(Q[coarse], first.edge_point[coarse], split_first[first.edge_point[coarse]])]
    owner += [np.nonzero(coarse)[0][cells[-1][1]]]
    fine = np.repeat(refine_first, 4) & refine_second
    middle = np.repeat(refine_first, 4) & ~refine_second
    split_second = np.zeros(second.S.shape[0], bool)
    split_second[second.edge_point[fine]] = True
    children = first.quads
    cells += [_cut(children[middle], second.edge_point[middle], split_second[second.edge_point[middle]])]
    owner += [np.nonzero(middle)[0][cells[-1][1]] // 4]
    grand = second.quads.reshape(-1, 4, 4)[fine].reshape(-1, 4)
    cells += [(grand, None)]
    owner += [np.repeat(np.nonzero(fine)[0] // 4, 4)]
    polygons = np.concatenate([cell[0] for cell in cells])
    used = np.unique(polygons[polygons >= 0])
    new = np.full(second.S.shape[0] + 1, -1)
    new[used] = np.arange(len(used))
    S = second.S @ first.S if R is None else R @ (second.S @ first.S)
    return AdaptiveMesh(S[used].tocsr(), new[polygons], used, np.concatenate(owner))


def _cut(Q, E, split):
    """Quads Q (m, 4) with points E (m, 4) on those edges where split (m, 4): polygons and the quad each came from."""
    polygons, source = [], []
    count = split.sum(axis=1)

    def add(rows, columns):
        corners = np.full((len(rows), 4), -1)
        corners[:, : len(columns)] = np.stack(columns, axis=1)
        polygons.append(corners)
        source.append(rows)

    for turn in range(4):
        q = np.roll(Q, -turn, axis=1)
        e = np.roll(E, -turn, axis=1)
        s = np.roll(split, -turn, axis=1)

        def pick(mask, *what, q=q, e=e):
            rows = np.nonzero(mask)[0]
            for corners in what:
                add(rows, [(q if kind == "v" else e)[rows, int(i)] for kind, i in corners])

        if turn == 0:
            pick(count == 0, ["v0", "v1", "v2", "v3"])
            pick(count == 4, *[[f"v{i}", f"e{i}", f"e{(i + 3) % 4}"] for i in range(4)], ["e0", "e1", "e2", "e3"])
        pick((count == 1) & s[:, 0], ["v0", "e0", "v3"], ["e0", "v1", "v2"], ["e0", "v2", "v3"])
        if turn < 2:
            pick((count == 2) & s[:, 0] & s[:, 2], ["v0", "e0", "e2", "v3"], ["e0", "v1", "v2", "e2"])
        adjacent = (count == 2) & s[:, 0] & s[:, 1]
        pick(adjacent, ["e0", "v1", "e1"], ["v0", "e0", "v3"], ["e0", "e1", "v3"], ["e1", "v2", "v3"])
        three = (count == 3) & s[:, 0] & s[:, 1] & s[:, 2]
        pick(three, ["v0", "e0", "e2", "v3"], ["e0", "v1", "e1"], ["e1", "v2", "e2"], ["e0", "e1", "e2"])
    return np.concatenate(polygons), np.concatenate(source)


def triangulate(polygons, V, mirror):
    """Triangles (m, 3) of polygons (p, 4), and the polygons turned so that every quad is cut from corner 0 to 2.

    The shorter diagonal is taken, and the same one on both sides of the mirror plane.
    """
    polygons = polygons.copy()
    quad = polygons[:, 3] >= 0
    side = V[polygons[:, :3]].mean(axis=1)[:, 0] < 0
    twin = np.where(side[:, None], mirror[polygons], polygons)
    a, b, c, d = (V[twin[:, i]] for i in range(4))
    longer = ((a - c) ** 2).sum(1) > ((b - d) ** 2).sum(1) * (1 + 1e-9)
    turn = quad & longer
    polygons[turn] = np.roll(polygons[turn], -1, axis=1)
    triangles = np.concatenate([polygons[:, [0, 1, 2]], polygons[quad][:, [0, 2, 3]]])
    order = np.concatenate([np.arange(len(polygons)) * 2, np.nonzero(quad)[0] * 2 + 1])
    return triangles[np.argsort(order, kind="stable")], polygons
