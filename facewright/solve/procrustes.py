"""Best rotation, similarity and affine map between paired points."""

from __future__ import annotations

import numpy as np


def best_rotation(source, target, weights=None):
    """(3, 3) proper rotation R with target ~ R source after both are centred (Kabsch 1976).

    source, target (n, 3); weights (n,) or None; a reflection is never returned
    """
    return _procrustes(source, target, weights)[0]


def best_similarity(source, target, weights=None, scale_limits=(0.0, np.inf)):
    """R (3, 3), scale, t (3,) with the least weighted sum of |scale R source_i + t - target_i|^2 (Umeyama 1991).

    scale_limits bounds the scale; R and t are the best for the bounded one
    """
    R, scale, a, b = _procrustes(source, target, weights)
    scale = float(np.clip(scale, *scale_limits))
    return R, scale, b - scale * R @ a


def best_affine(source, target, weights, like, hold):
    """A (3, 3), t (3,) with the least weighted sum of |A source_i + t - target_i|^2, held to a matrix like (3, 3).

    weights (n,); hold is the weight of |A - like|^2 as a share of the source's mean spread along an axis
    """
    weights = weights / weights.sum()
    mean_source, mean_target = weights @ source, weights @ target
    a, b = source - mean_source, target - mean_target
    spread = (a * weights[:, None]).T @ a
    held = hold * np.trace(spread) / 3 * np.eye(3)
    A = np.linalg.solve(spread + held, ((b * weights[:, None]).T @ a + like @ held).T).T
    return A, mean_target - A @ mean_source


def _procrustes(source, target, weights):
    """Rotation, unbounded scale and the two weighted means."""
    weights = np.ones(len(source)) if weights is None else np.asarray(weights, float)
    weights = weights / weights.sum()
    mean_source, mean_target = weights @ source, weights @ target
    a, b = source - mean_source, target - mean_target
    U, S, Vt = np.linalg.svd((b * weights[:, None]).T @ a)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    spread = (weights[:, None] * a * a).sum()
    return (U * signs) @ Vt, (S * signs).sum() / max(spread, 1e-300), mean_source, mean_target
