"""What a camera sees of a face on a mesh: pictures of a subject in several looks, landmarks lifted along the rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import unique_edges, vertex_adjacency
from facewright.mesh.closest import interpolate
from facewright.mesh.normals import face_normals, vertex_normals
from facewright.mesh.raster import Camera, RayScene
from facewright.mesh.render import CLAY, render_with_hits, srgb_to_linear
from facewright.scan.detector import N_LANDMARKS, canonical_normals, detect_both_ways

# Textures are brought under this size by whole factors: at 0.8 mm a pixel more would only alias.
TEXTURE_SIDE = 1536


@dataclass(frozen=True)
class Looks:
    """How the surface looks beside its shape: texture with uv (t, 2) and uv_faces (m, 3), or colors (n, 3) linear."""

    texture: np.ndarray | None = None
    uv: np.ndarray | None = None
    uv_faces: np.ndarray | None = None
    colors: np.ndarray | None = None


CLAY_LOOKS = Looks()


@dataclass(frozen=True)
class Subject:
    """A mesh ready to be looked at: about the origin, within about a metre, in any orientation.

    vertices (n, 3), faces (m, 3); scene for rays; normals (n, 3) to shade with; face_normals (m, 3)
    """

    vertices: np.ndarray
    faces: np.ndarray
    scene: RayScene
    normals: np.ndarray
    face_normals: np.ndarray

    @staticmethod
    def of(vertices, faces, *, reach=2.0):
        """reach: over how much the shading is averaged, about 2 mm."""
        normals = shading_normals(vertices, faces, reach=reach)
        return Subject(vertices, faces, RayScene(vertices, faces), normals, face_normals(vertices, faces))

    def shaded_over(self, reach):
        """The same subject with its shading averaged over another reach."""
        return replace(self, normals=shading_normals(self.vertices, self.faces, reach=reach))


@dataclass(frozen=True)
class Sightings:
    """What the views saw. v views that found a face, k = 478 landmarks.

    points  (v, k, 3) on the surface, in the frame that the cameras stand in
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


def shading_normals(vertices, faces, *, reach=2.0):
    """(n, 3) vertex normals, averaged over about reach (in the unit of vertices, about 2 mm).

    Finer detail is noise, or the facets of a coarse mesh that was subdivided; the landmarker should see neither.
    """
    normals = vertex_normals(vertices, faces)
    edges = unique_edges(faces)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    passes = int(np.clip(np.round((reach / np.median(lengths)) ** 2), 0, 32))
    ring = vertex_adjacency(faces, len(vertices)) + sp.identity(len(vertices), format="csr") if passes else None
    for _ in range(passes):
        normals = ring @ normals  # only the direction counts
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return normals


def worn_looks(scan):
    """Looks of a Scan with textures (several are laid side by side in one picture) or colours; None in clay."""
    if not scan.has_texture:
        return None if scan.colors is None else Looks(colors=srgb_to_linear(scan.colors))
    number = np.zeros(len(scan.faces), np.int64) if scan.face_texture is None else scan.face_texture
    if len(scan.textures) == 1 and (number == 0).all():
        return Looks(_shrunk(scan.textures[0]), scan.uv, scan.uv_faces)
    clay = np.full((2, 2, 3), np.array(CLAY) * 255, np.uint8)
    tiles = [_resized(image, TEXTURE_SIDE // 2) for image in (*scan.textures, clay)]
    number = np.where(number < 0, len(tiles) - 1, number)
    corners = scan.uv[scan.uv_faces]  # (m, 3, 2)
    corners = corners - np.floor(corners.mean(axis=1, keepdims=True))
    corners[..., 0] = (np.clip(corners[..., 0], 0.0, 1.0) + number[:, None]) / len(tiles)
    uv_faces = np.arange(3 * len(scan.faces)).reshape(-1, 3)
    return Looks(np.concatenate(tiles, axis=1), corners.reshape(-1, 2), uv_faces)


def _shrunk(image):
    """The image averaged over whole blocks until neither side is over TEXTURE_SIDE."""
    factor = -(-max(image.shape[:2]) // TEXTURE_SIDE)
    if factor == 1:
        return image
    height, width = (side // factor for side in image.shape[:2])
    blocks = image[: height * factor, : width * factor].reshape(height, factor, width, factor, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def _resized(image, side):
    """(side, side, 3) by nearest samples of the shrunk image."""
    image = _shrunk(image)
    rows, columns = (np.arange(side) * extent // side for extent in image.shape[:2])
    return image[rows[:, None], columns]


def cast_pixels(scene, camera, pixels):
    """Hits of the rays through pixel positions (k, 2) of a camera."""
    height, width = camera.size
    offset = (pixels - [width / 2, height / 2]) * [1, -1] * (2 * camera.half_height / height)
    origins = camera.center + offset @ camera.R[:2] + 1000.0 * camera.R[2]
    return scene.cast(origins, np.broadcast_to(-camera.R[2], origins.shape))


def moved_camera(camera, T):
    """The camera that sees in x what camera sees in T x; T a similarity without mirroring."""
    scale = np.cbrt(np.linalg.det(T[:3, :3]))
    rotation = T[:3, :3] / scale
    center = (camera.center - T[:3, 3]) @ rotation / scale
    return Camera(camera.R @ rotation, center, camera.half_height / scale, camera.size)


def sight_landmarks(subject, T, wardrobe, cameras, *, unlit=False):
    """Sightings of a subject by cameras in the frame that T (4, 4) leads to, one list entry for each Looks.

    unlit  show textures and colours as they are; clay is always lit
    """
    seen = np.zeros(len(subject.faces), bool)
    points, facing = [[] for _ in wardrobe], [[] for _ in wardrobe]
    for camera in cameras:
        moved = moved_camera(camera, T)
        hits = subject.scene.cast(*moved.rays())
        seen[hits.face[hits.face >= 0]] = True
        for number, looks in enumerate(wardrobe):
            picture = {"normals": subject.normals, "unlit": unlit and looks is not CLAY_LOOKS, "hits": hits}
            image, _ = render_with_hits(subject.vertices, subject.faces, moved, **vars(looks), **picture)
            pixels = detect_both_ways(image)
            if pixels is None:
                continue
            lifted = cast_pixels(subject.scene, moved, pixels)
            hit = lifted.face >= 0
            lifted_points = interpolate(subject.vertices, subject.faces, lifted.face, lifted.barycentric)
            points[number].append(transform(T, lifted_points))
            # Of either sign: a surface may be wound inward, and a ray's first hit is visible all the same.
            cosine = np.where(hit, np.abs(subject.face_normals[lifted.face] @ moved.R[2]), 0.0)
            facing[number].append(cosine * np.clip(canonical_normals() @ camera.R[2], 0.0, 1.0))
            seen[lifted.face[hit]] = True
    seen = np.flatnonzero(seen)
    shapes = [(len(views), N_LANDMARKS) for views in points]
    return [
        Sightings(np.reshape(p, (*shape, 3)), np.reshape(f, shape), seen, len(cameras) - len(p))
        for p, f, shape in zip(points, facing, shapes)
    ]


def join_sightings(parts):
    """Sightings of the same subject in several looks, as one."""
    return Sightings(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.facing for part in parts]),
        np.unique(np.concatenate([part.seen for part in parts])),
        sum(part.missed for part in parts),
    )


def transform(T, points):
    """T x for points (k, 3)."""
    return points @ T[:3, :3].T + T[:3, 3]
