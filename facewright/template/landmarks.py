"""The template's own landmarks, found on its own renders as a scan's are, so that the network's biases cancel."""

from __future__ import annotations

import numpy as np

from facewright.data import Landmarks
from facewright.mesh.closest import Surface
from facewright.scan.landmarks import IBUG68, lift_landmarks, mirrored_landmarks

SKIN_MATERIALS = ("skin",)
EYE_COLOR = (0.80, 0.78, 0.75)
IRIS_COLOR = (0.10, 0.06, 0.04)
SKIN_COLOR = (0.60, 0.40, 0.31)
LIP_COLOR = (0.50, 0.23, 0.21)
IRIS_COSINE = np.cos(np.radians(29.0))


def template_landmarks(vertices, faces, mirror, parts, *, lips=None):
    """Landmarks "mp0".."mp477" and "p1".."p68" of a template on its skin, symmetric through the mirror map.

    vertices (n, 3) mm in our frame, faces (m, 3) triangles, mirror (n,), parts tuple of Part
    lips     (n,) bool, painted red for the pictures; None paints none
    returns  Landmarks; faces belong to the skin (irises: to the eyes); weight 0 where the pictures show nothing
    """
    colors = _colors(vertices, parts, lips)
    found = lift_landmarks(vertices, faces, colors=colors, clay=True)
    points = found.positions(vertices, faces)
    weights = found.weights
    twin = mirrored_landmarks()
    points = 0.5 * (points + points[twin] * [-1, 1, 1])
    weights = np.minimum(weights, weights[twin])
    on_faces, barycentric = _project(points, vertices, faces, parts)
    names = [f"mp{i}" for i in range(len(points))] + [f"p{i + 1}" for i in range(68)]
    index = np.concatenate([np.arange(len(points)), IBUG68])
    return Landmarks(tuple(names), on_faces[index], barycentric[index], weights[index])


def _colors(vertices, parts, lips):
    """(n, 3) linear: skin, white eyes with dark irises."""
    colors = np.tile(SKIN_COLOR, (len(vertices), 1))
    if lips is not None:
        colors[lips] = LIP_COLOR
    for part in parts:
        if part.name in ("eye_left", "eye_right"):
            points = vertices[part.vertex_slice]
            center = 0.5 * (points.min(axis=0) + points.max(axis=0))
            local = points - center
            iris = local[:, 2] > IRIS_COSINE * np.linalg.norm(local, axis=1)
            colors[part.vertex_slice] = np.where(iris[:, None], IRIS_COLOR, EYE_COLOR)
    return colors


def _project(points, vertices, faces, parts):
    """Nearest place on the skin for all but the irises, on the eyes for those."""
    on_faces = np.empty(len(points), np.int64)
    barycentric = np.empty((len(points), 3))
    iris = np.arange(len(points)) >= 468
    for mask, wanted in ((~iris, ("skin",)), (iris, ("eye_left", "eye_right"))):
        ids = np.concatenate([np.arange(*part.faces) for part in parts if part.name in wanted] or [np.empty(0, int)])
        if not len(ids):
            ids = np.arange(len(faces))
        nearest = Surface(vertices, faces[ids]).closest(points[mask])
        on_faces[mask], barycentric[mask] = ids[nearest.faces], nearest.barycentric
    return on_faces, barycentric
