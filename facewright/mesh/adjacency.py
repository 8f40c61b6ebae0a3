"""Edges, borders and neighbours of a triangle mesh (F (m, 3) over n vertices)."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components


def half_edges(F):
    """(3m, 2) directed edges, face by face: (0,1), (1,2), (2,0)."""
    return F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def unique_edges(F):
    """(e, 2) undirected edges, each once, lower index first."""
    n = int(F.max()) + 1 if len(F) else 0
    edges = half_edges(F)
    # One sorted key an edge: ten times faster than np.unique over rows.
    keys = np.sort(edges.min(axis=1) * n + edges.max(axis=1))
    keys = keys[np.concatenate([[True], keys[1:] != keys[:-1]])] if len(keys) else keys
    return np.stack(np.divmod(keys, max(n, 1)), axis=1)


def vertex_adjacency(F, n):
    """(n, n) csr matrix of 0/1: neighbours by an edge."""
    edges = unique_edges(F)
    ones = np.ones(len(edges))
    A = sp.coo_matrix((ones, (edges[:, 0], edges[:, 1])), shape=(n, n))
    return (A + A.T).tocsr()


def border_edges(F):
    """(b, 2) directed half-edges without an opposite one."""
    edges = half_edges(F)
    n = int(F.max()) + 1 if len(F) else 0
    keys = edges[:, 0] * n + edges[:, 1]
    opposite = edges[:, 1] * n + edges[:, 0]
    ordered = np.sort(keys)
    place = np.minimum(np.searchsorted(ordered, opposite), max(len(ordered) - 1, 0))
    return edges[ordered[place] != opposite]


def border_vertices(F, n):
    """(n,) bool: the vertex lies on a border."""
    mask = np.zeros(n, bool)
    mask[border_edges(F).ravel()] = True
    return mask


def border_loops(F):
    """Closed loops of border vertices, the longest first, each an (k,) index array in edge order."""
    following = dict(border_edges(F).tolist())
    loops = []
    while following:
        start, vertex = following.popitem()
        loop = [start]
        while vertex != start and vertex in following:
            loop.append(vertex)
            vertex = following.pop(vertex)
        loops.append(np.array(loop))
    return sorted(loops, key=len, reverse=True)


def vertex_components(F, n):
    """(n,) component label per vertex; vertices without faces are components of their own."""
    return connected_components(vertex_adjacency(F, n), directed=False)[1]


def face_components(F, n):
    """(m,) component label per face."""
    return vertex_components(F, n)[F[:, 0]]


def differing(one, other):
    """(n,) bool: vertices (n, 3) that are not in the same place."""
    differ = one != other
    return differ[:, 0] | differ[:, 1] | differ[:, 2]


def touching(mask, F):
    """(m,) bool: faces with a corner in a vertex mask (n,); ten times as quick as any() over rows of three."""
    return mask[F[:, 0]] | mask[F[:, 1]] | mask[F[:, 2]]


def within(mask, F):
    """(m,) bool: faces with all corners in a vertex mask (n,)."""
    return mask[F[:, 0]] & mask[F[:, 1]] & mask[F[:, 2]]


def dilate(mask, F, rings=1):
    """Grow a vertex mask (n,) by so many rings of neighbours."""
    for _ in range(rings):
        grown = mask.copy()
        grown[F[touching(mask, F)].ravel()] = True
        mask = grown
    return mask
