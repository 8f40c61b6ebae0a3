"""From 0 to 1 without an edge."""

from __future__ import annotations

import numpy as np


def smooth_step(value, low=0.0, high=1.0):
    """0 below low, 1 above high, smooth between (3 t^2 - 2 t^3); low > high turns it round."""
    t = np.clip((np.asarray(value, float) - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)
