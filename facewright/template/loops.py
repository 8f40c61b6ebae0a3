"""Loops and walks along the edges of a polygon mesh: narrowest cuts, chains of a loop, shortest ways."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, dijkstra, maximum_flow

from facewright.errors import StageError
from facewright.mesh.polygons import polygon_adjacency, polygon_edges, polygon_half_edges
from facewright.mesh.polyline import arc_lengths


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


class _EdgeFans:
    """Neighbours of vertices and polygons of edges, for walks along rings of quads."""

    def __init__(self, polygons):
        edges, owner = polygon_half_edges(polygons)
        self._corners = [set(p[p >= 0].tolist()) for p in polygons]
        self._neighbours, self._polygons = {}, {}
        for (a, b), polygon in zip(edges.tolist(), owner.tolist()):
            self._neighbours.setdefault(a, set()).add(b)
            self._neighbours.setdefault(b, set()).add(a)
            self._polygons.setdefault((min(a, b), max(a, b)), []).append(polygon)

    def opposite(self, before, vertex):
        """The neighbour of vertex straight across from before; None where the vertex has not four edges."""
        around = self._neighbours[vertex]
        if len(around) != 4:
            return None
        beside = set().union(*(self._corners[p] for p in self._polygons[min(before, vertex), max(before, vertex)]))
        across = [v for v in around if v != before and v not in beside]
        return across[0] if len(across) == 1 else None

    def ring(self, start, following, most):
        """The closed ring that goes straight on from an edge; None if it ends or takes more than most vertices."""
        ring = [start, following]
        while len(ring) < most:
            ahead = self.opposite(ring[-2], ring[-1])
            if ahead is None or ahead == start:
                return None if ahead is None else np.array(ring)
            ring.append(ahead)
        return None


def straightened(vertices, polygons, loop, *, edge_factor):
    """The cheapest closed straight ring that shares an edge with a loop; the loop itself where there is none.

    A narrowest cut may change rings here and there for a fraction of a millimetre; a ring of the mesh moves better.
    """
    fans = _EdgeFans(polygons)
    best, least = loop, np.inf
    for start, following in zip(loop.tolist(), np.roll(loop, -1).tolist()):
        ring = fans.ring(start, following, most=4 * len(loop))
        if ring is None:
            continue
        edges = np.stack([ring, np.roll(ring, -1)], axis=1)
        cost = float((np.linalg.norm(np.diff(vertices[edges], axis=1)[:, 0], axis=1) * edge_factor(edges)).sum())
        if cost < least:
            best, least = ring, cost
    return best


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


def paired(vertices, first, second, *, skip_mm=0.6):
    """Two chains (a,), (b,) of vertices with shared or facing ends, thinned so that they pair i <-> i: (k,), (k,).

    The vertices of two lips seldom face each other one by one. The pairing keeps the order and minimises
    sum over pairs |difference in arc length| + skip_mm per vertex left out (dynamic programming as for text).
    Arc lengths count in the mean length of both chains.
    """
    lengths = [arc_lengths(vertices[c]) for c in (first, second)]
    total = 0.5 * (lengths[0][-1] + lengths[1][-1])
    s, t = (length / length[-1] * total for length in lengths)
    a, b = len(first), len(second)
    cost = np.full((a, b), np.inf)
    step = np.zeros((a, b), int)
    cost[0, 0] = 0.0
    for i, j in itertools.product(range(a), range(b)):
        if i and j:
            ways = (cost[i - 1, j - 1] + abs(s[i] - t[j]), cost[i - 1, j] + skip_mm, cost[i, j - 1] + skip_mm)
        elif i or j:
            ways = (np.inf, cost[i - 1, j] + skip_mm if i else np.inf, cost[i, j - 1] + skip_mm if j else np.inf)
        else:
            continue
        step[i, j] = int(np.argmin(ways))
        cost[i, j] = ways[step[i, j]]
    pairs, i, j = [(a - 1, b - 1)], a - 1, b - 1
    # The last vertices are a pair whatever that costs; from there back along the cheapest way.
    i, j = i - 1, j - 1
    while i > 0 and j > 0:
        if step[i, j] == 0:
            pairs.append((i, j))
        i, j = i - (step[i, j] != 2), j - (step[i, j] != 1)
    pairs.append((0, 0))
    chosen = np.array(pairs[::-1])
    return first[chosen[:, 0]], second[chosen[:, 1]]
