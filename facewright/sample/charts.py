"""A texture layout for any scan-like mesh: charts seen from a few directions, packed into the unit square."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from facewright.mesh.normals import face_normals
from facewright.mesh.raster import RayScene

FRONT = 0
DIRECTIONS = np.array(
    [
        *([0, 0.1, 1], [0.9, 0, 0.3], [-0.9, 0, 0.3], [0, 0, -1]),
        *([0, 1, -0.2], [0, -1, 0.2], [0.7, 0, -0.7], [-0.7, 0, -0.7]),
    ]
)
FRONT_BONUS = 0.25
FRONT_SCALE = 1.9


def face_neighbours(F):
    """(m, m) csr 0/1: faces that share an edge."""
    edges = np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge = np.unique(edges, axis=0, return_inverse=True)
    owner = np.repeat(np.arange(len(F)), 3)
    incidence = sp.coo_matrix((np.ones(len(owner)), (owner, edge.reshape(-1))), shape=(len(F), edge.max() + 1)).tocsr()
    neighbours = incidence @ incidence.T
    neighbours.setdiag(0)
    neighbours.eliminate_zeros()
    return neighbours


def choose_directions(V, F, neighbours, rounds=6):
    """(m,) index into DIRECTIONS per face: where it is seen well, agreed with its neighbours."""
    directions = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
    facing = face_normals(V, F) @ directions.T
    facing[:, 0] += FRONT_BONUS
    score = facing
    for _ in range(rounds):
        best = np.eye(len(directions))[score.argmax(axis=1)]
        score = facing + 0.35 * (neighbours @ best)
    return score.argmax(axis=1)


def charts(V, F):
    """(m,) chart per face, (c,) direction per chart: connected pieces that are seen whole from their direction."""
    neighbours = face_neighbours(F)
    direction = choose_directions(V, F, neighbours)
    units = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
    chart = np.full(len(F), -1)
    chart_direction = []
    left = np.ones(len(F), bool)
    while left.any():
        for d in range(len(units)):
            mine = np.flatnonzero(left & (direction == d))
            mine = mine[_on_top(V, F[mine], units[d])] if len(mine) else mine
            for piece in _pieces(neighbours, mine):
                chart[piece] = len(chart_direction)
                chart_direction.append(d)
            left[mine] = False
        # What another layer covers, or what looks away, tries the direction that it faces best by itself.
        direction[left] = (face_normals(V, F[left]) @ units.T).argmax(axis=1)
    return chart, np.array(chart_direction)


def _on_top(V, faces, direction):
    """(k,) bool: faces that look towards a direction and that no other of them covers when seen from there."""
    corners = V[faces]
    centers = corners.mean(axis=1)
    points = np.concatenate([centers[:, None], 0.8 * corners + 0.2 * centers[:, None]], axis=1).reshape(-1, 3)
    scene = RayScene(V, faces)
    hits = scene.cast(points + 600.0 * direction, np.broadcast_to(-direction, points.shape))
    seen = (np.abs(hits.distance - 600.0) < 0.02).reshape(-1, 4).all(axis=1)
    facing = face_normals(V, faces) @ direction > 0.05
    if not (seen & facing).any():  # nothing to gain from this view: take them one by one
        seen[np.flatnonzero(~seen)[0] if (~seen).any() else 0] = facing[:] = True
    return seen & facing


def _pieces(neighbours, chosen):
    """Connected pieces of some faces, as index arrays."""
    if not len(chosen):
        return []
    count, label = connected_components(neighbours[chosen][:, chosen], directed=False)
    order = np.argsort(label, kind="stable")
    return np.split(chosen[order], np.cumsum(np.bincount(label, minlength=count))[:-1])


def layout(V, F, *, gap=0.004):
    """uv (t, 2) in 0..1 and uv_faces (m, 3): every face has its own place in the square, seams between charts."""
    chart, chart_direction = charts(V, F)
    blocks, sizes, corners = [], [], []
    for c, d in enumerate(chart_direction):
        faces = F[chart == c]
        used, local = np.unique(faces, return_inverse=True)
        flat = V[used] @ _plane(DIRECTIONS[d]).T
        flat = (flat - flat.min(axis=0)) * (FRONT_SCALE if d == FRONT else 1.0)
        blocks.append(flat)
        sizes.append(flat.max(axis=0))
        corners.append((np.flatnonzero(chart == c), local.reshape(-1, 3)))
    sizes = np.array(sizes)
    scale, places = _largest_scale(sizes, gap)
    uv, uv_faces, offset = [], np.empty((len(F), 3), np.int64), 0
    for block, place, (which, local) in zip(blocks, places, corners):
        uv.append(block * scale + place)
        uv_faces[which] = local + offset
        offset += len(block)
    return np.vstack(uv), uv_faces


def _plane(direction):
    """(2, 3) right and up of a view along -direction."""
    backward = direction / np.linalg.norm(direction)
    up = np.array([0.0, 1.0, 0.0]) if abs(backward[1]) < 0.9 else np.array([0.0, 0.0, -np.sign(backward[1])])
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(backward, right)])


def _largest_scale(sizes, gap):
    """The largest scale at which all boxes (c, 2) fit the unit square in shelves, and their lower left corners."""
    low, high = 0.0, 1.0 / max(sizes.max(), 1e-9)
    best = None
    for _ in range(30):
        middle = (low + high) / 2
        places = _shelves(sizes * middle + gap)
        low, high = (middle, high) if places is not None else (low, middle)
        best = (middle, places + gap / 2) if places is not None else best
    return best


def _shelves(boxes):
    """(c, 2) lower left corners of boxes put in rows, the highest first; None if they do not fit."""
    places = np.empty_like(boxes)
    x = y = row = 0.0
    for i in np.argsort(-boxes[:, 1], kind="stable"):
        width, height = boxes[i]
        if x + width > 1.0:
            x, y, row = 0.0, y + row, 0.0
        if y + height > 1.0 or width > 1.0:
            return None
        places[i] = x, y
        x, row = x + width, max(row, height)
    return places
