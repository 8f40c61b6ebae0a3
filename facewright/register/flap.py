"""What stands out of the side of a head as an ear does, on a model and on any scan.

Hair and cloth lie farther out than a model's skin as well, but over more than an ear's width: what a disk as wide as
that can be slid over from outside is no ear (grey opening; Meyer's top hat: Serra, Image analysis and mathematical
morphology, 1982, chapter 12).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter, grey_opening, label, median_filter

from facewright.mesh.sampling import sample_surface

CELL_MM, DISK_MM, SMOOTH_MM = 2.0, 44.0, 4.0
SAMPLES = 24000


def standing_out(vertices, faces, center, reach_mm, least_mm):
    """(n,) mm by which vertices (n, 3) stand out of the side of a head; 0 farther than reach_mm from center (3,), and
    where they are not of the largest piece that stands out by least_mm.

    faces (m, 3); the side is that of center: the head looks along z, its left along x
    """
    side, heights = np.sign(center[0]), np.zeros(len(vertices))
    outwards = vertices * [side, 1.0, 1.0]
    wide = reach_mm + DISK_MM
    about = (np.abs(outwards[:, 1:] - center[1:]) < wide).all(axis=1) & (outwards[:, 0] > 0.0)
    samples = sample_surface(outwards, faces, SAMPLES, about[faces].all(axis=1)).points
    if not len(samples):
        return heights
    size = int(np.ceil(2.0 * wide / CELL_MM))
    low = center[1:] - 0.5 * size * CELL_MM

    def cell(points):
        return tuple(np.clip((points[:, 1:] - low) // CELL_MM, 0, size - 1).astype(int).T)

    depth = np.full((size, size), -np.inf)
    np.maximum.at(depth, cell(samples), samples[:, 0])
    nearest = distance_transform_edt(np.isinf(depth), return_distances=False, return_indices=True)
    depth = median_filter(depth[tuple(nearest)], 3)
    base = gaussian_filter(grey_opening(depth, footprint=_disk(0.5 * DISK_MM / CELL_MM)), SMOOTH_MM / CELL_MM)
    near = np.flatnonzero(about & (np.linalg.norm(vertices - center, axis=1) < reach_mm))
    inside = np.zeros((size, size), bool)
    inside[cell(outwards[near])] = True
    piece = binary_dilation(_largest(np.where(inside, depth - base - least_mm, 0.0)))
    at = cell(outwards[near])
    heights[near] = np.where(piece[at], np.maximum(outwards[near, 0] - base[at], 0.0), 0.0)
    return heights


def _disk(radius):
    y, x = np.mgrid[-int(radius) : int(radius) + 1, -int(radius) : int(radius) + 1]
    return x**2 + y**2 <= radius**2


def _largest(above):
    """(h, w) bool: of what hangs together and lies above 0, the piece of the largest volume."""
    pieces, count = label(binary_dilation(above > 0.0))
    if not count:
        return np.zeros(above.shape, bool)
    volume = np.bincount(pieces.ravel(), np.maximum(above, 0.0).ravel(), count + 1)
    volume[0] = 0.0
    return pieces == volume.argmax()
