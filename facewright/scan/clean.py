"""Repair what exporters and scanners leave behind. The surface never moves: points are joined only where they meet,
faces are dropped or turned, nothing is filled or smoothed.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import igl
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from facewright.errors import InputError
from facewright.mesh.adjacency import border_edges, border_loops, face_components, half_edges
from facewright.mesh.normals import face_areas, face_cross, face_normals
from facewright.mesh.raster import RayScene

# Points nearer than this share of the bounding box's diagonal are one point: float32 rounding, not geometry.
WELD_SHARE = 1e-6
# A component smaller than this share of the largest one's area is a crumb.
CRUMB_SHARE = 0.01
RAYS_PER_PATCH = 4096


def clean_scan(scan):
    """A Scan ready for the stages, and what was done to it.

    Welds points that meet, drops degenerate and duplicate faces and floating crumbs, turns faces so that they look
    outward, and lists the holes. UVs, textures and colours stay with their faces and points.

    returns  Scan, dict(welded, degenerate, duplicate, crumbs, crumb_faces, turned, holes, components, closed)
    raises   InputError where no face is left
    """
    n_before = len(scan.vertices)
    scan = weld(scan)
    stats = {"welded": n_before - len(scan.vertices)}
    degenerate = degenerate_faces(scan.vertices, scan.faces)
    scan = keep_faces(scan, ~degenerate)
    if not len(scan.faces):
        raise InputError(f"{scan.name}: has no face with any area; export it again as a triangle mesh")
    duplicate = duplicate_faces(scan.faces)
    scan = keep_faces(scan, ~duplicate)
    crumb, n_crumbs = crumbs(scan.vertices, scan.faces)
    scan = keep_faces(scan, ~crumb)
    turned = inward_faces(scan.vertices, scan.faces)
    scan = turn_faces(scan, turned)
    loops = border_loops(scan.faces)
    stats |= {
        "degenerate": int(degenerate.sum()),
        "duplicate": int(duplicate.sum()),
        "crumbs": n_crumbs,
        "crumb_faces": int(crumb.sum()),
        "turned": int(turned.sum()),
        "holes": [len(loop) for loop in loops],
        "components": len(np.unique(face_components(scan.faces, len(scan.vertices)))),
        "closed": not loops,
    }
    return replace(scan, notes=scan.notes + tuple(_notes(stats, len(turned)))), stats


def _notes(stats, n_faces):
    if stats["crumbs"]:
        yield f"dropped {stats['crumbs']} floating crumbs of {stats['crumb_faces']} faces in all"
    if stats["turned"] == n_faces:
        yield "the mesh was inside out; all faces were turned"
    elif stats["turned"]:
        yield f"{stats['turned']} of {n_faces} faces looked inward and were turned"


def weld(scan):
    """Points at the same place become one; colours come from the first of them."""
    label = coincident_points(scan.vertices, scan.faces)
    n = int(label.max()) + 1 if len(label) else 0
    first = np.full(n, len(label))
    np.minimum.at(first, label, np.arange(len(label)))
    order = np.argsort(first)  # keep the file's order of points
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    keep = first[order]
    colors = None if scan.colors is None else scan.colors[keep]
    return replace(scan, vertices=scan.vertices[keep], faces=place[label][scan.faces], colors=colors)


def coincident_points(vertices, faces):
    """(n,) label of points that are one: equal to the bit, or on a border and within WELD_SHARE of the size."""
    n = len(vertices)
    exact = np.unique(
        np.ascontiguousarray(vertices + 0.0).view([("", np.float64)] * 3).reshape(-1), return_inverse=True
    )
    label = exact[1].reshape(-1)
    border = np.unique(border_edges(label[faces]))
    if not len(border):
        return label
    first = np.full(int(label.max()) + 1, n)
    np.minimum.at(first, label, np.arange(n))
    tolerance = WELD_SHARE * np.linalg.norm(np.ptp(vertices, axis=0))
    pairs = cKDTree(vertices[first[border]]).query_pairs(tolerance, output_type="ndarray")
    if not len(pairs):
        return label
    a, b = border[pairs[:, 0]], border[pairs[:, 1]]
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(first), len(first)))
    return connected_components(graph, directed=False)[1][label]


def degenerate_faces(vertices, faces):
    """(m,) bool: two corners are one, or no area is left in float64."""
    a, b, c = faces.T
    same = (a == b) | (b == c) | (c == a)
    size = np.linalg.norm(np.ptp(vertices, axis=0)) if len(vertices) else 1.0
    return same | (np.linalg.norm(face_cross(vertices, faces), axis=1) <= 1e-14 * size * size)


def duplicate_faces(faces):
    """(m,) bool: a face with the same three corners, in any order, came before."""
    corners = np.sort(faces, axis=1)
    n = int(faces.max()) + 1 if len(faces) else 1
    order = np.lexsort((corners[:, 2], corners[:, 0] * n + corners[:, 1]))  # stable: equal faces stay in order
    ordered = corners[order]
    repeats = np.concatenate([[False], (ordered[1:] == ordered[:-1]).all(axis=1)])
    duplicate = np.zeros(len(faces), bool)
    duplicate[order[repeats]] = True
    return duplicate


def crumbs(vertices, faces):
    """(m,) bool: faces of pieces under CRUMB_SHARE of the largest one's area; and the number of these pieces.

    A piece is what hangs together by vertices. So is what hangs on an edge of two other faces and ends in the air, as a
    card of lashes whose roots are points of the lid.
    """
    areas = face_areas(vertices, faces)
    floating, n_floating = _small(face_components(faces, len(vertices)), areas)
    patch = np.asarray(igl.bfs_orient(np.ascontiguousarray(faces))[1])
    hanging = _small(patch, areas)[0] & ~floating
    if hanging.any():
        edges = np.sort(half_edges(faces), axis=1)
        _, edge, count = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True, return_counts=True)
        free = np.zeros(int(patch.max()) + 1, bool)
        free[patch[(count == 1)[edge].reshape(-1, 3).any(axis=1)]] = True
        hanging &= free[patch]
    return floating | hanging, n_floating + len(np.unique(patch[hanging]))


def _small(piece, areas):
    """(m,) bool: faces of a piece (m,) that is small; and how many pieces are."""
    total = np.bincount(piece, weights=areas)
    small = (total > 0) & (total < CRUMB_SHARE * total.max())
    return small[piece], int(small.sum())


def inward_faces(vertices, faces, *, seed=0):
    """(m,) bool: faces to turn so that all look outward.

    Within each edge-connected patch the winding is first made consistent. A patch then looks to the side from which
    more rays escape to the sky; that holds for open masks as for closed heads. Where hardly any escape (teeth inside
    a closed head) a closed patch goes by its signed volume.
    """
    consistent, patch = igl.bfs_orient(np.ascontiguousarray(faces))
    consistent = np.asarray(consistent)
    # bfs_orient may start a patch from any face: compare cyclic order to know what it turned.
    turned = ~_same_cycle(consistent, faces)
    votes, cast = _sky_votes(vertices, consistent, patch, seed)
    volumes = _signed_volumes(vertices, consistent, patch)
    decisive = np.abs(votes) > 0.02 * cast
    inward = np.where(decisive, votes < 0, volumes < 0)
    return turned ^ inward[patch]


def _same_cycle(a, b):
    """(m,) bool: rows of a and b name the same corners in the same cyclic order."""
    return (a == b).all(1) | (a[:, [1, 2, 0]] == b).all(1) | (a[:, [2, 0, 1]] == b).all(1)


def _sky_votes(vertices, faces, patch, seed):
    """Per patch: rays that escape from the front minus those from the back, and how many were cast a side."""
    rng = np.random.default_rng(seed)
    n_patches = int(patch.max()) + 1
    areas, normals = face_areas(vertices, faces), face_normals(vertices, faces)
    order = np.argsort(patch, kind="stable")
    bounds = np.searchsorted(patch[order], np.arange(n_patches + 1))
    chosen = []
    for start, stop in itertools.pairwise(bounds):
        members = order[start:stop]
        total = np.cumsum(areas[members])
        count = min(RAYS_PER_PATCH, 64 * len(members))
        at = np.searchsorted(total, rng.uniform(0, total[-1], count))
        chosen.append(members[np.minimum(at, len(members) - 1)])
    face = np.concatenate(chosen)
    sides = rng.normal(size=(len(face), 3))
    directions = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    cosine = np.einsum("kd,kd->k", directions, normals[face])
    directions *= np.where(cosine < 0, -1.0, 1.0)[:, None]
    # Embree works in float32: about the origin, in units where the mesh is a head of 300.
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    scaled = (vertices - (low + high) / 2) * (300.0 / np.linalg.norm(high - low))
    scene = RayScene(scaled, faces)
    centers = scaled[faces[face]].mean(axis=1)
    votes = np.zeros(n_patches)
    for side in (1.0, -1.0):
        away = directions * side
        # Start off the surface by more than float32 noise, along the normal so that grazing rays clear it too.
        free = ~scene.occluded(centers + normals[face] * side * 1e-3, away)
        votes += side * np.bincount(patch[face], weights=free, minlength=n_patches)
    return votes, np.bincount(patch[face], minlength=n_patches)


def _signed_volumes(vertices, faces, patch):
    """(patches,) volume about the mesh's centre."""
    a, b, c = (vertices - vertices.mean(axis=0))[faces].transpose(1, 0, 2)
    return np.bincount(patch, weights=np.einsum("md,md->m", a, np.cross(b, c)))


def keep_faces(scan, mask):
    """The scan with some faces only, without the points that no face uses any more."""
    if mask.all():
        return drop_unused_points(scan)
    pick = {name: getattr(scan, name) for name in ("uv_faces", "face_texture")}
    pick = {name: None if value is None else value[mask] for name, value in pick.items()}
    return drop_unused_points(replace(scan, faces=scan.faces[mask], **pick))


def drop_unused_points(scan):
    """The scan without points that no face uses."""
    used = np.zeros(len(scan.vertices), bool)
    used[scan.faces.ravel()] = True
    if used.all():
        return scan
    place = np.cumsum(used) - 1
    colors = None if scan.colors is None else scan.colors[used]
    return replace(scan, vertices=scan.vertices[used], faces=place[scan.faces], colors=colors)


def turn_faces(scan, mask):
    """The scan with some faces (m,) bool wound the other way."""

    def turned(corners):
        return None if corners is None else np.where(mask[:, None], corners[:, ::-1], corners)

    if not mask.any():
        return scan
    return replace(scan, faces=turned(scan.faces), uv_faces=turned(scan.uv_faces))


def far_components(scan, points, *, reach):
    """(m,) bool: faces of components that keep further than reach from all of points (k, 3): shirts, stands."""
    component = face_components(scan.faces, len(scan.vertices))
    if (component == component[0]).all():
        return np.zeros(len(scan.faces), bool)
    distance = cKDTree(points).query(scan.vertices)[0][scan.faces].min(axis=1)
    nearest = np.full(int(component.max()) + 1, np.inf)
    np.minimum.at(nearest, component, distance)
    return nearest[component] > reach
