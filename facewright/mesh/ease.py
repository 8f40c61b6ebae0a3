"""Motion made smooth in space around a place: what lies before something at rest then stays before it."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

_REACH = 2.0  # widths from the place at which all is as it was
_KERNEL = 3.0  # widths at which what moves counts for nothing


def eased(rest, mass, motion, place, width, among=None):
    """(n, 3) by which the motion (n, 3) of points (n, 3) at rest differs from its own mean within a width, in mm.

    Whole at the place, a mask (n,) of points, and fading out within two widths of it. Points count by mass (n,), those
    of a mask (n,) among alone; the mean is Gaussian: space is moved smoothly, and nothing passes through anything.
    """
    result = np.zeros_like(motion)
    if not place.any():
        return result
    away = cKDTree(rest[place]).query(rest, distance_upper_bound=_REACH * width)[0] / (_REACH * width)
    near = away < 1.0
    if among is not None:
        near &= among
    near = np.flatnonzero(near)
    around = np.flatnonzero(among) if among is not None else np.arange(len(rest))
    away_from = cKDTree(rest[near]).sparse_distance_matrix(
        cKDTree(rest[around]), _KERNEL * width, output_type="coo_matrix"
    )
    shares = np.exp(-0.5 * (away_from.data / width) ** 2) * mass[around][away_from.col]
    kernel = sp.csr_matrix((shares, (away_from.row, away_from.col)), away_from.shape)
    mean = (kernel @ motion[around]) / np.maximum(np.asarray(kernel.sum(axis=1)), 1e-12)
    result[near] = ((1.0 - away[near] ** 2) ** 2)[:, None] * (mean - motion[near])
    return result
