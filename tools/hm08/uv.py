"""The atlas: the front of the face as one seamless island, everything else packed around it.

Each island is flattened by LSCM (Levy 2002) and then relaxed by SLIM (Rabinovich 2017), made mirror-symmetric, and
fitted into its place. The layout itself is mirror-symmetric: u <-> 1 - u.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np

from facewright.mesh.adjacency import border_loops, face_components
from facewright.mesh.laplacian import uniform_laplacian
from facewright.solve.quadratic import Factorization

MARGIN = 0.002  # free border around every island's place, in the atlas's units


@dataclass(frozen=True)
class Place:
    """Where an island goes: its box (u0, v0, u1, v1); turn in quarter turns."""

    box: tuple[float, float, float, float]
    turn: int = 0


# Mirrored partners are packed at 1 - u; "front", "scalp", "neck" and "bag" lie across the middle.
LAYOUT = {
    "front": Place((0.06, 0.2, 0.94, 1.0)),
    "scalp": Place((0.36, 0.0, 0.64, 0.2)),
    "neck": Place((0.0, 0.0, 0.36, 0.2)),
    "ear_left": Place((0.90, 0.62, 1.0, 0.82)),
    "socket_left": Place((0.90, 0.50, 1.0, 0.62)),
    "nostril_left": Place((0.90, 0.42, 1.0, 0.50)),
    "bag": Place((0.64, 0.0, 1.0, 0.2)),
}


def flatten(V, F, axis, iterations=40):
    """(k, 2) coordinates of a disk, mm; holes stay open.

    LSCM where it flips no triangle, else Tutte's embedding with the holes filled; then SLIM against the stretch.
    axis  (2,) vertices that end up one above the other: axis[0] below
    """
    V, F = np.ascontiguousarray(V), np.ascontiguousarray(F)
    height = np.linalg.norm(V[axis[1]] - V[axis[0]])
    uv, _ = igl.lscm(V, F, np.array(axis), np.array([[0.0, 0.0], [0.0, height]]))
    if signed_areas(uv, F).sum() < 0:
        uv = uv * [-1, 1]
    if (signed_areas(uv, F) <= 0).any():
        uv = tutte(F, len(V))
    uv = uv * np.sqrt(areas(V, F).sum() / np.abs(signed_areas(uv, F)).sum())
    data = igl.slim_precompute(
        np.asfortranarray(V),
        np.asfortranarray(F.astype(np.int32)),
        np.asfortranarray(uv),
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        np.array([], np.int32),
        np.asfortranarray(np.zeros((0, 2))),
        0.0,
    )
    uv = np.asarray(igl.slim_solve(data, iterations))
    up = uv[axis[1]] - uv[axis[0]]
    up = up / np.linalg.norm(up)
    return (uv - uv[axis[0]]) @ np.array([[up[1], up[0]], [-up[0], up[1]]])


def tutte(F, n):
    """(n, 2) embedding without flips: the longest border on a circle, holes filled by a vertex each (Tutte 1963)."""
    loops = border_loops(F)
    outer = loops[0]
    fans = [np.stack([loop[::1], np.roll(loop, -1), np.full(len(loop), n + i)], 1) for i, loop in enumerate(loops[1:])]
    filled = np.concatenate([F, *fans]) if fans else F
    total = n + len(fans)
    L = uniform_laplacian(filled, total).tocsr()
    angle = 2 * np.pi * np.arange(len(outer)) / len(outer)
    uv = np.zeros((total, 2))
    uv[outer] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    free = np.setdiff1d(np.arange(total), outer)
    uv[free] = Factorization(L[free][:, free]).solve(-(L[free] @ uv))
    return uv[:n]


def areas(V, F):
    return 0.5 * igl.doublearea(np.ascontiguousarray(V), np.ascontiguousarray(F))


def signed_areas(uv, F):
    a, b, c = uv[F[:, 0]], uv[F[:, 1]], uv[F[:, 2]]
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def fit(uv, place, symmetric):
    """uv scaled evenly into a place, centred; symmetric ones keep their middle line in the middle of the box."""
    uv = uv @ np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]), place.turn)
    low, high = uv.min(axis=0), uv.max(axis=0)
    u0, v0, u1, v1 = place.box
    room = np.array([u1 - u0, v1 - v0]) - 2 * MARGIN
    scale = (room / (high - low)).min()
    return (uv - 0.5 * (low + high)) * scale + [0.5 * (u0 + u1), 0.5 * (v0 + v1)]


def islands(V, F, mirror, regions):
    """(m,) island name of every triangle of the skin."""
    name = np.full(len(F), "scalp", dtype="U16")
    n = len(V)
    ear = regions["ear_left"] | regions["ear_right"]
    front = np.zeros(n, bool)
    outer_front = regions["face"] | regions["lips"] | regions["eyes"]
    front |= outer_front
    for _ in range(1):
        front = _dilated(front, F) & regions["outer"] & ~ear
    neck = regions["neck"] & ~front
    assign = (
        ("neck", neck[F].all(axis=1)),
        ("front", front[F].all(axis=1)),
        ("ear_left", regions["ear_left"][F].all(axis=1)),
        ("ear_right", regions["ear_right"][F].all(axis=1)),
        ("bag", regions["mouth_interior"][F].any(axis=1)),
        ("socket_left", regions["socket_left"][F].any(axis=1)),
        ("socket_right", regions["socket_right"][F].any(axis=1)),
        ("nostril_left", regions["nostrils"][F].any(axis=1) & (V[F].mean(axis=1)[:, 0] > 0)),
        ("nostril_right", regions["nostrils"][F].any(axis=1) & (V[F].mean(axis=1)[:, 0] < 0)),
    )
    for island, mask in assign:
        name[mask] = island
    return _in_one_piece(name, F, mirror)


def _dilated(mask, F):
    out = mask.copy()
    out[F[mask[F].any(axis=1)]] = True
    return out


def _face_twins(F, mirror):
    order = np.lexsort(np.sort(F, axis=1).T)
    image = np.lexsort(np.sort(mirror[F], axis=1).T)
    twin = np.empty(len(F), int)
    twin[image] = order
    return twin


OTHER_SIDE = {"ear_left": "ear_right", "socket_left": "socket_right", "nostril_left": "nostril_right"}


def _in_one_piece(name, F, mirror):
    """Crumbs of an island, and triangles that hang on by one edge alone, go to the island around them; symmetric."""
    twin = _face_twins(F, mirror)
    swap = OTHER_SIDE | {right: left for left, right in OTHER_SIDE.items()}
    for _ in range(12):
        before = name.copy()
        for island in np.unique(name):
            faces = np.flatnonzero(name == island)
            label = face_components(F[faces], int(F.max()) + 1)
            largest = np.bincount(label).argmax()
            name[faces[label != largest]] = ""
        neighbours = _face_neighbours(F)
        around = np.where(neighbours >= 0, name[neighbours], "")
        for island in ("front", "neck", "scalp", "ear_left", "ear_right"):
            many = (around == island).sum(axis=1) >= 2
            name[many & ~np.isin(name, ["bag", *OTHER_SIDE, *OTHER_SIDE.values()])] = island
            some = (around == island).any(axis=1)
            name[(name == "") & some] = island
        left = np.arange(len(F)) > twin
        name[left] = [swap.get(island, island) for island in name[twin[left]]]
        if (name == before).all():
            break
    return name


def _face_neighbours(F):
    """(m, 3) the triangle across each edge, -1 at a border."""
    half = F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    n = int(F.max()) + 1
    key, opposite = half[:, 0] * n + half[:, 1], half[:, 1] * n + half[:, 0]
    order = np.argsort(key)
    at = np.minimum(np.searchsorted(key[order], opposite), len(key) - 1)
    found = key[order[at]] == opposite
    return np.where(found, order[at] // 3, -1).reshape(-1, 3)


def build_atlas(V, F, mirror, regions):
    """uv (t, 2), uv_faces (m, 3) and the island names (m,) of the skin V (n, 3), F (m, 3)."""
    name = islands(V, F, mirror, regions)
    uv_faces = np.full(F.shape, -1)
    pieces, start = [], 0
    for island, place in LAYOUT.items():
        faces = np.flatnonzero(name == island)
        corners = _opened(V, F[faces]) if island == "neck" else F[faces]
        used, local = np.unique(corners, return_inverse=True)
        local = local.reshape(-1, 3)
        points = V[used % len(V)]
        uv = flatten(points, local, _axis(points, local, island))
        if island in OTHER_SIDE:
            uv = fit(uv, place, False)
        else:
            twin = _local_twin(used, mirror, len(V))
            uv = 0.5 * (uv + uv[twin] * [-1, 1] + [2 * uv[:, 0].mean(), 0])
            uv = fit(uv, place, True)
        uv_faces[faces] = local + start
        pieces.append(uv)
        start += len(uv)
        if island in OTHER_SIDE:
            other = np.flatnonzero(name == OTHER_SIDE[island])
            position = np.full(len(V), -1)
            position[mirror[used]] = np.arange(len(used))
            uv_faces[other] = position[F[other]] + start
            pieces.append(uv * [-1, 1] + [1, 0])
            start += len(uv)
    return np.concatenate(pieces), uv_faces, name


def _opened(V, F):
    """F (k, 3) of the neck with the midline behind doubled: the right half gets indices + n there."""
    right = V[F].mean(axis=1)[:, 0] < 0
    behind = (np.abs(V[F][:, :, 0]) < 1e-9) & (V[F][:, :, 2] < -70)
    return np.where(right[:, None] & behind, F + len(V), F)


def _local_twin(used, mirror, n):
    """(k,) index among used of each vertex's twin; a doubled vertex's twin is its double."""
    at = {int(v): i for i, v in enumerate(used)}
    doubled = {v % n for v in at if v >= n}

    def twin(v):
        if v >= n:
            return v - n
        return v + n if v in doubled else int(mirror[v])

    return np.array([at[twin(int(v))] for v in used])


def _axis(V, F, island):
    """Two vertices of an island that are to stand one above the other: for central ones on the midline."""
    middle = np.abs(V[:, 0]) < 1e-9
    if island in ("front", "scalp", "bag", "neck") and middle.sum() > 1:
        candidates = np.flatnonzero(middle)
        if island == "neck":
            candidates = candidates[V[candidates, 2] > -75]
        if island == "scalp":
            return candidates[[V[candidates, 2].argmin(), V[candidates, 2].argmax()]]
        return candidates[[V[candidates, 1].argmin(), V[candidates, 1].argmax()]]
    return np.array([V[:, 1].argmin(), V[:, 1].argmax()])




def unwrap_part(vertices, polygons):
    """uv (t, 2) and uv_polygons (p, 4) of a small part in its own square: each connected sheet beside the other,
    seen from the side where it is widest."""
    from facewright.mesh.adjacency import vertex_components
    from facewright.mesh.polygons import triangulated

    F = triangulated(polygons)[0]
    label = vertex_components(F, len(vertices))
    count = label.max() + 1
    uv = np.zeros((len(vertices), 2))
    for sheet in range(count):
        mine = label == sheet
        turn = np.arctan2(vertices[mine, 0], vertices[mine, 2] - vertices[mine, 2].min() + 10.0)
        plane = np.stack([turn, vertices[mine, 1]], axis=1)
        plane = (plane - plane.min(axis=0)) / np.ptp(plane, axis=0)
        uv[mine] = (0.02 + 0.96 * plane + [0, sheet]) / [1, count]
    return uv, polygons
