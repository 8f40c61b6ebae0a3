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
NEAR_MM = 20.0
"""What stands out twice so far from the place in question counts for a seventh: a full cheek stands out too."""
SAMPLES = 24000


def standing_out(vertices, faces, near, center, least_mm):
    """(k,) mm by which vertices near (k,) of (n, 3) stand out of the side of a head; 0 where they are not of the
    largest piece of those, by volume and nearness to center, that stands out by least_mm.

    faces (m, 3); the side is that of center (3,), which they lie about: the head looks along z, its left along x
    """
    side, heights = np.sign(center[0]), np.zeros(len(near))
    outwards = vertices * [side, 1.0, 1.0]
    if not len(near):
        return heights
    wide = np.abs(vertices[near] - center).max() + DISK_MM
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
    at = cell(outwards[near])
    inside = np.zeros((size, size), bool)
    inside[at] = True
    inside = binary_dilation(inside, iterations=2)  # a coarse scan has not a vertex in every cell
    aside = (np.arange(size) + 0.5) * CELL_MM - 0.5 * size * CELL_MM
    closeness = np.exp(-0.5 * (aside[:, None] ** 2 + aside**2) / NEAR_MM**2)
    piece = binary_dilation(_largest(np.where(inside, depth - base - least_mm, 0.0), closeness))
    return np.where(piece[at], np.maximum(outwards[near, 0] - base[at], 0.0), 0.0)


def _disk(radius):
    y, x = np.mgrid[-int(radius) : int(radius) + 1, -int(radius) : int(radius) + 1]
    return x**2 + y**2 <= radius**2


def _largest(above, weight):
    """(h, w) bool: of what hangs together above 0, the piece of the largest volume, cells times weight (h, w)."""
    pieces, count = label(binary_dilation(above > 0.0))
    if not count:
        return np.zeros(above.shape, bool)
    volume = np.bincount(pieces.ravel(), (weight * np.maximum(above, 0.0)).ravel(), count + 1)
    volume[0] = 0.0
    return pieces == volume.argmax()
