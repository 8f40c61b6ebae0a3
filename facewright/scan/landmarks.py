"""Landmarks on a mesh: pictures from many directions, the landmarker on each, rays back to the surface, agreement."""

from __future__ import annotations

import numpy as np

from facewright.data import Landmarks
from facewright.mesh.closest import Surface
from facewright.mesh.raster import Camera
from facewright.scan.detector import LANDMARK_NAMES, N_LANDMARKS, mirrored_landmarks
from facewright.scan.sightings import CLAY_LOOKS, Looks, Subject, join_sightings, sight_landmarks, transform

__all__ = ["IBUG68", "STABLE", "VIEWS", "fuse_sightings", "lift_landmarks", "mirrored_landmarks"]

# (yaw, pitch) of the cameras in degrees: dense about the front, where the network is best; mirror-symmetric.
VIEWS = tuple((float(yaw), float(pitch)) for pitch in (-15, 0, 15) for yaw in (-40, -20, 0, 20, 40))
# Pictures: the face fills about two thirds of the height, 0.8 mm a pixel (the network itself sees about 1 mm).
VIEW_CENTER, VIEW_HALF_HEIGHT, VIEW_SIZE = (0.0, -30.0, 20.0), 150.0, 384

# Lips, eyes and nose: 1 to 2.5 mm from the truth on heads where it is known; brows 1-2.5, the oval 3-5.
OVAL: tuple[int, ...] = (10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377)
OVAL = (*OVAL, 152, 148, 176, 149, 150, 136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109)
LIPS_OUTER = (61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291, 185, 40, 39, 37, 0, 267, 269, 270, 409)
LIPS_INNER = (78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308, 191, 80, 81, 82, 13, 312, 311, 310, 415)
EYE_RIGHT = (33, 7, 163, 144, 145, 153, 154, 155, 133, 173, 157, 158, 159, 160, 161, 246)
EYE_LEFT = (263, 249, 390, 373, 374, 380, 381, 382, 362, 398, 384, 385, 386, 387, 388, 466)
NOSE = (1, 2, 4, 5, 6, 19, 94, 168, 195, 197, 48, 64, 98, 278, 294, 327)
STABLE = LIPS_OUTER + LIPS_INNER + EYE_RIGHT + EYE_LEFT + NOSE

# iBUG-68 p1..p68 in MediaPipe's numbering, the person's right first. Outline and brows are the same lines with other
# points on them.
IBUG68: tuple[int, ...] = (127, 93, 132, 58, 136, 150, 149, 148, 152, 377, 378, 379, 365, 288, 361, 323, 356)
IBUG68 = (*IBUG68, 70, 63, 105, 66, 107, 336, 296, 334, 293, 300, 8, 6, 195, 4, 98, 97, 2, 326, 327)
IBUG68 = (*IBUG68, 33, 160, 158, 133, 153, 144, 362, 385, 387, 263, 373, 380)
IBUG68 = (*IBUG68, 61, 40, 37, 0, 267, 270, 291, 321, 314, 17, 84, 91, 78, 82, 13, 312, 308, 317, 14, 87)


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


def fuse_sightings(subject, T, sightings, *, outlier_mm=3.0):
    """One point on the surface per landmark, by agreement of the views.

    The weighted geometric median tells which sightings agree (within outlier_mm or twice the median distance); their
    mean is carried to the nearest surface that was seen from outside.

    T (4, 4) leads from the subject's frame to that of the sightings
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
    seen_at_all = weights.any(axis=0)
    typical = np.nanmedian(np.where((weights > 0) | ~seen_at_all, distance, np.nan), axis=0)
    inlier = (weights > 0) & (distance <= np.maximum(outlier_mm, 2.0 * typical))
    agreed = weights * inlier
    mean = _weighted_mean(points, agreed)
    spread = np.sqrt(_weighted_mean((points - mean) ** 2, agreed).sum(axis=1))
    surface = Surface(transform(T, subject.vertices), subject.faces[sightings.seen])
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
    wardrobe = []
    if texture is not None or colors is not None:
        wardrobe.append(Looks(texture, uv, uv_faces, colors))
    if clay or not wardrobe:
        wardrobe.append(CLAY_LOOKS)
    subject = Subject.of(np.asarray(vertices, dtype=np.float64), np.asarray(faces))
    sightings = sight_landmarks(subject, np.eye(4), wardrobe, face_cameras(views), unlit=unlit)
    return fuse_sightings(subject, np.eye(4), join_sightings(sightings))
