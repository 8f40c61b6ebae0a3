"""The texels of a map that a mesh covers in UV space, and values carried between vertices and texels."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from facewright.mesh.normals import face_areas
from facewright.mesh.raster import RayScene

CHUNK = 1 << 17
"""Texels that are worked on at once: some 30 MB of intermediate arrays per thread."""


@dataclass(frozen=True)
class Texels:
    """Covered texels of a (size, size) map, row by row from the top (v = 1).

    index        (k,) int32, row * size + column
    face         (k,) int32, the face that covers the texel's centre
    barycentric  (k, 3) float32 in that face
    """

    size: int
    index: np.ndarray
    face: np.ndarray
    barycentric: np.ndarray

    def __len__(self):
        return len(self.index)

    def chosen(self, which):
        """The Texels at which, (j,) indices."""
        return Texels(self.size, self.index[which], self.face[which], self.barycentric[which])


def in_chunks(work, n, jobs=1, chunk=CHUNK):
    """work(slice) over 0..n in pieces, in order; jobs is the number of threads. Returns the list of results."""
    slices = [slice(start, min(start + chunk, n)) for start in range(0, n, chunk)]
    if jobs <= 1:
        return [work(piece) for piece in slices]
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(work, slices))


def build_texels(uv, uv_faces, size, jobs=1):
    """Texels of a mesh with uv (t, 2), v up, and uv_faces (m, 3) in a (size, size) map."""
    scene = RayScene(np.column_stack([uv * 1000.0, np.zeros(len(uv))]), uv_faces)
    center = ((np.arange(size) + 0.5) / size * 1000.0).astype(np.float32)

    def raster(piece):
        row, column = np.divmod(np.arange(piece.start, piece.stop, dtype=np.int32), np.int32(size))
        origins = np.stack([center[column], 1000.0 - center[row], np.full(len(row), 10.0, np.float32)], axis=1)
        hits = scene.cast(origins, np.broadcast_to(np.float32([0, 0, -1]), origins.shape))
        covered = np.flatnonzero(hits.face >= 0)
        index = (covered + piece.start).astype(np.int32)
        return index, hits.face[covered].astype(np.int32), hits.barycentric[covered].astype(np.float32)

    parts = in_chunks(raster, size * size, jobs)
    return Texels(size, *(np.concatenate(column) for column in zip(*parts)))


def at_points(values, F, face, barycentric):
    """Values (n, ...) at points given by (k,) faces and (k, 3) barycentric coordinates, in float32: (k, ...)."""
    values = np.asarray(values, np.float32)
    corners = F[face]  # (k, 3)
    weights = barycentric.reshape(len(face), 3, *(1,) * (values.ndim - 1))
    result = values[corners[:, 0]] * weights[:, 0]
    result += values[corners[:, 1]] * weights[:, 1]
    result += values[corners[:, 2]] * weights[:, 2]
    return result


def at_corners(values, face, barycentric):
    """As at_points for values (m, 3, ...) that are kept per face corner."""
    values = np.asarray(values, np.float32)
    weights = barycentric.reshape(len(face), 3, *(1,) * (values.ndim - 2))
    result = values[face, 0] * weights[:, 0]
    result += values[face, 1] * weights[:, 1]
    result += values[face, 2] * weights[:, 2]
    return result


def dots(a, b):
    """(k,) dot products of rows (k, 3); einsum is four times faster here than sum(axis=1)."""
    return np.einsum("ij,ij->i", a, b)


def unit_rows(vectors):
    """Rows (k, c) scaled to unit length, in their own precision; a zero row stays zero."""
    length = np.sqrt(dots(vectors, vectors))
    return vectors / np.maximum(length, np.float32(1e-20))[:, None]


def gather_at_vertices(values, seen, counted, texels, F, n, jobs=1):
    """Means at vertices of what the texels around them hold: (n, c) means and (n,) share of texels seen.

    values (k, c), seen (k,) bool, counted (k,) bool the texels that could be seen. A texel counts for a corner of its
    face by its barycentric coordinate; the share of a vertex without such texels (smaller than one) is NaN.
    """

    def collect(piece):
        corners = F[texels.face[piece]].ravel()
        weights = texels.barycentric[piece].ravel().astype(np.float64)
        total = np.bincount(corners, weights=weights * np.repeat(counted[piece], 3), minlength=n)
        weights *= np.repeat(seen[piece], 3)
        sums = [np.bincount(corners, weights=weights, minlength=n)]
        for channel in range(values.shape[1]):
            held = np.repeat(values[piece, channel], 3)
            sums.append(np.bincount(corners, weights=weights * held, minlength=n))
        return total, np.stack(sums, axis=1)

    totals, sums = np.zeros(n), np.zeros((n, 1 + values.shape[1]))
    for total, part in in_chunks(collect, len(texels), jobs):
        totals += total
        sums += part
    means = sums[:, 1:] / np.maximum(sums[:, :1], 1e-9)
    share = np.divide(sums[:, 0], totals, out=np.full(n, np.nan), where=totals > 1e-9)
    return means, share


def texel_densities(V, F, UV, FT, size):
    """(m,) texels per mm of each face: the square root of its area in the map over its area on the surface."""
    in_map = face_areas(np.column_stack([UV, np.zeros(len(UV))]), FT) * size * size
    return np.sqrt(in_map / np.maximum(face_areas(V, F), 1e-9))
