"""Grain for skin that no scan shows, as strong and of the same hue as that of the skin it shows.

Noise in space and not in the map: it knows no charts and no stretch. Its form is general (two octaves about the size of
pores and of the fields between them); only its strength is the person's, so a blurred scan gets none.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

VOXELS, VOXEL_MM = 96, 0.45  # a side; the noise repeats after that
SMOOTH = (0.8, 2.2)  # voxels, of each octave: neither the grid nor single voxels are seen
MOST = 8.0  # sRGB; more is a beard or the noise of a camera


def grain_strength(details):
    """(3,) robust standard deviation of details (k, 3), sRGB, with its sign dropped; 0 without any."""
    if not len(details):
        return np.zeros(3)
    return np.minimum(1.4826 * np.median(np.abs(details - np.median(details, axis=0)), axis=0), MOST)


def grain(points):
    """(k,) float32 noise of standard deviation about 1 at points (k, 3) in mm; the same points give the same noise."""
    places = points.T.astype(np.float32) / np.float32(VOXEL_MM)
    return map_coordinates(_volume(), places, order=1, mode="grid-wrap", prefilter=False)


@lru_cache(maxsize=1)
def _volume():
    """(VOXELS, VOXELS, VOXELS) float32 noise of standard deviation 1 that goes on at its ends."""
    random, total = np.random.default_rng(0), np.zeros((VOXELS,) * 3, np.float32)
    for sigma in SMOOTH:
        octave = gaussian_filter(random.standard_normal(total.shape, np.float32), sigma, mode="wrap")
        total += octave / octave.std()
    return total / total.std()
