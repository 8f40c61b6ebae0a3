"""Named regions of a head's skin, found by rule.

Everything is measured from what the head itself shows (eyeballs, the deep inside of the mouth, ears, chin), with
lengths relative to the distance of the eyes, so that the same code serves any template.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from facewright.errors import StageError
from facewright.mesh.adjacency import dilate
from facewright.mesh.closest import Surface
from facewright.mesh.laplacian import uniform_laplacian
from facewright.mesh.normals import face_normals
from facewright.mesh.openness import sphere_directions, vertex_openness
from facewright.mesh.polygons import polygon_edges, triangulated
from facewright.mesh.raster import RayScene
from facewright.solve.quadratic import Factorization
from facewright.template.loops import separating_loop, shortest_path

EYE_DISTANCE_MM = 63.0  # lengths below are for a head whose eyes are this far apart
HAIRLINE = 0.68  # height of the hairline above the eyes, in distances from eyes to chin


@dataclass(frozen=True)
class Head:
    """What the finders of regions and lines look at.

    vertices (n, 3) mm of the skin alone, exactly symmetric; polygons (p, 4); mirror (n,)
    eyes     (2, 3) centres of the left and the right eyeball; eye_radius mm
    mouth    (3,) a point inside the mouth bag (the middle of the tongue)
    balls    (vertices, faces) of the eyeballs, which cast shadows
    """

    vertices: np.ndarray
    polygons: np.ndarray
    mirror: np.ndarray
    eyes: np.ndarray
    eye_radius: float
    mouth: np.ndarray
    balls: tuple[np.ndarray, np.ndarray]

    @property
    def scale(self):
        """This head's size against one whose eyes are EYE_DISTANCE_MM apart."""
        return float(np.linalg.norm(self.eyes[0] - self.eyes[1])) / EYE_DISTANCE_MM

    @property
    def faces(self):
        """(m, 3) triangles of the skin."""
        return triangulated(self.polygons)[0]

    @property
    def midline(self):
        """(n,) bool: the vertex is its own twin."""
        return self.mirror == np.arange(len(self.mirror))


@dataclass(frozen=True)
class Loops:
    """Closed edge loops (k,) of vertices: left lid margin, contact of the lips, rim of the left nostril."""

    lid: np.ndarray
    lips: np.ndarray
    nostril: np.ndarray


def skin_openness(head):
    """(n,) vertex_openness of the skin with the eyeballs in place."""
    balls, ball_faces = head.balls
    n = len(head.vertices)
    return vertex_openness(np.vstack([head.vertices, balls]), np.vstack([head.faces, ball_faces + n]))[:n]


def seen_from_inside(head, center, reach_mm, count=4000):
    """(n,) bool: vertices of triangles whose front a light at center (3,) reaches within reach_mm."""
    directions = sphere_directions(count)
    hits = RayScene(head.vertices, head.faces).cast(np.broadcast_to(center, directions.shape), directions)
    near = (hits.face >= 0) & (hits.distance < reach_mm)
    normals = face_normals(head.vertices, head.faces)[hits.face[near]]
    front = np.einsum("kc,kc->k", normals, directions[near]) < -0.1
    seen = np.zeros(len(head.vertices), bool)
    seen[head.faces[hits.face[near][front]].ravel()] = True
    return seen


def eye_pouch(head):
    """(n,) bool: vertices deep behind the left eyeball's equator."""
    deep = head.vertices[:, 2] < head.eyes[0, 2]
    return seen_from_inside(head, head.eyes[0], 1.6 * head.eye_radius) & deep


def mouth_bag(head):
    """(n,) bool: vertices deep in the mouth."""
    seen = seen_from_inside(head, head.mouth, 90 * head.scale)
    front = head.vertices[seen, 2].max()
    return seen & (head.vertices[:, 2] < front - 15 * head.scale)


def enclosed(polygons, n, wall, seeds):
    """(n,) bool: vertices that can be reached along polygon edges from seeds (n,) bool without touching wall (k,)."""
    edges = polygon_edges(polygons)
    free = np.ones(n, bool)
    free[wall] = False
    edges = edges[free[edges].all(axis=1)]
    graph = sp.coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    labels = connected_components(graph, directed=False)[1]
    return free & np.isin(labels, np.unique(labels[seeds & free]))


def skin_regions(head, openness, loops, lines):
    """name -> (n,) bool: the canonical regions of the skin, all but `skull`; docs/template.md says what each means."""
    n, scale = len(head.vertices), head.scale
    inner = _interiors(head, loops)
    outer = ~np.any(list(inner.values()), axis=0)
    red_upper, red_lower = (_lip_red(head, outer, loops, lines, lip) for lip in ("upper", "lower"))
    ear_left = _left_ear(head, outer)
    ear_right = ear_left[head.mirror]
    ears = ear_left | ear_right
    below = outer & ~ears & _below_jaw(head, lines, ear_left)
    face = outer & ~ears & ~below & (head.vertices[:, 2] > head.vertices[ear_left, 2].max())
    face &= head.vertices[:, 1] < _hairline(head, lines)
    lids = np.concatenate([loops.lid, head.mirror[loops.lid]])
    return {
        "skin": np.ones(n, bool),
        "outer": outer,
        "face": face,
        "lips": outer & near(head.vertices, red_upper | red_lower, 5 * scale),
        "eyes": outer & near(head.vertices, lids, 12 * scale),
        "nostrils": inner["nostrils"],
        "mouth_interior": inner["mouth_interior"],
        "socket_left": inner["socket_left"],
        "socket_right": inner["socket_right"],
        "ear_left": ear_left,
        "ear_right": ear_right,
        "neck": below,
        "scalp": outer & ~below & ~ears & ~face,
        "lip_upper": red_upper,
        "lip_lower": red_lower,
    }


def near(vertices, chosen, radius):
    """(n,) bool: vertices within radius mm of chosen ones (mask or indices)."""
    return cKDTree(vertices[chosen]).query(vertices, distance_upper_bound=radius)[0] < radius


def _interiors(head, loops):
    """Masks behind the lid margins, the lip contact and the nostril rims; the loops themselves are outside."""
    n, polygons = len(head.vertices), head.polygons
    socket = enclosed(polygons, n, loops.lid, eye_pouch(head))
    mouth = enclosed(polygons, n, loops.lips, mouth_bag(head))
    nostril = smaller_side(polygons, n, loops.nostril)
    return {
        "socket_left": socket,
        "socket_right": socket[head.mirror],
        "mouth_interior": mouth,
        "nostrils": nostril | nostril[head.mirror],
    }


def smaller_side(polygons, n, loop):
    """(n,) bool: the vertices on the side of a closed loop that has fewer of them, without the loop."""
    all_but = enclosed(polygons, n, loop, np.ones(n, bool))
    edges = polygon_edges(polygons)
    edges = edges[all_but[edges].all(axis=1)]
    graph = sp.coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    labels = connected_components(graph, directed=False)[1]
    beside = np.unique(labels[all_but & dilate(~all_but, triangulated(polygons)[0])])
    sizes = np.bincount(labels, minlength=labels.max() + 1)
    biggest = beside[np.argmax(sizes[beside])]
    return all_but & np.isin(labels, beside[beside != biggest])


def _lip_red(head, outer, loops, lines, lip):
    """(n,) bool: the red of one lip with its borders; without a line for the border, 8 mm around the seam."""
    n = len(head.vertices)
    seam, border = lines[f"lip_seam_{lip}"], lines.get(f"lip_outer_{lip}")
    if border is None:
        return outer & near(head.vertices, seam, 8 * head.scale)
    other = lines["lip_outer_lower" if lip == "upper" else "lip_outer_upper"]
    corners = [shortest_path(head.vertices, head.polygons, [seam[end], border[end]]) for end in (0, -1)]
    middle = np.zeros(n, bool)
    middle[seam[len(seam) // 2]] = True
    start = dilate(middle, head.faces) & outer
    red = outer & enclosed(head.polygons, n, np.concatenate([loops.lips, border, other, *corners]), start)
    red[seam] = red[border] = True
    return red


def _left_ear(head, outer):
    """(n,) bool: what stands more than 2.5 mm out of a thin plate spanned over the side of the head."""
    v, scale = head.vertices, head.scale
    band = outer & (v[:, 1] < head.eyes[0, 1] + 25 * scale) & (v[:, 1] > head.mouth[1] - 25 * scale)
    band &= v[:, 2] < head.eyes[0, 2] - 30 * scale
    if not band.any():
        raise StageError("template", "no_ear", "no skin beside the head where ears are")
    tip = np.flatnonzero(band)[np.argmax(v[band, 0])]
    # The middle of the ear: what is nearly as far out as its outermost point.
    center = v[band & (v[:, 0] > v[tip, 0] - 14 * scale)].mean(axis=0)
    disc = outer & (np.linalg.norm(v - center, axis=1) < 46 * scale) & (v[:, 0] > 0)
    plate = Surface(_thin_plate(v, head.faces, disc), head.faces[disc[head.faces].any(axis=1)])
    standing = disc.copy()
    standing[disc] = plate.closest(v[disc]).distance > 2.5 * scale
    standing = enclosed(head.polygons, len(v), np.flatnonzero(~standing), np.arange(len(v)) == tip)
    inside = polygons_within(standing, head.polygons)
    outside = polygons_within(np.linalg.norm(v - center, axis=1) > 46 * scale, head.polygons)
    root = separating_loop(v, head.polygons, inside, outside)
    return outer & (enclosed(head.polygons, len(v), root, standing) | np.isin(np.arange(len(v)), root))


def polygons_within(mask, polygons):
    """(p,) bool: polygons all of whose corners are in a vertex mask."""
    return (mask[polygons] | (polygons < 0)).all(axis=1)


def _thin_plate(vertices, faces, inside):
    """vertices with those inside replaced by a plate that continues the surface around them smoothly."""
    L = uniform_laplacian(faces, len(vertices)).tocsr()
    B = (L @ L).tocsr()
    index, rest = np.flatnonzero(inside), np.flatnonzero(~inside)
    filled = vertices.copy()
    filled[index] = Factorization(B[index][:, index]).solve(-(B[index][:, rest] @ vertices[rest]))
    return filled


def midline_profile(head, start):
    """(k,) midline vertices from start outwards, downwards over chin and neck to the border."""
    edges = polygon_edges(head.polygons)
    edges = edges[head.midline[edges].all(axis=1)]
    neighbours = {}
    for a, b in edges.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    walk, previous = [int(start)], None
    options = neighbours.get(walk[0], [])
    step = max(options, key=lambda b: head.vertices[b, 2], default=None)
    while step is not None and step not in walk:
        walk.append(step)
        previous = walk[-2]
        step = next((b for b in neighbours[step] if b != previous), None)
    return np.array(walk)


def chin_points(head, lines):
    """(menton (3,), fold (3,)): the lowest point of the chin, and the fold where chin and neck meet."""
    seam = lines["lip_seam_lower"]
    profile = head.vertices[midline_profile(head, seam[len(seam) // 2])]
    profile = profile[profile[:, 1] > head.mouth[1] - 95 * head.scale]
    # The chin is furthest forward and somewhat down; the fold lies deepest behind the chord from there to the neck.
    chin = int(np.argmax(profile @ np.array([0.0, -0.4, 0.92])))
    behind = profile[chin:]
    chord = behind[-1] - behind[0]
    off = behind - behind[0] - np.outer((behind - behind[0]) @ chord / (chord @ chord), chord)
    return profile[chin], behind[int(np.argmax(np.linalg.norm(off, axis=1)))]


def _below_jaw(head, lines, ear_left):
    """(n,) bool: below the plane through the fold under the chin and the lobes; behind them, below the lobes."""
    _, fold = chin_points(head, lines)
    v = head.vertices
    lobe = v[ear_left][np.argmin(v[ear_left, 1])]
    slope = (fold[1] - lobe[1]) / (fold[2] - lobe[2])
    return v[:, 1] < lobe[1] + slope * np.maximum(v[:, 2] - lobe[2], 0.0)


def _hairline(head, lines):
    """Height y of the hairline over the forehead."""
    eyes = head.eyes[:, 1].mean()
    return eyes + HAIRLINE * (eyes - chin_points(head, lines)[0][1])


def still_region(deltas, threshold_mm=0.01):
    """(n,) bool: vertices that no shape of deltas (s, n, 3) moves."""
    return np.abs(deltas).max(axis=(0, 2)) < threshold_mm
