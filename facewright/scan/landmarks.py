"""Landmarks on a mesh: pictures from many directions, the landmarker on each, rays back to the surface, agreement.

Every picture is also shown to the network mirrored. That halves its noise, and makes the result commute with
mirroring the head: what is left of the network's bias is the same on both sides.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from facewright.data import Landmarks
from facewright.mesh.adjacency import unique_edges, vertex_adjacency
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import face_normals, vertex_normals
from facewright.mesh.raster import Camera, RayScene
from facewright.mesh.render import render_with_hits
from facewright.scan.detector import (
    LANDMARK_NAMES,
    N_LANDMARKS,
    canonical_landmarks,
    canonical_normals,
    detect_landmarks,
)

# (yaw, pitch) of the cameras in degrees: dense about the front, where the network is best; mirror-symmetric.
VIEWS = tuple((float(yaw), float(pitch)) for pitch in (-15, 0, 15) for yaw in (-40, -20, 0, 20, 40))
# Pictures: the face fills about two thirds of the height, 0.8 mm a pixel (the network itself sees about 1 mm).
VIEW_CENTER, VIEW_HALF_HEIGHT, VIEW_SIZE = (0.0, -30.0, 20.0), 150.0, 384

# Lips, eyes and nose: 1 to 2.5 mm from the truth on heads where it is known; brows 1-2.5, the oval 3-5.
OVAL = (10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377)
OVAL = (*OVAL, 152, 148, 176, 149, 150, 136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109)
LIPS_OUTER = (61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291, 185, 40, 39, 37, 0, 267, 269, 270, 409)
LIPS_INNER = (78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308, 191, 80, 81, 82, 13, 312, 311, 310, 415)
EYE_RIGHT = (33, 7, 163, 144, 145, 153, 154, 155, 133, 173, 157, 158, 159, 160, 161, 246)
EYE_LEFT = (263, 249, 390, 373, 374, 380, 381, 382, 362, 398, 384, 385, 386, 387, 388, 466)
NOSE = (1, 2, 4, 5, 6, 19, 94, 168, 195, 197, 48, 64, 98, 278, 294, 327)
STABLE = LIPS_OUTER + LIPS_INNER + EYE_RIGHT + EYE_LEFT + NOSE

# iBUG-68 p1..p68 in MediaPipe's numbering, the person's right first. Outline and brows are the same lines with other
# points on them.
IBUG68 = (127, 93, 132, 58, 136, 150, 149, 148, 152, 377, 378, 379, 365, 288, 361, 323, 356)
IBUG68 = (*IBUG68, 70, 63, 105, 66, 107, 336, 296, 334, 293, 300, 8, 6, 195, 4, 98, 97, 2, 326, 327)
IBUG68 = (*IBUG68, 33, 160, 158, 133, 153, 144, 362, 385, 387, 263, 373, 380)
IBUG68 = (*IBUG68, 61, 40, 37, 0, 267, 270, 291, 321, 314, 17, 84, 91, 78, 82, 13, 312, 308, 317, 14, 87)


@functools.lru_cache(maxsize=1)
def mirrored_landmarks():
    """(478,) index of each landmark's twin on the other side of the face."""
    canonical = canonical_landmarks()
    gaps = np.linalg.norm(canonical[:, None] * [-1, 1, 1] - canonical[None], axis=2)
    twins = np.arange(N_LANDMARKS)
    twins[: len(canonical)] = gaps.argmin(axis=1)
    # Irises: centre, then the points towards the person's left, up, right and down.
    twins[468:] = [473, 476, 475, 474, 477, 468, 471, 470, 469, 472]
    return twins


@dataclass(frozen=True)
class Looks:
    """How the surface looks beside its shape: texture with uv (t, 2) and uv_faces (m, 3), or colors (n, 3) linear."""

    texture: np.ndarray | None = None
    uv: np.ndarray | None = None
    uv_faces: np.ndarray | None = None
    colors: np.ndarray | None = None


CLAY_LOOKS = Looks()


@dataclass(frozen=True)
class Sightings:
    """What the views saw. v views that found a face, k = 478 landmarks.

    points  (v, k, 3) on the surface
    facing  (v, k) how squarely the view looks at the landmark, 0..1: the cosine between the view and the surface's
            normal (0 where the ray met nothing) times the one with the canonical face's. Without the latter a
            landmark of the far cheek, seen through the nose, would count as a good look at the nose
    seen    sorted indices of the faces that any camera saw
    missed  how many views found no face
    """

    points: np.ndarray
    facing: np.ndarray
    seen: np.ndarray
    missed: int


def detect_both_ways(image):
    """(478, 2) pixels, the mean of the picture's landmarks and of its mirror image's; None if either has no face."""
    found = detect_landmarks(image)
    mirrored = detect_landmarks(image[:, ::-1])
    if found is None or mirrored is None:
        return None
    mirrored = mirrored[mirrored_landmarks()] * [-1, 1] + [image.shape[1], 0]
    return (found + mirrored) / 2


def cast_pixels(scene, camera, pixels):
    """Hits of the rays through pixel positions (k, 2) of a camera."""
    height, width = camera.size
    offset = (pixels - [width / 2, height / 2]) * [1, -1] * (2 * camera.half_height / height)
    origins = camera.center + offset @ camera.R[:2] + 1000.0 * camera.R[2]
    return scene.cast(origins, np.broadcast_to(-camera.R[2], origins.shape))


def shading_normals(vertices, faces, *, reach=2.0):
    """(n, 3) vertex normals, averaged over about reach (in the unit of vertices, about 2 mm).

    Finer detail is noise, or the facets of a coarse mesh that was subdivided; the landmarker should see neither.
    """
    normals = vertex_normals(vertices, faces)
    edges = unique_edges(faces)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    passes = int(np.clip(np.round((reach / np.median(lengths)) ** 2), 0, 32))
    ring = vertex_adjacency(faces, len(vertices)) + sp.identity(len(vertices), format="csr")
    for _ in range(passes):
        normals = ring @ normals  # only the direction counts
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return normals


def sight_landmarks(vertices, faces, wardrobe, cameras, *, normals=None, unlit=False):
    """Sightings of a mesh by cameras, one list entry for each Looks of the wardrobe.

    vertices (n, 3) in our frame or near it, about mm; faces (m, 3); normals (n, 3) to shade with
    unlit    show textures and colours as they are; clay is always lit
    """
    scene = RayScene(vertices, faces)
    of_faces = face_normals(vertices, faces)
    normals = shading_normals(vertices, faces) if normals is None else normals
    seen = np.zeros(len(faces), bool)
    points, facing = [[] for _ in wardrobe], [[] for _ in wardrobe]
    for camera in cameras:
        hits = scene.cast(*camera.rays())
        seen[hits.face[hits.face >= 0]] = True
        for number, looks in enumerate(wardrobe):
            picture = {"normals": normals, "unlit": unlit and looks is not CLAY_LOOKS, "hits": hits}
            image, _ = render_with_hits(vertices, faces, camera, **vars(looks), **picture)
            pixels = detect_both_ways(image)
            if pixels is None:
                continue
            lifted = cast_pixels(scene, camera, pixels)
            hit = lifted.face >= 0
            points[number].append(interpolate(vertices, faces, lifted.face, lifted.barycentric))
            # Of either sign: a surface may be wound inward, and a ray's first hit is visible all the same.
            cosine = np.where(hit, np.abs(of_faces[lifted.face] @ camera.R[2]), 0.0)
            facing[number].append(cosine * np.clip(canonical_normals() @ camera.R[2], 0.0, 1.0))
            seen[lifted.face[hit]] = True
    seen = np.flatnonzero(seen)
    shapes = [(len(views), N_LANDMARKS) for views in points]
    return [
        Sightings(np.reshape(p, (*shape, 3)), np.reshape(f, shape), seen, len(cameras) - len(p))
        for p, f, shape in zip(points, facing, shapes)
    ]


def geometric_median(points, weights, iterations=30):
    """(k, 3) weighted geometric medians of points (v, k, 3) with weights (v, k), by Weiszfeld's iteration."""
    center = _weighted_mean(points, weights)
    for _ in range(iterations):
        distance = np.linalg.norm(points - center, axis=2)
        center = _weighted_mean(points, weights / np.maximum(distance, 1e-2))
    return center


def _weighted_mean(points, weights):
    total = np.maximum(weights.sum(axis=0), 1e-12)
    return np.einsum("vk,vkd->kd", weights, points) / total[:, None]


def fuse_sightings(vertices, faces, sightings, *, outlier_mm=3.0):
    """One point on the surface per landmark, by agreement of the views.

    The weighted geometric median tells which sightings agree (within outlier_mm or twice the median distance); their
    mean is carried to the nearest surface that was seen from outside.

    returns Landmarks "mp0".."mp477"; weight: the share of looks that agree, less for a wide spread; 0: not usable
    """
    if not len(sightings.points):
        zeros = np.zeros(N_LANDMARKS)
        corner = np.tile([1.0, 0.0, 0.0], (N_LANDMARKS, 1))
        return Landmarks(LANDMARK_NAMES, zeros.astype(np.int64), corner, zeros)
    points = sightings.points
    # A grazing hit moves far for a pixel's error.
    weights = np.clip(sightings.facing - 0.05, 0.0, None)
    median = geometric_median(points, weights)
    distance = np.linalg.norm(points - median, axis=2)
    typical = np.nanmedian(np.where(weights > 0, distance, np.nan), axis=0, keepdims=True) if weights.any() else 0.0
    inlier = (weights > 0) & (distance <= np.maximum(outlier_mm, 2.0 * np.nan_to_num(typical)))
    agreed = weights * inlier
    mean = _weighted_mean(points, agreed)
    spread = np.sqrt(_weighted_mean((points - mean) ** 2, agreed).sum(axis=1))
    surface = Surface(vertices, faces[sightings.seen])
    nearest = surface.closest(mean)
    share = agreed.sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-12)
    confidence = np.where(share > 0, share * np.exp(-((spread / 6.0) ** 2) - (nearest.distance / 6.0) ** 2), 0.0)
    return Landmarks(LANDMARK_NAMES, sightings.seen[nearest.faces], nearest.barycentric, confidence)


def face_cameras(views=VIEWS, center=VIEW_CENTER, half_height=VIEW_HALF_HEIGHT, size=VIEW_SIZE):
    """Cameras about a face that stands in our frame."""
    return [Camera.looking_at(center, yaw, pitch, half_height, (size, size)) for yaw, pitch in views]


def lift_landmarks(
    vertices, faces, *, texture=None, uv=None, uv_faces=None, colors=None, clay=True, views=VIEWS, unlit=False
):
    """Landmarks of a head that stands upright in our frame, about mm: a template, or a scan once it is aligned.

    vertices (n, 3), faces (m, 3); texture (h, w, 3) uint8 sRGB with uv (t, 2) and uv_faces (m, 3), or colors (n, 3)
    linear 0..1; with neither, or with clay, it is looked at in clay (too)
    views    (yaw, pitch) in degrees
    returns  Landmarks "mp0".."mp477"; all weights 0 where no view shows a face
    """
    cameras = face_cameras(views)
    wardrobe = []
    if texture is not None or colors is not None:
        wardrobe.append(Looks(texture, uv, uv_faces, colors))
    if clay or not wardrobe:
        wardrobe.append(CLAY_LOOKS)
    sightings = join_sightings(sight_landmarks(vertices, faces, wardrobe, cameras, unlit=unlit))
    return fuse_sightings(vertices, faces, sightings)


def join_sightings(parts):
    """Sightings of the same mesh in several looks, as one."""
    return Sightings(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.facing for part in parts]),
        np.unique(np.concatenate([part.seen for part in parts])),
        sum(part.missed for part in parts),
    )
