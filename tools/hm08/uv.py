"""The atlas: the front of the face as one seamless island, everything else packed around it.

Each island is flattened by LSCM (Levy 2002; Tutte where that flips a triangle) and relaxed by SLIM (Rabinovich 2017),
made mirror-symmetric, and fitted into its place. The layout itself is mirror-symmetric, u <-> 1 - u, but for the places
of scalp, neck and mouth bag.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy.optimize import minimize

from facewright.evaluate.uv import signed_uv_areas, weighted_quantile
from facewright.mesh.adjacency import border_loops, dilate, vertex_components
from facewright.mesh.laplacian import uniform_laplacian
from facewright.mesh.normals import face_areas
from facewright.mesh.polygons import polygon_adjacency, triangulated
from facewright.solve.quadratic import Factorization

MARGIN = 0.002  # free border around every island's place, in the atlas's units
SLIM_ITERATIONS = 40
POLISH_POWER = 4  # how much the worst triangles count
AREA_POWER = 3  # how much a wrong area counts beside a wrong shape


@dataclass(frozen=True)
class Place:
    """Where an island goes: its box (u0, v0, u1, v1)."""

    box: tuple[float, float, float, float]


# The right partner of a left island is its mirror image, at 1 - u.
LAYOUT = {
    "front": Place((0.03, 0.175, 0.97, 1.0)),
    "neck": Place((0.12, 0.0, 0.53, 0.175)),
    "scalp": Place((0.53, 0.0, 0.88, 0.175)),
    "ear_left": Place((0.88, 0.0, 1.0, 0.175)),
    "bag": Place((0.87, 0.185, 1.0, 0.30)),
    "socket_left": Place((0.93, 0.31, 1.0, 0.40)),
    "nostril_left": Place((0.93, 0.92, 1.0, 1.0)),
}
OTHER_SIDE = {"ear_left": "ear_right", "socket_left": "socket_right", "nostril_left": "nostril_right"}
SWAP = OTHER_SIDE | {right: left for left, right in OTHER_SIDE.items()}
INNER = ("bag", "socket_left", "socket_right", "nostril_left", "nostril_right")


def build_atlas(V, polygons, mirror, regions, V_open):
    """uv (t, 2), uv_polygons (p, 4) and the island names (p,) of the skin V (n, 3), polygons (p, 4).

    V_open (n, 3) the same head with lips parted: flattened in place of V, so that the mouth's hole stays open
    """
    name = islands(V, polygons, mirror, regions)
    uv_polygons = np.full(polygons.shape, -1)
    pieces, start = [], 0
    for island, place in LAYOUT.items():
        chosen = np.flatnonzero(name == island)
        corners = _opened(V, polygons[chosen]) if island == "neck" else polygons[chosen]
        used = np.unique(corners[corners >= 0])
        local = np.where(corners >= 0, np.searchsorted(used, corners), -1)
        points, F = filled(V_open[used % len(V)], triangulated(local)[0])
        uv = flatten(points, F, _axis(points[: len(used)], island), island == "front")
        if island not in OTHER_SIDE:
            twin = _with_centers(_local_twin(used, mirror, len(V)), points)
            uv = _symmetric(uv, twin)
        if island == "front":
            flat = flat_triangles(np.concatenate([V[used], points[len(used) :]]), F)
            hole = F.max(axis=1) >= len(used)
            flat[hole] = flat_triangles(points, F[hole])
            for _ in range(2):
                uv = _symmetric(polish(flat, hole, F, uv), twin)
        uv = uv[: len(used)]
        uv = fit(uv, place)
        uv_polygons[chosen] = np.where(local >= 0, local + start, -1)
        pieces.append(uv)
        start += len(uv)
        if island in OTHER_SIDE:
            other = np.flatnonzero(name == OTHER_SIDE[island])
            position = np.full(len(V), -1)
            position[mirror[used]] = np.arange(len(used))
            uv_polygons[other] = np.where(polygons[other] >= 0, position[polygons[other]] + start, -1)
            pieces.append(uv * [-1, 1] + [1, 0])
            start += len(uv)
    return np.concatenate(pieces), uv_polygons, name


def islands(V, polygons, mirror, regions):
    """(p,) island name of every polygon of the skin; mirror-symmetric, each in one piece."""
    corners = np.where(polygons >= 0, polygons, polygons[:, [0]])
    n, left = len(V), V[corners].mean(axis=1)[:, 0] > 0
    ear = regions["ear_left"] | regions["ear_right"]
    front = regions["face"] | regions["lips"] | regions["eyes"]
    grown = np.zeros(n, bool)
    grown[corners[front[corners].any(axis=1)]] = True
    front = grown & regions["outer"] & ~ear
    neck = regions["neck"] & ~front
    name = np.full(len(polygons), "scalp", dtype="U16")
    for island, mask in (
        ("neck", neck[corners].any(axis=1)),
        ("front", front[corners].all(axis=1)),
        ("ear_left", regions["ear_left"][corners].all(axis=1)),
        ("ear_right", regions["ear_right"][corners].all(axis=1)),
        ("bag", regions["mouth_interior"][corners].any(axis=1)),
        ("socket_left", regions["socket_left"][corners].any(axis=1)),
        ("socket_right", regions["socket_right"][corners].any(axis=1)),
        ("nostril_left", regions["nostrils"][corners].any(axis=1) & left),
        ("nostril_right", regions["nostrils"][corners].any(axis=1) & ~left),
    ):
        name[mask] = island
    return _in_one_piece(name, polygons, mirror)


def _in_one_piece(name, polygons, mirror):
    """Crumbs of an island, and polygons that hang on by one edge, go to the island around them; symmetric."""
    twin = _polygon_twins(polygons, mirror)
    pairs, _ = polygon_adjacency(polygons)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    sides = np.where(polygons[:, 3] >= 0, 4, 3)
    copied = np.arange(len(name)) > twin
    for _ in range(20):
        before = name.copy()
        for island in ("front", "neck", "scalp", "ear_left", "ear_right"):
            mine = name == island
            inside = pairs[mine[pairs].all(axis=1)]
            label = vertex_components(np.column_stack([inside, inside[:, 1]]), len(name))
            largest = np.bincount(label[mine]).argmax()
            name[mine & (label != largest)] = ""
            around = np.bincount(both[:, 0], weights=name[both[:, 1]] == island, minlength=len(name))
            name[(around >= sides - 1) & ~np.isin(name, INNER)] = island
            name[(around > 0) & (name == "")] = island
        name[copied] = [SWAP.get(island, island) for island in name[twin[copied]]]
        if (name == before).all():
            break
    return name


def _polygon_twins(polygons, mirror):
    """(p,) the polygon on the other side of the mirror plane."""
    image = np.where(polygons >= 0, mirror[polygons], -1)
    order, other = np.lexsort(np.sort(polygons, axis=1).T), np.lexsort(np.sort(image, axis=1).T)
    twin = np.empty(len(polygons), int)
    twin[other] = order
    return twin


def _opened(V, polygons):
    """Polygons (k, 4) of the neck with the midline behind doubled: the right half gets indices + n there."""
    corners = np.where(polygons >= 0, polygons, polygons[:, [0]])
    right = V[corners].mean(axis=1)[:, 0] < 0
    behind = (np.abs(V[corners][:, :, 0]) < 1e-9) & (V[corners][:, :, 2] < -70)
    return np.where((right[:, None] & behind) & (polygons >= 0), polygons + len(V), polygons)


def _local_twin(used, mirror, n):
    """(k,) index among used of each vertex's twin; a doubled vertex's twin is its double."""
    at = {int(v): i for i, v in enumerate(used)}
    doubled = {v % n for v in at if v >= n}

    def twin(v):
        if v >= n:
            return v - n
        return v + n if v in doubled else int(mirror[v])

    return np.array([at[twin(int(v))] for v in used])


def _with_centers(twin, points):
    """The twins (k,) of an island's vertices followed by those of the centres of its filled holes."""
    k = len(twin)
    gap = np.linalg.norm(points[k:, None] * [-1, 1, 1] - points[None, k:], axis=2)
    return np.concatenate([twin, k + gap.argmin(axis=1)]) if len(points) > k else twin


def _axis(V, island):
    """Two vertices of an island that are to stand one above the other: for central islands on the midline."""
    candidates = np.flatnonzero(np.abs(V[:, 0]) < 1e-9)
    if island in OTHER_SIDE:
        return np.array([V[:, 1].argmin(), V[:, 1].argmax()])
    along = 2 if island == "scalp" else 1
    if island == "neck":
        candidates = candidates[V[candidates, 2] > -75]
    return candidates[[V[candidates, along].argmin(), V[candidates, along].argmax()]]


def filled(V, F):
    """V and F with every hole but the longest border closed by a fan about a new vertex."""
    n = len(V)
    holes = border_loops(F)[1:]
    # A border runs against its hole's winding.
    fans = [np.stack([np.roll(loop, -1), loop, np.full(len(loop), n + i)], axis=1) for i, loop in enumerate(holes)]
    centers = [V[loop].mean(axis=0)[None] for loop in holes]
    return np.ascontiguousarray(np.concatenate([V, *centers])), np.concatenate([F, *fans])


def flatten(V, F, axis, careful=False):
    """(n, 2) coordinates of a disk without holes, mm, without flips.

    axis  (2,) vertices that end up one above the other: axis[0] below
    careful  a second round that cares for the worst triangles
    """
    height = np.linalg.norm(V[axis[1]] - V[axis[0]])
    uv, _ = igl.lscm(V, F, np.array(axis), np.array([[0.0, 0.0], [0.0, height]]))
    if signed_uv_areas(uv, F).sum() < 0:
        uv = uv * [-1, 1]
    if (signed_uv_areas(uv, F) <= 0).any():
        uv = tutte(F, len(V))
    uv = slim(V, F, uv * np.sqrt(face_areas(V, F).sum() / np.abs(signed_uv_areas(uv, F)).sum()))
    if careful:
        uv = slim(V, F, uv, igl.MappingEnergyType.EXP_SYMMETRIC_DIRICHLET)
    up = uv[axis[1]] - uv[axis[0]]
    up = up / np.linalg.norm(up)
    return (uv - uv[axis[0]]) @ np.array([[up[1], up[0]], [-up[0], up[1]]])


def slim(V, F, uv, energy=igl.MappingEnergyType.SYMMETRIC_DIRICHLET):
    """uv (n, 2) relaxed from a start without flips: symmetric Dirichlet energy, free border."""
    data = igl.slim_precompute(
        np.asfortranarray(V),
        np.asfortranarray(F.astype(np.int32)),
        np.asfortranarray(uv),
        energy,
        np.array([], np.int32),
        np.asfortranarray(np.zeros((0, 2))),
        0.0,
    )
    return np.asarray(igl.slim_solve(data, SLIM_ITERATIONS))


def polish(flat, hole, F, uv, *, low=0.62, high=1.6, rings=7):
    """uv (n, 2) with the area scale evened out where it leaves low..high of the median, and some rings around.

    SLIM weighs a triangle by its area, so tiny ones (corners of the mouth) pay for their neighbours; here all count
    alike, and the worst most: sum of powers of the symmetric Dirichlet energy and the area distortion, relative to the
    median scale, by L-BFGS, the rest of the island held.

    flat (m, 2, 2) the triangles at rest, from flat_triangles; hole (m,) bool: fillers, not part of the island
    """
    area = 0.5 * np.linalg.det(flat)
    scale = signed_uv_areas(uv, F) / area
    median = weighted_quantile(scale[~hole], area[~hole], 0.5)
    bad = ~hole & ((scale < low * median) | (scale > high * median))
    if not bad.any():
        return uv
    free = dilate(np.isin(np.arange(len(uv)), F[bad]), F[~hole], rings)
    free[np.unique(border_loops(F)[0])] = False
    active = np.flatnonzero(free[F].any(axis=1))
    T, inverse = F[active], np.linalg.inv(flat[active] * np.sqrt(median))
    weight = np.where(hole[active], 1e-2, 1.0)
    free = np.flatnonzero(free)

    def energy(x):
        moved = uv.copy()
        moved[free] = x.reshape(-1, 2)
        value, slope = distortion(moved, T, inverse)
        if value is None:
            return 1e12, np.zeros_like(x)
        slope = (weight * POLISH_POWER * value ** (POLISH_POWER - 1))[:, None, None] * slope
        gradient = np.zeros_like(uv)
        for corner, part in ((1, slope[:, :, 0]), (2, slope[:, :, 1]), (0, -slope.sum(axis=2))):
            np.add.at(gradient, T[:, corner], part)
        return float((weight * value**POLISH_POWER).sum()), gradient[free].ravel()

    found = minimize(energy, uv[free].ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 600, "maxfun": 900})
    out = uv.copy()
    out[free] = found.x.reshape(-1, 2)
    return out


def distortion(uv, F, inverse):
    """(m,) symmetric Dirichlet energy times area distortion, 1 at best, and its slope (m, 2, 2) by the edges' columns.

    inverse (m, 2, 2) of the edges at rest; None where a triangle is flipped
    """
    edges = np.stack([uv[F[:, 1]] - uv[F[:, 0]], uv[F[:, 2]] - uv[F[:, 0]]], axis=2)
    J = edges @ inverse
    det = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]
    if det.min() <= 1e-6:
        return None, None
    square = (J**2).sum(axis=(1, 2))
    cofactor = np.stack([J[:, 1, 1], -J[:, 1, 0], -J[:, 0, 1], J[:, 0, 0]], axis=1).reshape(-1, 2, 2)
    shape, spread = square * (1 + det**-2) / 4, (det + 1 / det) / 2
    shape_slope = J * ((1 + det**-2) / 2)[:, None, None] - (square * det**-3 / 2)[:, None, None] * cofactor
    spread_slope = ((1 - det**-2) / 2)[:, None, None] * cofactor
    slope = shape_slope * (spread**AREA_POWER)[:, None, None]
    slope += spread_slope * (AREA_POWER * shape * spread ** (AREA_POWER - 1))[:, None, None]
    return shape * spread**AREA_POWER, slope @ inverse.transpose(0, 2, 1)


def flat_triangles(V, F):
    """(k, 2, 2) edge vectors as columns, each triangle laid into its own plane."""
    edge1, edge2 = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    length = np.linalg.norm(edge1, axis=1)
    x = (edge1 * edge2).sum(axis=1) / length
    y = np.sqrt(np.maximum((edge2**2).sum(axis=1) - x**2, 1e-18))
    return np.stack([np.stack([length, x], axis=1), np.stack([0 * x, y], axis=1)], axis=1)


def tutte(F, n):
    """(n, 2) embedding of a disk without holes and flips, its border on the unit circle (Tutte 1963)."""
    outer = border_loops(F)[0]
    L = uniform_laplacian(F, n).tocsr()
    angle = 2 * np.pi * np.arange(len(outer)) / len(outer)
    uv = np.zeros((n, 2))
    uv[outer] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    free = np.setdiff1d(np.arange(n), outer)
    uv[free] = Factorization(L[free][:, free]).solve(-(L[free] @ uv))
    return uv


def _symmetric(uv, twin):
    middle = 0.5 * (uv + uv[twin])[:, 0].mean()
    centred = uv - [middle, 0.0]
    return 0.5 * (centred + centred[twin] * [-1, 1])


def fit(uv, place):
    """uv scaled evenly into a place, centred."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    u0, v0, u1, v1 = place.box
    scale = ((np.array([u1 - u0, v1 - v0]) - 2 * MARGIN) / (high - low)).min()
    return (uv - 0.5 * (low + high)) * scale + [0.5 * (u0 + u1), 0.5 * (v0 + v1)]
