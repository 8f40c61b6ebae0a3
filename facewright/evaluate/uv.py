"""How good an atlas is: texels for the face, density, stretch, flips, overlaps, seams."""

from __future__ import annotations

import numpy as np

from facewright.mesh.adjacency import face_components, half_edges
from facewright.mesh.normals import face_areas
from facewright.mesh.raster import RayScene

ATLAS_PIXELS = 4096
"""The map size that densities are quoted for."""


def measure_uv(template, *, region="face", overlap_pixels=2048):
    """Figures of a template's skin UVs; "front" is the skin of a region.

    returns dict:
        front_share          share of the square's texels that the front has
        front_px_per_mm_*    median, p5, p95 over the front's area, at 4096 x 4096
        front_anisotropy_*   median and p95 of the ratio of the two stretches
        front_scale_min/max  smallest and largest area scale of a front triangle, over the median
        front_pieces         islands that the front falls into
        front_seam_edges     edges inside the front where the UVs part
        flipped              skin triangles with no or negative UV area
        overlap_texels       texels, of overlap_pixels squared, that two skin triangles cover
        used_share           share of the square that the skin covers
    """
    faces = template.faces[template.skin.face_slice]
    uv_faces = template.uv_faces[template.skin.face_slice]
    V, uv = template.vertices, template.uv
    front = template.regions[region][faces].all(axis=1)
    area = face_areas(V, faces)
    signed = signed_uv_areas(uv, uv_faces)
    density = ATLAS_PIXELS * np.sqrt(np.abs(signed) / np.maximum(area, 1e-12))
    stretch = stretches(V, faces[front], uv, uv_faces[front])
    anisotropy = stretch[:, 0] / np.maximum(stretch[:, 1], 1e-12)
    scale = signed[front] / np.maximum(area[front], 1e-12)
    scale = scale / weighted_quantile(scale, area[front], 0.5)
    quantile = lambda values, q: float(weighted_quantile(values, area[front], q))  # noqa: E731
    return {
        "front_share": float(signed[front].sum()),
        "front_px_per_mm_median": quantile(density[front], 0.5),
        "front_px_per_mm_p5": quantile(density[front], 0.05),
        "front_px_per_mm_p95": quantile(density[front], 0.95),
        "front_anisotropy_median": quantile(anisotropy, 0.5),
        "front_anisotropy_p95": quantile(anisotropy, 0.95),
        "front_scale_min": float(scale.min()),
        "front_scale_max": float(scale.max()),
        "front_pieces": len(np.unique(face_components(uv_faces, len(uv))[front])),
        "front_seam_edges": seam_edges(faces[front], uv_faces[front]),
        "flipped": int((signed <= 0).sum()),
        "overlap_texels": overlap_texels(uv, uv_faces, overlap_pixels),
        "used_share": float(np.abs(signed).sum()),
    }


def signed_uv_areas(uv, uv_faces):
    """(m,) areas in the unit square, negative where a triangle is flipped."""
    a, b, c = uv[uv_faces[:, 0]], uv[uv_faces[:, 1]], uv[uv_faces[:, 2]]
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def stretches(V, F, uv, uv_faces):
    """(m, 2) largest and smallest stretch from surface to UV of each triangle, UV units per mm."""
    edge1, edge2 = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    length = np.linalg.norm(edge1, axis=1)
    x2 = (edge1 * edge2).sum(axis=1) / length
    y2 = np.sqrt(np.maximum((edge2**2).sum(axis=1) - x2**2, 1e-18))
    q1, q2 = uv[uv_faces[:, 1]] - uv[uv_faces[:, 0]], uv[uv_faces[:, 2]] - uv[uv_faces[:, 0]]
    first = q1 / length[:, None]
    second = (q2 - first * x2[:, None]) / y2[:, None]
    J = np.stack([first, second], axis=2)  # (m, 2, 2)
    return np.linalg.svd(J, compute_uv=False)


def weighted_quantile(values, weights, q):
    """The value below which a share q of the weight lies."""
    order = np.argsort(values, kind="stable")
    cumulative = np.cumsum(weights[order]) - 0.5 * weights[order]
    return np.interp(q * weights.sum(), cumulative, values[order])


def seam_edges(F, uv_faces):
    """Number of edges between two of the triangles F (m, 3) whose UV corners differ."""
    n, t = int(F.max()) + 1, int(uv_faces.max()) + 1
    mesh, atlas = half_edges(F), half_edges(uv_faces)
    key = mesh[:, 0] * n + mesh[:, 1]
    twin = mesh[:, 1] * n + mesh[:, 0]
    order = np.argsort(key)
    at = np.minimum(np.searchsorted(key[order], twin), len(key) - 1)
    found = key[order[at]] == twin
    other = atlas[order[at]]
    same = atlas[:, 0] * t + atlas[:, 1] == other[:, 1] * t + other[:, 0]
    return int((found & ~same).sum() // 2)


def overlap_texels(uv, uv_faces, size):
    """Texels of a (size, size) map whose centre lies inside two triangles.

    Triangles are stacked at heights of their own; rays from above and from below must meet the same one.
    """
    m = len(uv_faces)
    corners = np.column_stack([uv[uv_faces.ravel()] * 1000.0, np.repeat(np.arange(m) * (100.0 / m), 3)])
    scene = RayScene(corners, np.arange(3 * m).reshape(m, 3))
    center = (np.arange(size) + 0.5) / size * 1000.0
    count = 0
    for v in np.array_split(center, max(1, size // 256)):
        grid_u, grid_v = np.meshgrid(center, v)
        plane = np.stack([grid_u.ravel(), grid_v.ravel()], axis=1)
        faces = []
        inside = np.ones(len(plane), bool)
        for height, down in ((300.0, -1.0), (-200.0, 1.0)):
            origins = np.column_stack([plane, np.full(len(plane), height)])
            hits = scene.cast(origins, np.broadcast_to([0.0, 0.0, down], origins.shape))
            faces.append(hits.face)
            # On a shared edge both neighbours are hit; that is no overlap.
            inside &= hits.barycentric.min(axis=1) > 1e-3
        count += int((inside & (faces[0] != faces[1])).sum())
    return count
