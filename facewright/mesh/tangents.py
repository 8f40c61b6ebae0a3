"""Tangent frames for normal maps, by the rule of MikkTSpace.

glTF viewers derive the tangents of a mesh that carries none by MikkTSpace (Mikkelsen 2008) from positions, smooth
normals and UVs; Blender, Unity and Unreal use the same rule. A baker that uses it too is undone exactly by them.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import normalized


def corner_tangents(V, F, N, UV, FT):
    """Tangents (m, 3, 3) per face corner, unit and perpendicular to the corner's normal, and signs (m,) of faces.

    V (n, 3), F (m, 3), N (n, 3) unit vertex normals, UV (t, 2) with v up, FT (m, 3) into UV
    The bitangent is sign * cross(N, T) and points to growing v (up in the picture). A corner's tangent is the mean of
    dP/du of the faces that share its vertex, its UV and its orientation in UV space, each flattened onto the vertex's
    tangent plane and weighted by its angle there. Faces without area in UV space take part with nothing.
    """
    P, T = V[F], UV[FT]  # (m, 3, 3), (m, 3, 2)
    d1, d2 = P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]
    t1, t2 = T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]
    area = t1[:, 0] * t2[:, 1] - t1[:, 1] * t2[:, 0]
    sign = np.where(area >= 0, 1.0, -1.0)
    along_u = normalized((t2[:, 1:] * d1 - t1[:, 1:] * d2) * sign[:, None])
    along_u[area == 0] = 0.0

    normals = N[F]
    flat = normalized(_flatten(along_u[:, None, :], normals))
    following = normalized(_flatten(np.roll(P, -1, axis=1) - P, normals))
    preceding = normalized(_flatten(np.roll(P, 1, axis=1) - P, normals))
    angle = np.arccos(np.clip((following * preceding).sum(-1), -1.0, 1.0))  # (m, 3)

    key = (F * len(UV) + FT) * 2 + (sign < 0)[:, None]
    _, group = np.unique(key.ravel(), return_inverse=True)
    weighted = (flat * angle[..., None]).reshape(-1, 3)
    sums = np.stack([np.bincount(group, weights=weighted[:, axis]) for axis in range(3)], axis=1)
    tangents = normalized(sums)[group].reshape(P.shape)
    missing = (tangents == 0).all(-1)
    tangents[missing] = _any_tangent(normals[missing])
    return tangents, sign


def _flatten(vectors, normals):
    """The part of vectors that is perpendicular to unit normals."""
    return vectors - normals * (vectors * normals).sum(-1, keepdims=True)


def _any_tangent(normals):
    """A unit vector perpendicular to each normal (k, 3): +X where it can, else +Z."""
    axis = np.where((np.abs(normals[:, :1]) < 0.9), [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    return normalized(_flatten(axis, normals))


def to_tangent_space(directions, normals, tangents, sign):
    """Coefficients (k, 3) of directions (k, 3) in the frame T, B, N: what a normal map stores, not normalised.

    normals, tangents (k, 3) unit, sign (k,); T and N need not be perpendicular (interpolation bends them); the
    viewer's bitangent is sign * cross(N, T), normalised.
    """
    cross = np.cross(normals, tangents)
    cross *= (sign / np.maximum(np.sqrt(_dots(cross, cross)), 1e-12))[:, None]
    skew = np.clip(_dots(tangents, normals), -0.99, 0.99)
    on_t, on_n = _dots(directions, tangents), _dots(directions, normals)
    scale = 1.0 / (1.0 - skew * skew)
    x, z = (on_t - skew * on_n) * scale, (on_n - skew * on_t) * scale
    return np.stack([x, _dots(directions, cross), z], axis=1)


def from_tangent_space(coefficients, normals, tangents, sign):
    """Unit directions (k, 3) of normal-map coefficients (k, 3): the inverse of to_tangent_space."""
    bitangents = normalized(np.cross(normals, tangents)) * sign[:, None]
    x, y, z = coefficients[:, :1], coefficients[:, 1:2], coefficients[:, 2:]
    return normalized(x * tangents + y * bitangents + z * normals)


def _dots(a, b):
    return np.einsum("ij,ij->i", a, b)
