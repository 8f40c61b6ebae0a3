"""A small skeleton for a head (neck, head, jaw, eyes) and smooth skin weights for it."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.data import Skeleton
from facewright.mesh.fade import smooth_step
from facewright.mesh.laplacian import cotangent_laplacian, lumped_mass
from facewright.solve.quadratic import Factorization

JOINTS = ("neck", "head", "jaw", "eye_left", "eye_right")
PARENTS = (-1, 0, 1, 1, 1)


def rigid_fit(points, moved):
    """R (3, 3), t (3,) with moved = R points + t in the least-squares sense (Kabsch 1976)."""
    a, b = points.mean(axis=0), moved.mean(axis=0)
    U, _, Vt = np.linalg.svd((moved - b).T @ (points - a))
    sign = np.sign(np.linalg.det(U @ Vt))
    R = U @ np.diag([1.0, 1.0, sign]) @ Vt
    return R, b - R @ a


def hinge(points, moved):
    """Point on the x axis-parallel hinge (3,), x = 0, and angle (rad) of a rotation in the sagittal plane.

    points, moved (k, 3): the lower teeth closed and open
    """
    R, _ = rigid_fit(points, moved)
    angle = np.arctan2(R[2, 1] - R[1, 2], R[1, 1] + R[2, 2])
    c, s = np.cos(angle), np.sin(angle)
    plane = np.array([[c, -s], [s, c]])
    a, b = points[:, 1:].mean(axis=0), moved[:, 1:].mean(axis=0)
    y, z = np.linalg.solve(np.eye(2) - plane, b - plane @ a)
    return np.array([0.0, y, z]), float(angle)


def rotation_about_x(points, center, angle):
    """points (k, 3) turned about the line through center parallel to x; positive angle takes +y to +z."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return (points - center) @ R.T + center


def head_skeleton(vertices, faces, shaped, jaw_open, regions, eyes):
    """Skeleton and skin weights (n, 5) of a whole head.

    vertices (n, 3) mm, faces (m, 3); shaped has parts; jaw_open (n, 3) the shape; eyes (2, 3) left, right
    The jaw's hinge is where the lower teeth turn about; the neck ends between the ears' lowest points.
    """
    teeth = shaped.part("teeth_lower").vertex_slice
    pivot, angle = hinge(vertices[teeth], (vertices + jaw_open)[teeth])
    ears = vertices[regions["ear_left"] | regions["ear_right"]]
    neck = vertices[regions["neck"]]
    top = np.array([0.0, ears[:, 1].min(), ears[:, 2].mean()])
    column = neck[np.abs(neck[:, 0]) < 0.8 * np.abs(ears[:, 0]).max()]
    bottom = np.array([0.0, column[:, 1].min(), 0.0])
    bottom[2] = column[column[:, 1] < bottom[1] + 25, 2].mean()
    root = bottom + 0.35 * (top - bottom)
    weights = np.zeros((len(vertices), len(JOINTS)))
    upright = neck_blend(vertices, root[1] - 0.2 * (top - root)[1], top[1])
    weights[:, 0], weights[:, 1] = 1 - upright, upright
    skin = shaped.parts[0].vertex_slice
    skin_faces = faces[shaped.parts[0].face_slice]
    still = np.linalg.norm(jaw_open[skin], axis=1) < 0.05
    share = jaw_weights(vertices[skin], skin_faces, jaw_open[skin], pivot, angle, still)
    weights[skin] *= (1 - share)[:, None]
    weights[skin, 2] = share
    for part in shaped.parts:
        bone = {"skull": 1, "jaw": 2, "eye_left": 3, "eye_right": 4}.get(part.attach)
        if bone is not None:
            weights[part.vertex_slice] = np.eye(len(JOINTS))[bone]
    return Skeleton(JOINTS, PARENTS, np.vstack([root, top, pivot, eyes])), weights


def jaw_weights(vertices, faces, jaw_open, hinge_point, angle, still, *, smooth_mm=6.0):
    """(n,) in 0..1: how much each skin vertex follows the jaw bone, fitted to a jawOpen shape and smoothed.

    jaw_open (n, 3) mm; still (n,) bool vertices held at 0. Minimises |W - W0|^2 + smooth^4 |L W|^2 over the skin,
    where W0 is the share of the bone's full motion found in the shape.
    """
    full = rotation_about_x(vertices, hinge_point, angle) - vertices
    share = np.einsum("nc,nc->n", jaw_open, full) / np.maximum(np.einsum("nc,nc->n", full, full), 1.0)
    share = np.where(still, 0.0, np.clip(share, 0.0, 1.0))
    L, M = cotangent_laplacian(vertices, faces), lumped_mass(vertices, faces)
    M = np.maximum(M, 1e-3)
    hold = np.where(still, 100.0, 1.0)
    A = sp.diags(M * hold) + smooth_mm**4 * (L @ sp.diags(1.0 / M) @ L)
    return np.clip(Factorization(A).solve(M * hold * share), 0.0, 1.0)


def neck_blend(vertices, bottom, top):
    """(n,) 0 below height bottom (all neck), 1 above height top (all head), smooth between."""
    return smooth_step(vertices[:, 1], bottom, top)
