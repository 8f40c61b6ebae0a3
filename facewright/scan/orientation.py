"""Which way a head looks, when nothing is known: small pictures from all around, and a judge for what they show.

The landmarker reports faces on the backs of heads and on collars too, and gives no score. A face is believed when its
landmarks, lifted to the surface, stand to each other in space as those of a face do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.mesh.closest import interpolate
from facewright.mesh.normals import face_areas
from facewright.mesh.raster import Camera
from facewright.mesh.render import render_with_hits
from facewright.scan.detector import canonical_landmarks, detect_landmarks
from facewright.scan.landmarks import STABLE
from facewright.scan.sightings import cast_pixels, transform

SEARCH_SIZE = 256
# A head in a picture of the whole mesh: the mesh is brought to this radius about the origin.
SEARCH_RADIUS_MM = 200.0
# Distance of a face's landmarks from the canonical face, root mean square, mm at 63 mm between the eyes. Real heads,
# seen from one side: 2.5 to 5; what is no face: 8 and more.
BELIEVED_MM, DOUBTFUL_MM = 5.5, 7.5


@dataclass(frozen=True)
class Guess:
    """T (4, 4): the mesh's frame -> ours, a similarity; residual_mm: misfit to the canonical face at 63 mm."""

    T: np.ndarray
    residual_mm: float


def fit_similarity(source, target, weights=None):
    """The similarity T (4, 4) with the least weighted sum of |T source_i - target_i|^2 (Umeyama 1991); no mirroring.

    source, target (k, 3), weights (k,)
    """
    weights = np.ones(len(source)) if weights is None else weights
    weights = weights / weights.sum()
    mean_source, mean_target = weights @ source, weights @ target
    a, b = source - mean_source, target - mean_target
    U, S, Vt = np.linalg.svd((b * weights[:, None]).T @ a)
    flip = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U * flip) @ Vt
    scale = (S * flip).sum() / max((weights[:, None] * a * a).sum(), 1e-300)
    T = np.eye(4)
    T[:3, :3] = scale * R
    T[:3, 3] = mean_target - scale * R @ mean_source
    return T


def fit_canonical(points, weights, *, rounds=5):
    """Where a face's landmarks stand in our frame: the similarity onto the canonical face, robust.

    points (478, 3) in any frame and unit, weights (478,); only lips, eyes and nose count
    returns Guess; the scale brings the face to 63 mm between the eyes
    """
    stable = np.array(STABLE)
    source, target, given = points[stable], canonical_landmarks()[stable], weights[stable]
    robust = np.ones(len(stable))
    for _ in range(rounds):
        T = fit_similarity(source, target, given * robust + 1e-12)
        misfit = np.linalg.norm(transform(T, source) - target, axis=1)
        robust = 1.0 / np.maximum(misfit, 3.0)  # Huber
    return Guess(T, float(np.sqrt(np.average(misfit**2, weights=given + 1e-12))))


def search_frame(vertices, faces):
    """T (4, 4) that brings a mesh about the origin, nearly all of it within SEARCH_RADIUS_MM."""
    areas = face_areas(vertices, faces)
    centers = vertices[faces].mean(axis=1)
    middle = areas @ centers / areas.sum()
    distance = np.linalg.norm(centers - middle, axis=1)
    order = np.argsort(distance)
    total = np.cumsum(areas[order])
    radius = distance[order][np.searchsorted(total, 0.99 * total[-1])]
    T = np.eye(4)
    T[:3, :3] *= SEARCH_RADIUS_MM / max(radius, 1e-300)
    T[:3, 3] = -T[0, 0] * middle
    return T


def search_directions():
    """Camera rotations (3, 3), rows right, up, backward: the usual ones first, then all the way round.

    The sixth of a cube first (with Y or Z up), then its edges and corners: none of the sphere is further than 27
    degrees from one of the 26. Each also turned by an eighth about its axis; quarter turns are done on the pictures.
    """
    steps = [np.array([x, y, z], float) for x in (0, 1, -1) for y in (0, 1, -1) for z in (1, -1, 0) if x or y or z]
    steps.sort(key=lambda step: np.abs(step).sum())
    for turned in (False, True):
        for step in steps:
            backward = step / np.linalg.norm(step)
            up = np.array([0.0, 1.0, 0.0]) if abs(backward[1]) < 0.9 else np.array([0.0, 0.0, -1.0])
            right = np.cross(up, backward)
            right /= np.linalg.norm(right)
            up = np.cross(backward, right)
            if turned:
                right, up = (right + up) / np.sqrt(2), (up - right) / np.sqrt(2)
            yield np.stack([right, up, backward])


def search_faces(subject, looks, *, up=None):
    """Guesses of where a face is, as they turn up, the most usual orientations first; a generator of Guess.

    subject  a Subject in the frame of search_frame; looks: Looks to show it in
    up       (3,) unit vector: only faces that stand within 60 degrees of it
    """
    for R in search_directions():
        camera = Camera(R, np.zeros(3), 1.05 * SEARCH_RADIUS_MM, (SEARCH_SIZE, SEARCH_SIZE))
        hits = subject.scene.cast(*camera.rays())
        wearing = {**vars(looks), "normals": subject.normals, "hits": hits}
        picture, _ = render_with_hits(subject.vertices, subject.faces, camera, **wearing)
        for quarter in range(4):
            pixels = detect_landmarks(np.rot90(picture, quarter))
            if pixels is None:
                continue
            lifted = cast_pixels(subject.scene, camera, _unturn(pixels, quarter))
            guess = _judge(subject, lifted, R)
            if guess is not None and (up is None or guess.T[1, :3] @ up > 0.5 * np.linalg.norm(guess.T[1, :3])):
                yield guess


def _unturn(pixels, quarter):
    """Pixels of np.rot90(image, quarter) back in the square image."""
    for _ in range(quarter):
        pixels = np.stack([SEARCH_SIZE - pixels[:, 1], pixels[:, 0]], axis=1)
    return pixels


def _judge(subject, lifted, R):
    """A Guess, or None for what is no face: rays into the void, a face that looks away, no face's proportions."""
    hit = lifted.face >= 0
    if hit[list(STABLE)].mean() < 0.9:
        return None
    points = interpolate(subject.vertices, subject.faces, lifted.face, lifted.barycentric)
    guess = fit_canonical(points, hit.astype(float))
    scale = np.linalg.norm(guess.T[2, :3])
    if guess.residual_mm > DOUBTFUL_MM or guess.T[2, :3] @ R[2] < 0.3 * scale:
        return None
    return guess
