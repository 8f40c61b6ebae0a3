"""Joints and smooth skin weights."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.data import Skeleton
from facewright.mesh.laplacian import lumped_mass
from facewright.solve.quadratic import Factorization
from hm08.regions import geodesic

NAMES = ("neck", "head", "jaw", "eye_left", "eye_right")
PARENTS = (-1, 0, 1, 1, 1)
SMOOTH_MM = 6.0


def build_skeleton(control, hinge, eye_center):
    """hinge (3,) is a point of the jaw's axis, on the midline."""
    positions = [control.joints["neck"], control.joints["head"], hinge, eye_center, eye_center * [-1, 1, 1]]
    positions = np.array(positions)
    positions[:3, 0] = 0.0
    return Skeleton(NAMES, PARENTS, positions)


def hinge_of(R, t):
    """(3,) the point on the midline plane that a rotation about an axis along x leaves in place."""
    A = np.eye(3) - R
    y_z = np.linalg.lstsq(A[1:, 1:], t[1:], rcond=None)[0]
    return np.array([0.0, *y_z])


def skin_weights(head, regions, jaw_open, R, t):
    """(n, 5) weights of the skin: the jaw by how far each vertex goes with the hinge in jawOpen, the neck by height."""
    V = head.V
    rigid = V @ R.T + t - V
    jaw = (jaw_open * rigid).sum(axis=1) / np.maximum((rigid**2).sum(axis=1), 4.0)
    jaw = np.clip(jaw, 0.0, 1.0) * (regions["outer"] | regions["mouth_interior"])
    y = V[:, 1] + 0.35 * (V[:, 2] + 40)
    bottom, top = y[regions["neck"]].min(), np.quantile(y[regions["neck"]], 0.97)
    s = np.clip((top - y) / (0.75 * (top - bottom)), 0.0, 1.0)
    neck = (s * s * (3 - 2 * s)) * _grown(regions["neck"], head)
    mass = sp.diags(lumped_mass(V, head.F))
    system = Factorization((mass + SMOOTH_MM**4 / 16 * head.K).tocsr())
    jaw, neck = np.clip(system.solve(mass @ np.stack([jaw, neck], axis=1)), 0.0, 1.0).T
    jaw = np.where(jaw < 1e-3, 0.0, jaw) * (1 - neck)
    neck = np.where(neck < 1e-3, 0.0, neck)
    weights = np.zeros((len(V), len(NAMES)))
    weights[:, 0], weights[:, 2] = neck, jaw
    weights[:, 1] = 1.0 - neck - jaw
    return 0.5 * (weights + weights[head.mirror][:, [0, 1, 2, 4, 3]])


def _grown(mask, head):
    distance = geodesic(head.V, head.F, np.flatnonzero(mask))
    return np.clip(1.0 - distance / 20.0, 0.0, 1.0)
