"""The two sides of a closed seam in a mesh: an upper and a lower lip."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import unique_edges


def seam_sides(vertices, faces, upper, lower, reach_mm=8.0, *, split_ends=True):
    """Masks (n,) of the two sides of a seam: within reach_mm of it, nearer along the surface to that side.

    upper, lower (k,) the paired seam lines with shared ends; the ends belong to neither side
    split_ends  what is nearest to an end is given to a side too; else it belongs to neither
    """
    n = len(vertices)
    edges = unique_edges(faces)
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    graph = sp.coo_matrix((length, (edges[:, 0], edges[:, 1])), shape=(n, n)).tocsr()
    away = [
        dijkstra(graph, directed=False, indices=line[1:-1], min_only=True, limit=reach_mm) for line in (upper, lower)
    ]
    near = np.minimum(*away) < reach_mm
    if not split_ends:
        near &= np.minimum(*away) < dijkstra(
            graph, directed=False, indices=upper[[0, -1]], min_only=True, limit=reach_mm
        )
    is_upper, is_lower = near & (away[0] < away[1]), near & (away[1] < away[0])
    corners = [upper[0], upper[-1]]
    is_upper[corners] = is_lower[corners] = False
    return is_upper, is_lower


def inner_sides(vertices, faces, upper, lower, reach_mm, corner_mm=1.0):
    """Masks (n,) of the two sides of a seam as seam_sides gives them, without what is nearest to an end of it.

    corner_mm  from an end: part of the seam that counts as that end
    """
    seam = vertices[np.concatenate([upper, lower])]
    from_corner = cKDTree(vertices[upper[[0, -1]]]).query(seam)[0]
    inner = from_corner[cKDTree(seam).query(vertices)[1]] > corner_mm
    return [side & inner for side in seam_sides(vertices, faces, upper, lower, reach_mm, split_ends=False)]
