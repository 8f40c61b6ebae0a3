"""Which point of the scan belongs to which vertex of the template, and how far to believe it."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.polynomial.chebyshev import chebinterpolate, chebval
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import border_vertices, vertex_adjacency
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import face_areas, face_normals, vertex_normals
from facewright.mesh.sampling import sample_surface
from facewright.mesh.subdivide import split_in_four, with_midpoints

PASS_MM, FACET_PASS = 7.7, 1.25
"""Waves of a surface that smoothing halves: what a scanner's noise has, and how many of its edges a coarse scan's."""
FINE_MM = 3.0
"""Longer edges are split before a surface is smoothed."""
SERIES = 11.0
"""Terms for a wave of pi edges: the series is off by 2e-3 at most then."""


@dataclass(frozen=True)
class Matches:
    """For k template points: points (k, 3) on the scan, its normals (k, 3), weights (k,) in 0..1, distance (k,) mm.

    roughness (k,) relative to the scan's skin, hair (k,) 0..1, see Target.tell_skin
    """

    points: np.ndarray
    normals: np.ndarray
    weights: np.ndarray
    distance: np.ndarray
    roughness: np.ndarray
    hair: np.ndarray


class Samples(NamedTuple):
    """Points of a scan: points (k, 3), normals (k, 3), roughness (k,), hair (k,) as in Matches."""

    points: np.ndarray
    normals: np.ndarray
    roughness: np.ndarray
    hair: np.ndarray


def roughness_deg(vertices, faces, radius_mm=9.0, count=40000, neighbours=40):
    """(n,) how far the surface's normals scatter within radius_mm: skin 4 to 12 degrees, hair and cloth 20 to 40.

    Where the mesh is flat over large faces too few samples lie near; it counts as smooth.
    """
    samples = sample_surface(vertices, faces, count)
    distance, nearest = cKDTree(samples.points).query(vertices, k=neighbours, workers=2)
    near = distance < radius_mm
    mean = (face_normals(vertices, faces)[samples.faces][nearest] * near[..., None]).sum(axis=1)
    length = np.linalg.norm(mean, axis=1) / np.maximum(near.sum(axis=1), 1)
    return np.where(near.sum(axis=1) >= 4, np.degrees(np.arccos(np.clip(length, 0.0, 1.0))), 0.0)


def _low_pass(vertices, faces, edge_mm, pass_mm):
    """Vertices (n, 3) without waves of the surface shorter than pass_mm, of which half is left.

    edge_mm: how long the edges are. The response to the neighbours' Laplacian k in 0..2, which is (pi edge / wave)^2 on
    an even mesh, is 2^-(k / k_pass)^3, as a series of Chebyshev polynomials: as many products with the mesh as a wave
    has edges, where plain rounds of smoothing need the fourth power of that.
    """
    adjacency = vertex_adjacency(faces, len(vertices))
    mean = sp.diags(1.0 / np.maximum(np.asarray(adjacency.sum(axis=1)).ravel(), 1.0)) @ adjacency
    k_pass = (np.pi * edge_mm / pass_mm) ** 2
    degree = int(np.ceil(SERIES / np.sqrt(min(k_pass, 1.0))))
    series = chebinterpolate(lambda x: np.exp2(-(((1.0 + x) / k_pass) ** 3)), degree)
    before, last = vertices, -(mean @ vertices)
    series /= chebval(-1.0, series)  # what is no wave stays to the last digit
    result = series[0] * before + series[1] * last
    for share in series[2:]:
        before, last = last, -2.0 * (mean @ last) - before
        result += share * last
    return result


class Target:
    """A scan prepared for matching: nearest points, smooth normals, border, and what a camera outside can see.

    vertices (n, 3) mm, faces (m, 3), openness (n,) in 0..1 or None: pouches and mouth bags of the scan attract nothing
    """

    MIN_OPENNESS = 0.06

    def __init__(self, vertices, faces, openness=None):
        self.surface = Surface(vertices, faces)
        self.vertices, self.faces = self.surface.vertices, self.surface.faces
        self.normals = vertex_normals(self.vertices, self.faces)
        self.border = border_vertices(self.faces, len(self.vertices))
        self.roughness = np.ones(len(self.vertices))
        self.hair = np.zeros(len(self.vertices))
        self.openness = np.ones(len(self.vertices)) if openness is None else np.asarray(openness)

    def tell_skin(self, skin_points, hair):
        """Set self.roughness (n,) relative to the scan's skin, known to lie near skin_points (k, 3), and self.hair (n,)
        as hair.hair_by_color gives it.
        """
        degrees = roughness_deg(self.vertices, self.faces)
        skin = self.surface.closest(skin_points)
        typical = np.median(interpolate(degrees, self.faces, skin.faces, skin.barycentric))
        self.roughness = degrees / max(float(typical), 3.0)
        self.hair = hair

    def smoothed(self, edge_mm):
        """The same Target without the scanner's noise: what is finer than about PASS_MM is gone, the rest stays.

        edge_mm: how long the scan's edges are. Of a coarse scan its facets go: of 3,000 triangles, corners stand 0.1 to
        0.2 mm before a face's true surface and middles as much behind it, and the model slides to where these have it
        (twelve heads of known truth 0.98 mm off with the facets, 0.92 without).
        """
        smooth = copy(self)
        pass_mm = max(PASS_MM, FACET_PASS * edge_mm)
        while edge_mm > FINE_MM:
            edges, smooth.faces = split_in_four(smooth.faces, len(smooth.vertices))
            for name in ("vertices", "roughness", "hair", "openness"):
                setattr(smooth, name, with_midpoints(getattr(smooth, name), edges))
            edge_mm /= 2
        smooth.surface = Surface(_low_pass(smooth.vertices, smooth.faces, edge_mm, pass_mm), smooth.faces)
        smooth.vertices = smooth.surface.vertices
        smooth.normals = vertex_normals(smooth.vertices, smooth.faces)
        smooth.border = border_vertices(smooth.faces, len(smooth.vertices))
        return smooth

    def match(self, points, normals, *, max_distance, max_angle_deg=60.0, tau=None):
        """Matches of template points (k, 3) with outward normals (k, 3).

        A match loses its weight beyond max_distance mm, where the normals differ by more than max_angle_deg, where the
        nearest point lies on a border of the scan, or in a pouch. tau mm: scale of the Geman-McClure weight.
        """
        nearest = self.surface.closest(points)
        corners = self.faces[nearest.faces]
        scan_normals = interpolate(self.normals, self.faces, nearest.faces, nearest.barycentric)
        scan_normals /= np.maximum(np.linalg.norm(scan_normals, axis=1, keepdims=True), 1e-12)
        cosine = np.einsum("kc,kc->k", scan_normals, normals)
        limit = np.cos(np.radians(max_angle_deg))
        weights = np.clip((cosine - limit) / (1 - limit) * 2.0, 0.0, 1.0)
        weights[nearest.distance > max_distance] = 0.0
        on_border = (self.border[corners] | (nearest.barycentric < 1e-9)).all(axis=1) & self.border[corners].any(axis=1)
        weights[on_border] = 0.0
        openness = interpolate(self.openness, self.faces, nearest.faces, nearest.barycentric)
        weights *= np.clip(openness / self.MIN_OPENNESS - 1.0, 0.0, 1.0) if self.openness.min() < 1 else 1.0
        if tau is not None:
            weights *= (tau**2 / (tau**2 + nearest.distance**2)) ** 2
        told = self._told(self.faces, nearest.faces, nearest.barycentric)
        return Matches(nearest.points, scan_normals, weights, nearest.distance, *told)

    def samples(self, count, seed=0):
        """Samples spread evenly over the open part of the scan."""
        openness = self.openness[self.faces].mean(axis=1)
        areas = face_areas(self.vertices, self.faces) * (openness > self.MIN_OPENNESS)
        rng = np.random.default_rng(seed)
        edges = np.cumsum(areas)
        strata = (np.arange(count) + rng.random(count)) / count * edges[-1]
        face = np.minimum(np.searchsorted(edges, strata), len(areas) - 1)
        u, v = rng.random(count), rng.random(count)
        flip = u + v > 1
        u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
        barycentric = np.stack([1 - u - v, u, v], axis=1)
        at = self.faces, face, barycentric
        normals = interpolate(self.normals, *at)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return Samples(interpolate(self.vertices, *at), normals, *self._told(*at))

    def _told(self, *at):
        """(roughness, hair), each (k,), at places of interpolate."""
        return tuple(interpolate(values, *at) for values in (self.roughness, self.hair))
