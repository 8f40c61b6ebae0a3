"""The mirror map of a head, and making a head exactly symmetric about x = 0."""

import itertools

import numpy as np
from scipy.spatial import cKDTree

from facewright.errors import InputError
from facewright.mesh.polygons import polygon_edges

FLIP = np.array([-1.0, 1.0, 1.0])


def mirror_map(vertices, polygons, *, groups=None, twin_groups=None, tolerance_mm=1.0):
    """(n,) for each vertex its twin across x = 0, such that edges map to edges.

    vertices (n, 3) mm, polygons (p, 4). Nearest neighbours of the reflected vertices decide; where several lie
    together (strips back to back), the one whose neighbours are the twins of the vertex's neighbours is taken.
    groups, twin_groups (n,) int: a vertex's twin is looked for where groups equals its twin_groups (left, right eye)
    raises   InputError if a vertex has no twin within tolerance_mm
    """
    n = len(vertices)
    zero = np.zeros(n)
    here = np.column_stack([vertices, 1e4 * (zero if groups is None else groups)])
    there = np.column_stack([vertices * FLIP, 1e4 * (zero if groups is None else twin_groups)])
    tree = cKDTree(here)
    distance, nearest = tree.query(there)
    mirror = np.where((nearest[nearest] == np.arange(n)) & (distance < tolerance_mm), nearest, -1)
    mirror = _drop_crowded(mirror, here, tree)
    neighbours = _neighbour_lists(polygons, n)
    open_vertices = np.flatnonzero(mirror < 0)
    # Candidates in a wider circle than the nearest: the nearest may belong to the strip behind.
    candidates = {int(v): tree.query_ball_point(there[v], tolerance_mm) for v in open_vertices}
    while len(open_vertices):
        assigned = 0
        taken = set(mirror[mirror >= 0].tolist())
        for v in open_vertices:
            want = {int(mirror[u]) for u in neighbours[v] if mirror[u] >= 0}
            good = [c for c in candidates[int(v)] if c not in taken and want and want <= set(neighbours[c])]
            if len(good) >= 1 and (len(good) == 1 or len(want) >= 2):
                best = min(good, key=lambda c, v=v: np.linalg.norm(vertices[c] - vertices[v] * FLIP))
                mirror[v], mirror[best] = best, v
                taken.update((int(v), int(best)))
                assigned += 1
        open_vertices = np.flatnonzero(mirror < 0)
        if not assigned and len(open_vertices):
            v = int(open_vertices[0])
            raise InputError(
                f"template: {len(open_vertices)} vertices, the first {v} at {vertices[v].round(2).tolist()} mm, "
                f"have no mirrored twin within {tolerance_mm} mm; the neutral must be symmetric about x = 0"
            )
    return mirror


def _drop_crowded(mirror, points, tree, radius=0.02):
    """Undo pairs of vertices that share their place with another vertex: a coin toss decided them."""
    crowded = np.array([len(found) > 1 for found in tree.query_ball_point(points, radius)])
    drop = crowded & (mirror >= 0)
    drop[mirror[drop]] = True
    return np.where(drop, -1, mirror)


def _neighbour_lists(polygons, n):
    edges = polygon_edges(polygons)
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    starts = np.searchsorted(both[:, 0], np.arange(n + 1))
    return [both[a:b, 1].tolist() for a, b in itertools.pairwise(starts)]


def symmetrized(positions, mirror):
    """Mean of positions (n, 3) and their mirror image: exactly symmetric, midline at x = 0 to the last bit."""
    mean = 0.5 * (positions + positions[mirror] * FLIP)
    mean[mirror == np.arange(len(mirror)), 0] = 0.0
    return mean


def mirrored_field(field, mirror):
    """A displacement field (..., n, 3) seen in the mirror: what the left did, the right does."""
    return field[..., mirror, :] * FLIP
