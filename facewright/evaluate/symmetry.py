"""How far a head is from its own mirror image."""

from __future__ import annotations

import numpy as np

MIRROR_X = np.array([-1.0, 1.0, 1.0])


def rigid_alignment(source, target):
    """R (3, 3), t (3,) that bring points source (k, 3) nearest to target in the least squares sense (Kabsch 1976)."""
    middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
    U, _, Vt = np.linalg.svd((source - middle_source).T @ (target - middle_target))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U @ flip @ Vt).T
    return R, middle_target - R @ middle_source


def mirror_distances(vertices, mirror, mask):
    """(n,) distance of each vertex from its twin's mirror image, after the rigid motion that fits mask (n,) best.

    vertices (n, 3) mm; mirror (n,) index of the twin across the middle. Zero for a symmetric head in any pose.
    """
    reflected = (vertices * MIRROR_X)[mirror]
    R, t = rigid_alignment(reflected[mask], vertices[mask])
    return np.linalg.norm(vertices - (reflected @ R.T + t), axis=1)


def measure_symmetry(vertices, mirror, regions, names=("face", "lips", "eyes")):
    """dict region -> {"mean", "max"} mm of half the mirror distance: how far each side is from the symmetric head."""
    half = mirror_distances(vertices, mirror, regions["face"]) / 2
    return {
        name: {"mean": float(half[regions[name]].mean()), "max": float(half[regions[name]].max())}
        for name in names
        if name in regions and regions[name].any()
    }
