"""Meshes of triangles and quads as (p, 4) arrays, -1 in the fourth place of a triangle."""

import numpy as np


def polygon_half_edges(polygons):
    """(h, 2) directed edges and (h,) the polygon of each."""
    count = np.where(polygons[:, 3] < 0, 3, 4)
    starts, owners = [], []
    ends = []
    for corner in range(4):
        there = corner < count
        following = np.where(corner + 1 < count, (corner + 1) % 4, 0)
        starts.append(polygons[there, corner])
        ends.append(polygons[np.arange(len(polygons)), following][there])
        owners.append(np.flatnonzero(there))
    edges = np.stack([np.concatenate(starts), np.concatenate(ends)], axis=1)
    return edges, np.concatenate(owners)


def polygon_edges(polygons):
    """(e, 2) undirected edges, each once, lower index first."""
    return np.unique(np.sort(polygon_half_edges(polygons)[0], axis=1), axis=0)


def triangulated(polygons):
    """(m, 3) triangles, in the order of the polygons, quads cut from corner 0 to 2; and (m,) the polygon of each."""
    quads = polygons[:, 3] >= 0
    count = np.where(quads, 2, 1)
    owner = np.repeat(np.arange(len(polygons)), count)
    second = np.zeros(len(owner), bool)
    second[np.cumsum(count)[quads] - 1] = True
    corners = np.where(second[:, None], polygons[owner][:, [0, 2, 3]], polygons[owner][:, [0, 1, 2]])
    return corners, owner


def polygon_adjacency(polygons):
    """(k, 2) pairs of polygons that share an edge and (k, 2) that edge's vertices."""
    edges, owner = polygon_half_edges(polygons)
    keys = np.sort(edges, axis=1)
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    same = (keys[order[1:]] == keys[order[:-1]]).all(axis=1)
    pairs = np.stack([owner[order[:-1][same]], owner[order[1:][same]]], axis=1)
    return pairs, keys[order[:-1][same]]


def polygon_centers(vertices, polygons):
    """(p, 3) mean of the corners."""
    corners = np.where(polygons < 0, polygons[:, [0]], polygons)
    weight = (polygons >= 0)[:, :, None]
    return (vertices[corners] * weight).sum(axis=1) / weight.sum(axis=1)
