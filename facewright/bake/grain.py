"""Grain for skin that no scan shows, as strong and of the same hue as that of the skin it shows.

Noise in space and not in the map: it knows no charts and no stretch. Its form is general (two octaves about the size of
pores and of the fields between them); only its strength is the person's, so a blurred scan gets none.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

VOXELS = 64  # a side; the noise repeats after that
OCTAVES_MM = (0.4, 1.1)  # a voxel
SMOOTH = 0.8  # voxels: so that neither the grid nor single voxels are seen
MOST = 8.0  # sRGB; more is a beard or the noise of a camera


def grain_strength(details):
    """(3,) robust standard deviation of details (k, 3), sRGB, with its sign dropped; 0 without any."""
    if not len(details):
        return np.zeros(3)
    return np.minimum(1.4826 * np.median(np.abs(details - np.median(details, axis=0)), axis=0), MOST)


def grain(points):
    """(k,) float32 noise of standard deviation about 1 at points (k, 3) in mm; the same points give the same noise."""
    noise = np.zeros(len(points), np.float32)
    for octave, voxel_mm in enumerate(OCTAVES_MM):
        places = np.roll(points, octave, axis=1).T.astype(np.float32) / np.float32(voxel_mm)
        noise += map_coordinates(_volume(octave), places, order=1, mode="grid-wrap", prefilter=False)
    return noise / np.float32(np.sqrt(len(OCTAVES_MM)))


@lru_cache(maxsize=len(OCTAVES_MM))
def _volume(seed):
    """(VOXELS, VOXELS, VOXELS) float32 noise of standard deviation 1 that goes on at its ends."""
    white = np.random.default_rng(seed).standard_normal((VOXELS,) * 3)
    smooth = gaussian_filter(white, SMOOTH, mode="wrap")
    return (smooth / smooth.std()).astype(np.float32)
