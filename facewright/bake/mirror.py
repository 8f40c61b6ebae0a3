"""Which point of a map shows the same spot on the other side of the face."""

from __future__ import annotations

import numpy as np


def mirrored_corner_uv(faces, polygons, uv_polygons, uv, mirror):
    """(m, 3, 2): for each face corner the UV of its vertex's twin; NaN for a face whose twin does not exist.

    faces (m, 3), polygons (p, 4) and uv_polygons (p, 4) with -1 padding a triangle, uv (t, 2), mirror (n,).
    A quad's two triangles may be cut along the other diagonal on the other side, so a face is matched to the mirrored
    polygon that holds its three twins, not to a triangle.
    """
    n = int(max(mirror.max(), polygons.max())) + 1
    corner_sets = [(0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)]
    keys, owners = [], []
    for corners in corner_sets:
        triples = polygons[:, corners]
        whole = np.flatnonzero((triples >= 0).all(1))
        keys.append(_triple_keys(triples[whole], n))
        owners.append(whole)
    keys, owners = np.concatenate(keys), np.concatenate(owners)
    order = np.argsort(keys, kind="stable")
    keys, owners = keys[order], owners[order]

    twins = mirror[faces]  # (m, 3)
    wanted = _triple_keys(twins, n)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found = keys[place] == wanted
    polygon = owners[place]
    result = np.full((*faces.shape, 2), np.nan)
    for corner in range(3):
        at = (polygons[polygon] == twins[:, corner, None]).argmax(1)
        result[:, corner] = uv[uv_polygons[polygon, at]]
    result[~found] = np.nan
    return result


def _triple_keys(triples, n):
    """One int per unordered triple (k, 3) of indices below n (n up to two million)."""
    a, b, c = np.sort(triples.astype(np.int64), axis=1).T
    return (a * n + b) * n + c
