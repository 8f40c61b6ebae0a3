"""Scans made from a template, with the truth beside them: where every vertex of the template really is.

A person is drawn, seen as a scanner would see them (evaluate/scanner.py), cut off, given hair, loose strands, a collar,
holes, noise and colour, and put slightly off our frame. Same seed, same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from facewright.data import Scan
from facewright.evaluate.clutter import collar, hair_height, strands
from facewright.evaluate.procedural import fractal_noise
from facewright.evaluate.scanner import eyeball, remesh, scanner_surface
from facewright.evaluate.skin_paint import Complexion, HeadPaint, random_complexion
from facewright.mesh.closest import Surface
from facewright.mesh.normals import vertex_normals

SKIN, EYE, HAIR, CLOTH = range(4)


@dataclass(frozen=True)
class SyntheticOptions:
    """What the made scanner does to a head.

    n_faces        triangles of the head, before cutting
    noise_mm       standard deviation of the noise along the normals
    hair_mm        how far the hair stands off, 0 for a bald head
    strands        loose ribbons of hair over the forehead and the temples
    collar         a folded collar around the neck
    holes          holes in the scan: the first at the side of the jaw, the others under the chin and on the neck
    open_back      the back of the head is missing
    pose_deg, pose_mm  largest turn and shift off our frame
    colored        vertex colours: skin, lips, brows, eyes
    complexion     drawn from the seed where None
    """

    n_faces: int = 90000
    noise_mm: float = 0.15
    hair_mm: float = 9.0
    strands: int = 18
    collar: bool = True
    holes: int = 2
    open_back: bool = False
    pose_deg: float = 3.0
    pose_mm: float = 2.0
    colored: bool = True
    complexion: Complexion | None = None


@dataclass(frozen=True)
class MadeHead:
    """A made scan in its own frame, before colour and pose.

    vertices (k, 3), faces (m, 3) with noise, hole and clutter; clean (k, 3) the same points on the noise-free surface
    kind (m,) SKIN, EYE, HAIR or CLOTH; surface (V, F) what a perfect scanner would see
    """

    vertices: np.ndarray
    faces: np.ndarray
    clean: np.ndarray
    kind: np.ndarray
    surface: tuple[np.ndarray, np.ndarray]


def random_identity(template, seed, scale=0.9):
    """(n, 3) vertices of a random person: all identity modes drawn from N(0, scale), origin between the eyes."""
    rng = np.random.default_rng([seed, 1])
    weights = rng.normal(0.0, scale, len(template.identity_basis))
    vertices = template.vertices + np.tensordot(weights, template.identity_basis, axes=1)
    return centered_between_eyes(vertices, template)


def centered_between_eyes(vertices, template):
    """vertices (n, 3) shifted so that the middle between the eyeballs' centres is the origin."""
    eyes = [eyeball(vertices[template.part(name).vertex_slice])[0] for name in ("eye_left", "eye_right")]
    return vertices - np.mean(eyes, axis=0)


def with_fewer_modes(template, count=20):
    """The template as a fit may use it: only the first identity modes."""
    return replace(template, identity_basis=template.identity_basis[:count])


def synthetic_scan(template, vertices_true, seed, options=None):
    """A scan of a known head: (Scan with vertex colours, truth).

    template       the Template that the head is made in
    vertices_true  (n, 3) mm: the person, in the template's topology
    seed           everything else follows from it
    returns        truth: dict vertices (n, 3) true positions in the scan's frame, surface (V, F) noise-free, T (4, 4)
    """
    options = options or SyntheticOptions()
    rng = np.random.default_rng([seed, 2])
    head = make_head(template, vertices_true, rng, seed, options)
    colors = None
    if options.colored:
        complexion = options.complexion or random_complexion(np.random.default_rng([seed, 3]))
        colors = paint_vertices(head, HeadPaint(template, vertices_true, complexion, seed))
    T = small_motion(rng, options.pose_deg, options.pose_mm)

    def move(points):
        return points @ T[:3, :3].T + T[:3, 3]

    name = f"{template.info.get('name', 'head')}-{seed}"
    scan = Scan(move(head.vertices), head.faces, colors=colors, name=name)
    surface = (move(head.surface[0]), head.surface[1])
    return scan, {"vertices": move(vertices_true), "surface": surface, "T": T}


def make_head(template, vertices, rng, seed, options):
    """A MadeHead of a person (vertices (n, 3) in the template's topology)."""
    V, F, eye = scanner_surface(template, vertices)
    surface = Surface(V, F)
    points, faces = remesh(V, F, options.n_faces, rng)
    kind = np.where(eye[surface.closest(points[faces].mean(axis=1)).faces], EYE, SKIN)
    normals = vertex_normals(points, faces)
    depth = scalp_depth(template, vertices, points)
    seen = points
    if options.hair_mm > 0:
        height = hair_height(points, depth, seed, thickness=options.hair_mm)
        seen = points + height[:, None] * normals
        kind = np.where((kind == SKIN) & (height[faces].mean(axis=1) > 0.6), HAIR, kind)
    seen = seen + rng.normal(0.0, options.noise_mm, len(seen))[:, None] * normals
    chin = chin_height(template, vertices)
    kept = _kept(points[faces].mean(axis=1), template, vertices, chin, rng, seed, options)
    faces, kind = faces[kept], kind[kept]
    if options.strands and options.hair_mm > 0:
        chosen, directions = _strand_starts(points, depth, faces, options.strands, rng)
        ribbons, more, roots = strands(Surface(seen, faces), seen[chosen], directions, rng)
        more = more + len(seen)
        for root, vertex in zip(roots, chosen):  # a strand hangs on a vertex of the head, else it is a loose crumb
            more[more == root + len(seen)] = vertex
        seen, points = np.vstack([seen, ribbons]), np.vstack([points, ribbons])
        faces, kind = np.vstack([faces, more]), np.append(kind, np.full(len(more), HAIR))
    head = [(seen, faces, points, kind)]
    if options.collar:
        cloth, cloth_faces = collar(V, F, max(chin - 48.0, V[:, 1].min() + 5.0), rng)
        head.append((cloth, cloth_faces, cloth, np.full(len(cloth_faces), CLOTH)))
    return _joined(head, (V, F))


def _joined(pieces, surface):
    """Several (vertices, faces, clean, kind) as one MadeHead without unused points."""
    offsets = np.cumsum([0] + [len(piece[0]) for piece in pieces])
    vertices, clean = (np.vstack([piece[i] for piece in pieces]) for i in (0, 2))
    faces = np.vstack([piece[1] + offset for piece, offset in zip(pieces, offsets)])
    used, faces = np.unique(faces, return_inverse=True)
    kind = np.concatenate([piece[3] for piece in pieces])
    return MadeHead(vertices[used], faces.reshape(-1, 3), clean[used], kind, surface)


def scalp_depth(template, vertices, points):
    """(k,) how far inside the hairline points (k, 3) are, mm; negative outside."""
    regions, (_, y, z) = template.regions, vertices.T
    outer, ears = regions["outer"], regions["ear_left"] | regions["ear_right"]
    hairline = -25.0 - 0.6 * np.clip(z[ears].mean() - z, 0.0, 90.0)
    scalp = outer & ~regions["face"] & ~ears & (y > hairline)
    to_scalp = cKDTree(vertices[scalp]).query(points)[0]
    to_skin = cKDTree(vertices[outer & ~scalp]).query(points)[0]
    return to_skin - to_scalp


def chin_height(template, vertices):
    """Height of the chin, mm: the lowest point of the face that is not behind the mouth's corners."""
    corner = vertices[template.lines["lip_seam_upper"][0]]
    front = template.regions["face"] & (vertices[:, 2] > corner[2] - 5.0) & (np.abs(vertices[:, 0]) < 15.0)
    return float(vertices[front, 1].min())


def _kept(centers, template, vertices, chin, rng, seed, options):
    """(m,) bool: faces that the scanner saw; centers (m, 3)."""
    wave = 4.0 * fractal_noise(centers, 25.0, seed + 11)
    ring = vertices[template.lines["neck_ring"]] @ [0.0, 1.0, 0.25]
    kept = centers @ [0.0, 1.0, 0.25] > max(chin - 55.0, ring.max() + 8.0) + wave
    if options.open_back:
        ears = template.regions["ear_left"] | template.regions["ear_right"]
        kept &= centers[:, 2] > vertices[ears, 2].mean() - 12.0 + wave
    side = rng.choice([-1.0, 1.0])
    places = [(side * 52.0, chin + 38.0, 6.0), (side * -12.0, chin - 30.0, 10.0), (side * 40.0, chin - 25.0, 8.0)]
    for x, y, radius in places[: options.holes]:
        candidates = np.flatnonzero(centers[:, 2] > -60.0)
        middle = candidates[np.linalg.norm(centers[candidates][:, :2] - [x, y], axis=1).argmin()]
        ragged = radius * (1 + 0.35 * fractal_noise(centers, 6.0, seed + 12))
        kept &= np.linalg.norm(centers - centers[middle], axis=1) > ragged
    return kept


def _strand_starts(points, depth, faces, count, rng):
    """Vertices just inside the hairline of forehead and temples, and the directions (s, 3) of strands from there."""
    there = np.zeros(len(points), bool)
    there[faces] = True
    middle = np.median(points[depth > 0, 2])
    front = (depth > 2.0) & (depth < 14.0) & (points[:, 2] > middle) & (points[:, 1] > 0.0)
    chosen = np.flatnonzero(there & front)
    if len(chosen):
        chosen = rng.choice(chosen, count)
    sideways = np.sign(points[chosen, 0])[:, None] * [1.0, 0.0, 0.0] * rng.uniform(0.2, 1.0, (len(chosen), 1))
    return chosen, sideways + [0.0, -0.6, 0.3] + rng.normal(0, 0.25, (len(chosen), 3))


def small_motion(rng, degrees, millimetres):
    """(4, 4) rigid motion of up to that much turn and shift, as a rough alignment leaves."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    angle = np.radians(rng.uniform(-degrees, degrees))
    K = np.cross(np.eye(3), axis)
    T = np.eye(4)
    T[:3, :3] = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    T[:3, 3] = rng.uniform(-millimetres, millimetres, 3)
    return T


def paint(points, kind, brush):
    """(k, 3) sRGB 0..1 of points (k, 3) of a kind (k,): SKIN, EYE, HAIR or CLOTH; brush a HeadPaint."""
    colors = np.empty((len(points), 3))
    for which, painter in ((SKIN, brush.skin), (EYE, brush.eye), (HAIR, brush.hair), (CLOTH, brush.cloth)):
        mask = kind == which
        if mask.any():
            colors[mask] = painter(points[mask])
    return colors


def paint_vertices(head, brush):
    """(k, 3) sRGB colours of a MadeHead's vertices; one that touches several kinds takes the last in the list."""
    kind = np.zeros(len(head.vertices), np.int64)
    np.maximum.at(kind, head.faces.ravel(), np.repeat(head.kind, 3))
    return paint(head.clean, kind, brush)
