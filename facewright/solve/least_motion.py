"""The least motion that meets linear inequalities."""

from __future__ import annotations

import numpy as np

_STEPS = 120
_LEAST_EASE = 1e-3  # taken of a wish that hardly anything can meet, or it would pull without end


def least_motion(A, over, ease, slack=0.0):
    """(k,) motion u, least in the sum of u^2 / ease, with over + A u <= 0: its dual by projected, accelerated steps.

    A  (m, k) csr, over (m,), ease (k,) how readily each part of the motion gives way; slack: what is left of a wish,
    squared, weighs one over this in the sum, so that wishes that cannot all be met are met in part; 0: no end
    """
    B, T, pull = abs(A), A.T.tocsr(), np.zeros(len(over))
    step = 1.0 / np.maximum(B @ (ease * (B.T @ np.ones(len(over)))) + slack, _LEAST_EASE)
    ahead, pace = pull, 1.0
    for _ in range(_STEPS):
        before, pull = pull, np.maximum(ahead + step * (over - A @ (ease * (T @ ahead)) - slack * ahead), 0.0)
        faster = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * pace**2))
        ahead, pace = pull + (pace - 1.0) / faster * (pull - before), faster
    return -ease * (T @ pull)
