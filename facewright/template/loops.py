"""Loops and walks along the edges of a polygon mesh: narrowest cuts, chains of a loop, shortest ways."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, dijkstra, maximum_flow

from facewright.errors import StageError
from facewright.mesh.polygons import polygon_adjacency, polygon_edges, polygon_half_edges


def separating_loop(vertices, polygons, inside, outside, *, edge_factor=None):
    """The shortest closed edge loop that separates two sets of polygons: a lid margin, a nostril's rim, the lips.

    Minimum cut in the dual graph; an edge costs its length times edge_factor((e, 2) vertices) -> (e,).

    vertices (n, 3), polygons (p, 4); inside, outside (p,) bool seeds
    returns  (k,) vertex indices in loop order, polygons of the inside to the left
    """
    pairs, edges = polygon_adjacency(polygons)
    cost = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    if edge_factor is not None:
        cost = cost * edge_factor(edges)
    capacity = np.maximum(1, np.round(cost * 2000)).astype(np.int32)
    p = len(polygons)
    source, sink = p, p + 1
    endless = np.int32(2**28)
    rows = np.concatenate([pairs[:, 0], pairs[:, 1], np.full(inside.sum(), source), np.flatnonzero(outside)])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0], np.flatnonzero(inside), np.full(outside.sum(), sink)])
    values = np.concatenate([capacity, capacity, np.full(inside.sum() + outside.sum(), endless)])
    graph = sp.csr_matrix((values, (rows, columns)), shape=(p + 2, p + 2))
    residual = graph - maximum_flow(graph, source, sink).flow
    residual.data = np.where(residual.data > 0, residual.data, 0)
    residual.eliminate_zeros()
    reached = np.zeros(p + 2, bool)
    reached[breadth_first_order(residual, source, return_predecessors=False)] = True
    return border_of(polygons, reached[:p])


def border_of(polygons, chosen):
    """The longest closed loop of vertices around a set of polygons (p,) bool, the set to its left."""
    edges, owner = polygon_half_edges(polygons)
    n = int(polygons.max()) + 1
    forward = edges[chosen[owner]]
    other = edges[~chosen[owner]]
    crossing = np.isin(forward[:, 0] * n + forward[:, 1], other[:, 1] * n + other[:, 0])
    following = dict(forward[crossing].tolist())
    loops = []
    while following:
        start, vertex = following.popitem()
        loop = [start]
        while vertex != start and vertex in following:
            loop.append(vertex)
            vertex = following.pop(vertex)
        loops.append(loop)
    if not loops:
        raise StageError("template", "no_loop", "no closed edge loop separates the inside from the outside")
    return np.array(max(loops, key=len))


def split_loop(loop, start, end):
    """Two chains of a closed loop from vertex start to vertex end, both with their ends."""
    loop = np.roll(loop, -int(np.flatnonzero(loop == start)[0]))
    cut = int(np.flatnonzero(loop == end)[0])
    return loop[: cut + 1], np.concatenate([loop[:1], loop[: cut - 1 : -1]])


def shortest_path(vertices, polygons, stops, *, edge_factor=None):
    """(k,) vertices of the shortest walk along edges and diagonals of quads through the given vertices in order."""
    quads = polygons[polygons[:, 3] >= 0]
    edges = np.concatenate([polygon_edges(polygons), quads[:, [0, 2]], quads[:, [1, 3]]])
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    if edge_factor is not None:
        length = length * edge_factor(edges)
    n = len(vertices)
    graph = sp.coo_matrix((length, (edges[:, 0], edges[:, 1])), shape=(n, n)).tocsr()
    walk = [int(stops[0])]
    for start, end in itertools.pairwise(stops):
        _, before = dijkstra(graph, directed=False, indices=int(start), return_predecessors=True)
        piece, vertex = [], int(end)
        while vertex != start:
            piece.append(vertex)
            vertex = int(before[vertex])
            if vertex < 0:
                raise StageError("template", "no_path", f"no walk along edges from vertex {start} to {end}")
        walk.extend(reversed(piece))
    return np.array(walk)


def paired(first, second):
    """Two chains with shared ends, thinned to the same length by leaving out vertices next to the ends.

    A loop around a mouth often has its corner on an edge, so that one lip has a vertex more at each end; those sit
    within a fraction of a millimetre of the corner.
    """
    surplus = len(first) - len(second)
    longer = first if surplus > 0 else second
    head, tail = (abs(surplus) + 1) // 2, abs(surplus) // 2
    thinned = np.concatenate([longer[:1], longer[1 + head : len(longer) - 1 - tail], longer[-1:]])
    return (thinned, second) if surplus > 0 else (first, thinned)
