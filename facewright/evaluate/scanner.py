"""What a scanner makes of a head: the outside only, openings bridged, and a triangulation of its own.

Used for heads whose true correspondence is known. Nothing here knows how a head is registered.
"""

from __future__ import annotations

import igl
import numpy as np

from facewright.mesh.adjacency import border_loops
from facewright.mesh.closest import Surface
from facewright.mesh.normals import face_areas, face_normals, vertex_normals

EYE_RINGS = 7
NOSTRIL_RINGS = 3
NOSTRIL_DEPTH_MM = 3.0


def scanner_surface(template, vertices):
    """The surface that a scanner could see of a head: (V (k, 3), F (m, 3), eye (m,) bool).

    template a Template, vertices (n, 3) of any head in its topology. Region `outer`, with a bump over each eyeball
    behind the open lids (eye marks its faces), lips joined at the seam, nostrils closed by shallow pits, open at the
    neck.
    """
    skin = template.faces[template.skin.face_slice]
    outer = skin[template.regions["outer"][skin].all(axis=1)]
    points, faces = [vertices], [outer]
    eye_faces = 0
    for loop in border_loops(outer):
        kind = _kind_of(loop, template)
        start = sum(len(block) for block in points)
        if kind is None:
            continue
        if kind.startswith("eye"):
            added, patch = _eye_patch(loop, vertices, template.part(kind), start)
            eye_faces += len(patch)
            faces.insert(1, patch)
        elif kind == "mouth":
            added, patch = np.empty((0, 3)), _zip(loop, vertices, template.lines["lip_seam_upper"])
            faces.append(patch)
        else:
            added, patch = _pit(loop, vertices, outer, start)
            faces.append(patch)
        points.append(added)
    V, F = np.vstack(points), np.vstack(faces)
    eye = np.zeros(len(F), bool)
    eye[len(outer) : len(outer) + eye_faces] = True
    return _tidy(V, F, eye)


def _kind_of(loop, template):
    """ "eye_left", "eye_right", "mouth", "nostril" or None (neck): the feature line that a border loop runs along."""
    members = {
        "eye_left": ("lid_upper_left", "lid_lower_left"),
        "eye_right": ("lid_upper_right", "lid_lower_right"),
        "mouth": ("lip_seam_upper", "lip_seam_lower"),
        "nostril": ("nostril_left", "nostril_right"),
    }
    middle = template.vertices[loop].mean(axis=0)
    best, best_distance = None, 10.0
    for kind, names in members.items():
        groups = [np.concatenate([template.lines[name] for name in names])]
        if kind == "nostril":
            groups = [template.lines[name] for name in names]
        for group in groups:
            distance = np.linalg.norm(template.vertices[group].mean(axis=0) - middle)
            if distance < best_distance:
                best, best_distance = kind, distance
    return best


def _rings(loop_points, center, count):
    """(count - 1, k, 3) copies of a loop, shrunk towards center step by step; the centre itself comes last, apart."""
    shares = np.linspace(1, 0, count + 1)[1:-1]
    return center + shares[:, None, None] * (loop_points - center)


def _ring_faces(loop, count, start):
    """Triangles between a loop of vertices, count - 1 shrunk copies that begin at start, and a centre after them."""
    k = len(loop)
    rings = np.vstack([loop, start + np.arange((count - 1) * k).reshape(count - 1, k)])
    a, b = rings[:-1], rings[1:]
    quads = np.stack([a, np.roll(a, -1, axis=1), np.roll(b, -1, axis=1), b], axis=2).reshape(-1, 4)
    middle = np.full(k, start + (count - 1) * k)
    last = rings[-1]
    fan = np.stack([last, np.roll(last, -1), middle], axis=1)
    faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], fan])
    return faces[:, ::-1]  # a border loop runs against its patch


def eyeball(points):
    """centre (3,) and radius of an eyeball that looks along +Z, from vertices (k, 3) of it; a cap may be missing."""
    low, high = points.min(axis=0), points.max(axis=0)
    radius = float((high - low)[:2].mean() / 2)
    return np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] + radius]), radius


def _eye_patch(loop, vertices, part, start):
    """Points and faces of the bump that the eyeball shows between the lids, met smoothly by the lid margin."""
    center, radius = eyeball(vertices[part.vertex_slice])
    rim = vertices[loop]
    count = EYE_RINGS
    points = np.vstack([_rings(rim, rim.mean(axis=0), count).reshape(-1, 3), rim.mean(axis=0)])

    def surface_z(at):
        """Sclera and cornea (0.65 of the radius, 1.1 mm in front of it) at the places' x and y."""
        off = ((at - center)[:, :2] ** 2).sum(axis=1)
        cornea = 0.65 * radius
        sclera = np.sqrt(np.maximum(radius**2 - off, 0.1 * radius**2))
        return center[2] + np.maximum(sclera, radius + 1.1 - cornea + np.sqrt(np.maximum(cornea**2 - off, 0.0)))

    share = np.repeat(np.linspace(1, 0, count + 1)[1:-1], len(loop)) ** 3
    depth = surface_z(points)
    depth[:-1] += share * np.tile(rim[:, 2] - surface_z(rim), count - 1)
    points[:, 2] = depth
    return points, _ring_faces(loop, count, start)


def _pit(loop, vertices, outer, start):
    """Points and faces of a shallow pit that closes a nostril."""
    rim = vertices[loop]
    normals = vertex_normals(vertices, outer)[loop].mean(axis=0)
    area = np.cross(rim - rim.mean(axis=0), np.roll(rim, -1, axis=0) - rim.mean(axis=0)).sum(axis=0)
    inward = area / max(np.linalg.norm(area), 1e-12)
    inward = inward if inward @ normals < 0 else -inward
    count = NOSTRIL_RINGS
    points = np.vstack([_rings(rim, rim.mean(axis=0), count).reshape(-1, 3), rim.mean(axis=0)])
    share = np.append(np.repeat(np.linspace(1, 0, count + 1)[1:-1], len(loop)), 0.0)
    return points + (NOSTRIL_DEPTH_MM * (1 - share**2))[:, None] * inward, _ring_faces(loop, count, start)


def _zip(loop, vertices, seam):
    """Faces that join the two halves of the mouth's border loop between its corners, short edges first."""
    ends = [int(np.linalg.norm(vertices[loop] - vertices[seam[i]], axis=1).argmin()) for i in (0, -1)]
    turned = np.roll(loop, -ends[0])
    split = (ends[1] - ends[0]) % len(loop)
    first, second = turned[: split + 1], np.append(turned[split:], turned[0])[::-1]
    faces, i, j = [], 0, 0
    while i < len(first) - 1 or j < len(second) - 1:
        grow_first = j == len(second) - 1 or (
            i < len(first) - 1
            and np.linalg.norm(vertices[first[i + 1]] - vertices[second[j]])
            <= np.linalg.norm(vertices[first[i]] - vertices[second[j + 1]])
        )
        if grow_first:
            faces.append((first[i + 1], first[i], second[j]))
            i += 1
        else:
            faces.append((first[i], second[j], second[j + 1]))
            j += 1
    faces = np.array(faces, np.int64)
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
    return faces[distinct]


def _tidy(V, F, eye):
    """Coincident points joined, collapsed and repeated faces and unused points dropped."""
    _, first, inverse = np.unique(np.round(V, 4), axis=0, return_index=True, return_inverse=True)
    F = inverse.reshape(-1)[F]
    distinct = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 0] != F[:, 2])
    _, once = np.unique(np.sort(F, axis=1), axis=0, return_index=True)
    keep = np.zeros(len(F), bool)
    keep[once] = True
    keep &= distinct
    used, F = np.unique(F[keep], return_inverse=True)
    return V[first][used], F.reshape(-1, 3), eye[keep]


class _Warp:
    """Makes what lies far from the face smaller, so that equal triangles there are larger when unmade."""

    def __init__(self, center, radius):
        self.center, self.radius = np.asarray(center, float), float(radius)

    def _scaled(self, points, law):
        local = points - self.center
        r = np.maximum(np.linalg.norm(local, axis=1, keepdims=True), 1e-9)
        return self.center + local * np.where(r > self.radius, self.radius * law(r / self.radius) / r, 1.0)

    def apply(self, points):
        return self._scaled(points, lambda r: 1 + np.log(np.maximum(r, 1.0)))

    def undo(self, points):
        return self._scaled(points, lambda r: np.exp(np.maximum(r, 1.0) - 1))


def remesh(V, F, n_faces, rng, *, focus=(0.0, -35.0, 10.0), radius=95.0):
    """An unrelated triangulation of the same surface: (V', F') with about n_faces, every vertex on the surface.

    Subdivided, its vertices strewn within the surface, and collapsed by edge length to the count asked for; triangles
    are smaller within `radius` mm of `focus`. rng a numpy Generator.
    """
    surface, warp = Surface(V, F), _Warp(focus, radius)
    fine, fine_faces = V, F
    while len(fine_faces) < 5 * n_faces:
        fine, fine_faces = igl.upsample(np.ascontiguousarray(fine), np.ascontiguousarray(fine_faces, dtype=np.int64), 1)
    fine = surface.closest(_strew(fine, fine_faces, rng)).points
    coarse, coarse_faces = warp.apply(fine), fine_faces
    for collapse, count in ((igl.decimate, 2.5 * n_faces), (igl.qslim, n_faces)):
        coarse, coarse_faces, _, _ = collapse(
            np.asfortranarray(coarse), np.asfortranarray(coarse_faces, dtype=np.int32), int(count)
        )
    points = surface.closest(warp.undo(np.asarray(coarse))).points
    coarse_faces = np.asarray(coarse_faces, dtype=np.int64)
    sound = face_areas(points, coarse_faces) > 1e-6
    return points, coarse_faces[sound]


def _strew(V, F, rng, share=0.3):
    """Vertices moved at random within the surface by a share of their shortest edge."""
    edges = F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    length = np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1)
    shortest = np.full(len(V), np.inf)
    np.minimum.at(shortest, edges.ravel(), np.repeat(length, 2))
    shortest[~np.isfinite(shortest)] = 0.0
    step = rng.uniform(-1, 1, V.shape) * shortest[:, None] * share
    normals = vertex_normals(V, F)
    return V + step - (step * normals).sum(axis=1, keepdims=True) * normals


def flipped(V, F, surface):
    """(m,) bool: faces that look away from the surface they lie on."""
    nearest = surface.closest(V[F].mean(axis=1))
    return (face_normals(V, F) * face_normals(surface.vertices, surface.faces)[nearest.faces]).sum(axis=1) < 0
