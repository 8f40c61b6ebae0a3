"""Lines of points."""

import numpy as np


def arc_lengths(points):
    """(k,) how far points (k, d) lie from the first one, along the line through them."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
