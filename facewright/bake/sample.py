"""Colours and normals of a scan at points on its triangles."""

from __future__ import annotations

import threading

import numpy as np

from facewright.bake.texels import at_corners, at_points, unit_rows
from facewright.mesh.adjacency import half_edges
from facewright.mesh.normals import face_areas, normalized, vertex_normals
from facewright.mesh.tangents import corner_tangents, from_tangent_space

SEAM_REACH_TEXELS = 1.5
MAX_LEVEL = 6


class ScanLooks:
    """A scan prepared for sampling at many hits. Every method takes hits as face (k,), barycentric (k, 3).

    Textures are read bilinearly at the level of their pyramid whose texels are about as large as the map's, so that
    a fine photograph is averaged and not picked at. Near an edge where the scan's UVs are cut, the sample is moved
    into its own triangle far enough that the neighbouring chart's pixels do not bleed in.
    """

    def __init__(self, scan, with_normals=True):
        self.scan = scan
        self._growing = threading.Lock()
        self.pyramids = tuple([texture] for texture in scan.textures)
        self.normal_pyramid = [scan.normal_map] if scan.normal_map is not None else None
        self.mapped = scan.uv is not None and (scan.has_texture or scan.normal_map is not None)
        if self.mapped:
            uv_unique, uv_faces = _welded(scan.uv, scan.uv_faces)
            self.uv_corners = uv_unique[uv_faces]  # (m, 3, 2)
            self.uv_faces = uv_faces
            self.guard(_seam_edges(uv_faces))
            flat = np.concatenate([uv_unique, np.zeros((len(uv_unique), 1))], axis=1)
            in_uv, on_surface = face_areas(flat, uv_faces), face_areas(scan.vertices, scan.faces)
            self.uv_per_mm = np.sqrt(in_uv / np.maximum(on_surface, 1e-12))  # (m,)
        if with_normals:
            self.vertex_normals = vertex_normals(scan.vertices, scan.faces)
            if scan.normal_map is not None:
                frames = corner_tangents(scan.vertices, scan.faces, self.vertex_normals, uv_unique, uv_faces)
                self.tangents, self.signs = frames

    @property
    def has_color(self):
        return self.scan.has_texture or self.scan.colors is not None

    def guard(self, edges):
        """From now on keep samples off no other cuts than these edges (m, 3) bool."""
        self.seams = edges
        self.seam_corners = _on_seams(self.uv_faces, edges)

    def colors(self, face, barycentric, texel_mm, guard=True):
        """(k, 3) float32 sRGB in 0..255 and (k,) bool: the scan has a colour there. texel_mm (k,): the map's texel.

        guard: samples are kept off the other side of seams
        """
        colors = np.zeros((len(face), 3), np.float32)
        if self.scan.has_texture:
            image = self.scan.face_texture[face] if self.scan.face_texture is not None else np.zeros(len(face), int)
            for number, pyramid in enumerate(self.pyramids):
                chosen = np.flatnonzero(image == number)
                if len(chosen):
                    colors[chosen] = self._sample(pyramid, face[chosen], barycentric[chosen], texel_mm[chosen], guard)
            return colors, image >= 0
        if self.scan.colors is not None:
            colors = at_points(self.scan.colors * 255.0, self.scan.faces, face, barycentric)
            return colors, np.ones(len(face), bool)
        return colors, np.zeros(len(face), bool)

    def normals(self, face, barycentric, texel_mm):
        """(k, 3) unit normals: the smooth ones of the scan's mesh, turned by its normal map if it has one."""
        normals = unit_rows(at_points(self.vertex_normals, self.scan.faces, face, barycentric))
        if self.normal_pyramid is None:
            return normals
        texture = self._sample(self.normal_pyramid, face, barycentric, texel_mm) / 127.5 - 1.0
        tangents = unit_rows(at_corners(self.tangents, face, barycentric))
        return from_tangent_space(texture, normals, tangents, self.signs[face].astype(np.float32))

    def _sample(self, pyramid, face, barycentric, texel_mm, guard=True):
        """(k, c) float32 of an image pyramid, each sample from the level that suits its texel."""
        height, width = pyramid[0].shape[:2]
        ratio = self.uv_per_mm[face] * np.sqrt(height * width) * texel_mm
        level = np.clip(np.rint(np.log2(np.maximum(ratio, 1e-6))), 0, MAX_LEVEL).astype(int)
        result = np.empty((len(face), pyramid[0].shape[2]), np.float32)
        for number in np.unique(level):
            chosen = np.flatnonzero(level == number)
            with self._growing:  # two threads that want the same level would both append it
                image = _pyramid_level(pyramid, number)
            scale = np.array(image.shape[1::-1], float)
            xy = self._pixels(face[chosen], barycentric[chosen], scale, guard)
            result[chosen] = sample_pixels(image, xy)
        return result

    def _pixels(self, face, barycentric, scale, guard):
        """(k, 2) positions in texels of an image of size scale (width, height), v up, kept off the seams
        that are guarded."""
        xy = at_corners(self.uv_corners, face, barycentric).astype(np.float64) * scale
        if not guard:
            return xy
        near = np.flatnonzero(self.seam_corners[face].any(1))
        corners = self.uv_corners[face[near]] * scale  # (k, 3, 2)
        at_seam, along_seam = self.seam_corners[face[near]], self.seams[face[near]]
        moved = xy[near]
        for i in range(3):
            moved = _away_from_corner(moved, corners, i, at_seam[:, i])
        for i in range(3):
            moved = _away_from_edge(moved, corners, i, along_seam[:, i])
        xy[near] = moved
        return xy


def _away_from_corner(xy, corners, i, chosen):
    """Move points (k, 2) within reach of corner i of their triangles (k, 3, 2) towards its middle."""
    to_middle = corners.mean(axis=1) - corners[:, i]
    length = np.linalg.norm(to_middle, axis=1)
    reach = np.minimum(SEAM_REACH_TEXELS, length)
    near = chosen & (np.linalg.norm(xy - corners[:, i], axis=1) < reach)
    target = corners[:, i] + to_middle * (reach / np.maximum(length, 1e-12))[:, None]
    return np.where(near[:, None], target, xy)


def _away_from_edge(xy, corners, i, chosen):
    """Move points (k, 2) off edge i -> i + 1 of their triangles (k, 3, 2), so that no texel across it is read."""
    a, b, c = corners[:, i], corners[:, (i + 1) % 3], corners[:, (i + 2) % 3]
    along = normalized(b - a)
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
    height = ((c - a) * inward).sum(1)
    inward *= np.sign(height)[:, None]
    inside = ((xy - a) * inward).sum(1)
    # Bilinear samples read texel centres less than one texel away in x and in y. A triangle thinner than that is
    # sampled at two thirds of its height, never beyond its tip.
    wanted = np.minimum(np.abs(inward).sum(axis=1), np.abs(height) * 2 / 3)
    return xy + inward * np.where(chosen, np.maximum(wanted - inside, 0.0), 0.0)[:, None]


def sample_pixels(image, xy):
    """Bilinear samples (k, c) float32 of image (h, w, c) at xy (k, 2) in texels, v up; repeats outside."""
    height, width = image.shape[:2]
    x, y = xy[:, 0] - 0.5, height - xy[:, 1] - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0).astype(np.float32)[:, None], (y - y0).astype(np.float32)[:, None]
    left, top = x0.astype(np.int64) % width, y0.astype(np.int64) % height
    right, bottom = (left + 1) % width, (top + 1) % height
    flat = image.reshape(-1, image.shape[2])
    upper = flat[top * width + left] * (1 - fx) + flat[top * width + right] * fx
    lower = flat[bottom * width + left] * (1 - fx) + flat[bottom * width + right] * fx
    return upper * (1 - fy) + lower * fy


def _pyramid_level(pyramid, level):
    """The image halved so many times by averaging 2 x 2 texels; levels are kept in the list."""
    while len(pyramid) <= level:
        image = pyramid[-1]
        height, width = max(image.shape[0] // 2, 1), max(image.shape[1] // 2, 1)
        rows = np.minimum(np.arange(2 * height), image.shape[0] - 1)
        columns = np.minimum(np.arange(2 * width), image.shape[1] - 1)
        pairs = image[rows[0::2]].astype(np.uint16) + image[rows[1::2]]
        pyramid.append(((pairs[:, columns[0::2]] + pairs[:, columns[1::2]] + 2) // 4).astype(np.uint8))
    return pyramid[level]


def _welded(uv, uv_faces):
    """The same UVs with equal rows joined: files often repeat them face by face, which would make every edge a seam."""
    keys = uv[:, 0] + 1j * uv[:, 1]
    unique, inverse = np.unique(keys, return_inverse=True)
    return np.stack([unique.real, unique.imag], axis=1), inverse[uv_faces]


def _seam_edges(uv_faces):
    """(m, 3) bool: edge corner i -> i + 1 has no neighbour in UV space."""
    edges = half_edges(uv_faces)
    n = int(uv_faces.max()) + 1 if len(uv_faces) else 0
    keys = edges[:, 0] * n + edges[:, 1]
    return ~np.isin(keys, edges[:, 1] * n + edges[:, 0]).reshape(-1, 3)


def _on_seams(uv_faces, seams):
    """(m, 3) bool: the corner is an end of a seam edge, of its own face or of another."""
    ends = np.stack([uv_faces, np.roll(uv_faces, -1, axis=1)], axis=-1)[seams]
    on_seam = np.zeros(int(uv_faces.max()) + 1 if len(uv_faces) else 0, bool)
    on_seam[ends.ravel()] = True
    return on_seam[uv_faces]
