"""Smooth masks that sum to one: Poisson-disk samples on the mesh and one biharmonic function around each, in UV."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from facewright.errors import InputError
from facewright.mesh.laplacian import uniform_laplacian
from facewright.mesh.raster import RayScene
from facewright.solve.quadratic import Factorization


def cast_uv(uv, uv_faces, height, width, rows=256):
    """Face (h, w) and barycentric (h, w, 3) of the triangle over the centre of each texel; -1 where there is none."""
    scene = RayScene(np.column_stack([uv * 1000.0, np.zeros(len(uv))]), uv_faces)
    faces, shares = np.empty((height, width), np.int64), np.empty((height, width, 3), np.float32)
    u = (np.arange(width) + 0.5) / width * 1000.0
    for top in range(0, height, rows):
        v = 1000.0 - (np.arange(top, min(top + rows, height)) + 0.5) / height * 1000.0
        grid_u, grid_v = np.meshgrid(u, v)
        origins = np.stack([grid_u.ravel(), grid_v.ravel(), np.full(grid_u.size, 10.0)], axis=1)
        hits = scene.cast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
        faces[top : top + len(v)] = hits.face.reshape(len(v), width)
        shares[top : top + len(v)] = hits.barycentric.reshape(len(v), width, 3)
    return faces, shares


def covered_texels(uv, uv_faces, height, width):
    """(h, w) bool: a triangle lies over the texel's centre."""
    return cast_uv(uv, uv_faces, height, width)[0] >= 0


def poisson_disk(points, radius, rng):
    """Indices of points (n, 3) taken in random order, none within radius of one taken before (dart throwing)."""
    taken = []
    free = np.ones(len(points), bool)
    for index in rng.permutation(len(points)):
        if free[index]:
            taken.append(index)
            free &= ((points - points[index]) ** 2).sum(axis=1) >= radius * radius
    return np.array(taken)


def sample_count(points, count, rng):
    """count indices of points, spread evenly, and the radius that gives them (in the points' own unit)."""
    count = min(count, len(points))
    low, high = 0.0, float(np.linalg.norm(np.ptp(points, axis=0))) + 1e-9
    seed = int(rng.integers(1 << 31))
    best = np.arange(len(points)), 0.0
    for _ in range(24):
        radius = 0.5 * (low + high)
        taken = poisson_disk(points, radius, np.random.default_rng(seed))
        if len(taken) >= count:
            best, low = (taken, radius), radius
        else:
            high = radius
        if len(taken) == count:
            break
    return best[0][:count], best[1]


def biharmonic_masks(faces, n, samples):
    """(n, k): column k is 1 at sample k, 0 at the others, and minimises |L phi|^2 (combinatorial Laplacian)."""
    L = uniform_laplacian(faces, n)
    Q = (L @ L).tocsr()
    phi = np.zeros((n, len(samples)))
    phi[samples, np.arange(len(samples))] = 1.0
    free = np.setdiff1d(np.arange(n), samples)
    if len(free):
        inner = Q[free][:, free]
        inner.setdiag(inner.diagonal() + 1e-9)  # pieces of the mesh that hold no sample
        phi[free] = Factorization(inner).solve(-(Q[free][:, samples].toarray()))
    return phi


def build_masks(mesh, grid, count, *, seed=0, region=None):
    """Masks on the cells of a grid (rows, columns, k) float32, >= 0, sum 1; and what was done, as a dict.

    mesh    vertices (n, 3), faces, uv, uv_faces
    region  (h, w) bool in UV, or None for the whole mesh: where samples may lie
    """
    faces, uv_faces = mesh.faces, mesh.uv_faces
    if region is not None:
        centre = mesh.uv[uv_faces].mean(axis=1)
        x = np.clip((centre[:, 0] * region.shape[1]).astype(int), 0, region.shape[1] - 1)
        y = np.clip(((1 - centre[:, 1]) * region.shape[0]).astype(int), 0, region.shape[0] - 1)
        inside = region[y, x]
        if not inside.any():
            raise InputError("compress: the --region holds no face of the mesh; paint white where the masks shall lie")
        faces, uv_faces = faces[inside], uv_faces[inside]
    used, local = np.unique(faces, return_inverse=True)
    local = local.reshape(faces.shape)
    points = mesh.vertices[used]
    samples, radius = sample_count(points, count, np.random.default_rng(seed))
    phi = biharmonic_masks(local, len(used), samples)
    rows, columns = grid.cells
    hit, share = cast_uv(mesh.uv, uv_faces, rows, columns)
    values = np.einsum("kc,kcm->km", share[hit >= 0], phi[local[hit[hit >= 0]]])
    lowest = float(values.min(initial=0.0))
    cells = np.zeros((rows, columns, len(samples)), np.float32)
    values = np.clip(values, 0, 1)
    cells[hit >= 0] = values / np.maximum(values.sum(axis=1, keepdims=True), 1e-9)
    if (hit >= 0).any():
        near = distance_transform_edt(hit < 0, return_distances=False, return_indices=True)
        cells = cells[near[0], near[1]]
    else:
        cells[:] = 1.0 / len(samples)
    return cells, {"masks": len(samples), "radius_mm": radius, "lowest_before_clip": lowest}
