"""How lips, teeth and jaw of a rig get on: as a right runtime plays it, and with the plain shapes alone."""

from __future__ import annotations

import igl
import numpy as np
from scipy.spatial import cKDTree

from facewright.conventions import MOUTH_PAIRS
from facewright.evaluate.quality import lip_gaps_mm
from facewright.evaluate.rows import Row
from facewright.expand import expand_weights
from facewright.mesh.adjacency import border_vertices, touching
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import lengths, vertex_normals
from facewright.mesh.seam import seam_sides
from facewright.mesh.winding import winding_numbers

WEIGHTS = (0.25, 0.5, 0.75, 1.0)
CROSSING_BAR_MM, TEETH_BAR_MM, CLOSE_BAR_MM = 0.3, 0.3, 0.5
BARS_MM = {"crossing_mm": CROSSING_BAR_MM, "teeth_mm": TEETH_BAR_MM, "through_mm": 0.0}
FIGURES = {"crossing_mm": "lip in lip mm", "teeth_mm": "lip in teeth mm", "through_mm": "tooth through skin mm"}
LIP_GAP_BAR_MM = 0.3
LIP_REACH_MM = 12.0  # along the skin from the seam, outwards and inwards: what counts as lip
FACE_MM = 45.0  # from the seam: skin that teeth could stand out of
MOST_MM = 8.0  # nothing crosses deeper: what seems to has met the other lip from behind
MOVES_MM = 0.1  # of a lip: less brings nothing 0.3 mm into what it does not enter at rest
APEX_MM = 80.0
_OFF_MM = 0.02  # a vertex is asked about this far in front of its own surface, so that this does not count
SIDED = ("Left", "Right")


def mouth_pairs():
    """name -> weights of the pairs that lips must survive; shapes without their side stand for both sides."""
    return {f"{a} + {b}": {a: 1.0, b: 1.0} for a, b in MOUTH_PAIRS}


def mouth_poses(rig, at=WEIGHTS):
    """name -> weights of all poses of the mouth: each shape that moves lips at several weights, sides apart and
    together, then the pairs. mouthClose is made for an open jaw and comes with it."""
    poses = {}
    skin = rig.meshes[0]
    lips = rig.regions["lips"]
    names = rig.plain().target_names
    moving = [n for n in names if np.abs(skin.deltas[rig.target_names.index(n), lips]).max(initial=0.0) > MOVES_MM]
    both = [n.removesuffix("Left") for n in moving if n.endswith("Left") and n.startswith("mouth") and len(n) > 9]
    for name in [*moving, *both]:
        for weight in at:
            weights = {name: weight}
            if name == "mouthClose":
                weights["jawOpen"] = weight
            poses[f"{name} {weight:g}"] = weights
    pairs = {name: weights for name, weights in mouth_pairs().items() if _both_sides(weights, names) is not None}
    return {name: _both_sides(weights, names) for name, weights in (poses | pairs).items()}


def _both_sides(weights, names):
    """Weights with every shape that has no name of its own played on both sides; None if the rig lacks one."""
    found = {}
    for name, weight in weights.items():
        mine = [name] if name in names else [name + side for side in SIDED]
        if not set(mine) <= set(names):
            return None
        found |= dict.fromkeys(mine, weight)
    return found


def measure_mouth(rig, poses=None, plain=True):
    """dict: "lip_gap_mm" of the neutral, "mouth_close_gap_mm", "upper_teeth_moved_mm", "neck_moved_mm" and "poses".

    poses name -> {"crossing_mm", "teeth_mm", "through_mm"}, each a pair (with in-betweens and correctives, plain 52);
    without plain only the first of the two
    crossing_mm  depth of the deepest vertex of a lip inside the other lip
    teeth_mm     depth of the deepest vertex of a lip inside the teeth
    through_mm   how far a tooth stands out of the outer skin, beyond the red of the lips
    mouth_close_gap_mm  largest distance of paired seam points at jawOpen 1 + mouthClose 1 (a pair as above)
    """
    mouth = _Mouth(rig)
    poses = mouth_poses(rig) if poses is None else poses
    columns = (True, False) if plain else (True,)
    result = {
        "lip_gap_mm": float(lip_gaps_mm(mouth.skin.vertices, rig.lines).max()),
        "upper_teeth_moved_mm": _moved(rig, "teeth_upper"),
        "neck_moved_mm": mouth.moved("neck_ring"),
        "poses": {},
    }
    closed = {"jawOpen": 1.0, "mouthClose": 1.0}
    if set(closed) <= set(rig.target_names):
        gaps = [lip_gaps_mm(mouth.posed(mouth.skin, closed, full), rig.lines).max() for full in columns]
        result["mouth_close_gap_mm"] = tuple(map(float, gaps))
    for name, weights in poses.items():
        pairs = zip(*(mouth.figures(weights, full) for full in columns))
        result["poses"][name] = dict(zip(("crossing_mm", "teeth_mm", "through_mm"), pairs))
    return result


def mouth_rows(rig):
    """Rows of measure_mouth beside their bars, each shape at its worst on the way to 1."""
    found = measure_mouth(rig)
    rows = [
        Row("mouth", "neutral", "lip gap mm", found["lip_gap_mm"], bar=(None, LIP_GAP_BAR_MM)),
        Row("mouth", "any", "upper teeth move mm", found["upper_teeth_moved_mm"], bar=(None, MOVES_MM)),
        Row("mouth", "any", "neck ring moves mm", found["neck_moved_mm"], bar=(None, MOVES_MM)),
    ]
    if "mouth_close_gap_mm" in found:
        gaps = found["mouth_close_gap_mm"]
        rows.append(Row("mouth", "jawOpen + mouthClose", "lip gap mm", *gaps, bar=(None, CLOSE_BAR_MM)))
    for pose, figures in worst_on_the_way(found["poses"]).items():
        for key, bar in BARS_MM.items():
            rows.append(Row("mouth", pose, FIGURES[key], *figures[key], bar=(None, bar)))
    return rows


def worst_on_the_way(poses):
    """Poses of one shape ("mouthSmile 0.5") as one, with the worst figure at any weight."""
    result: dict[str, dict[str, tuple]] = {}
    for pose, figures in poses.items():
        name, _, weight = pose.rpartition(" ")
        known = result.setdefault(name if weight.replace(".", "").isdigit() else pose, {})
        for key, values in figures.items():
            known[key] = tuple(map(max, zip(known.get(key, values), values)))
    return result


def lip_crossing(rig):
    """A function: skin of a pose (n, 3) -> depth in mm of the deepest lip vertex inside the other lip."""
    return _Mouth(rig).crossing


def _moved(rig, part):
    """Largest motion of a mesh under any target, mm."""
    meshes = [mesh for mesh in rig.meshes if mesh.name == part and mesh.deltas is not None]
    return float(max((np.linalg.norm(mesh.deltas, axis=2).max() for mesh in meshes), default=0.0))


class _Mouth:
    """The lips of a rig, what lies behind them, and its teeth."""

    def __init__(self, rig):
        self.rig, self.skin = rig, rig.meshes[0]
        V, F = self.skin.vertices, self.skin.faces
        seams = rig.lines["lip_seam_upper"], rig.lines["lip_seam_lower"]
        self.sides = seam_sides(V, F, *seams, LIP_REACH_MM, split_ends=False)
        self.patches = [F[side[F].all(axis=1)] for side in self.sides]
        self.rims = [border_vertices(patch, len(V)) for patch in self.patches]
        self.lips = np.flatnonzero(self.sides[0] | self.sides[1])
        near = cKDTree(V[np.concatenate(seams)]).query(V)[0] < FACE_MM
        self.around = F[near[F].all(axis=1)]
        # What the normals of the lips, and of all that is around them, depend on.
        self._about_lips = F[touching(self.sides[0] | self.sides[1], F)]
        self._about = F[touching(near, F)]
        self.closed = _coned(self.around, len(V))
        self.apex = V[np.concatenate(seams)].mean(axis=0) - [0.0, 0.0, APEX_MM]
        self.teeth = [mesh for mesh in rig.meshes if mesh.name.startswith("teeth")]
        self.beyond = rig.regions["outer"] & ~rig.regions["lip_upper"] & ~rig.regions["lip_lower"]
        self.entered = np.full(len(V), np.inf)  # mm, at rest
        self.entered = self.depths(V)

    def moved(self, line):
        """Largest motion of a line under any target, mm."""
        return float(np.linalg.norm(self.skin.deltas[:, self.rig.lines[line]], axis=2).max())

    def posed(self, mesh, weights, full):
        """(n, 3) a mesh under pose weights, with in-betweens and correctives or without."""
        if mesh.deltas is None:
            return mesh.vertices
        if full:
            weights = expand_weights(weights, self.rig.in_betweens, self.rig.correctives)
        number = self.rig.target_names.index
        return mesh.vertices + sum(weight * mesh.deltas[number(name)] for name, weight in weights.items())

    def figures(self, weights, full):
        """crossing, teeth and through in mm of one pose."""
        skin = self.posed(self.skin, weights, full)
        teeth = [(self.posed(mesh, weights, full), mesh.faces) for mesh in self.teeth]
        return self.crossing(skin), self.in_teeth(skin, teeth), self.through(skin, teeth)

    def crossing(self, skin):
        """Depth in mm of the deepest lip vertex of a pose (n, 3) inside the other lip."""
        return float(self.depths(skin).max())

    def depths(self, skin):
        """(n,) depth in mm of the lips' vertices in a pose (n, 3) inside the other lip, 0 for what is not.

        The lining of a lip has the other one's skin before it at a corner, at rest and in any pose. Nothing lies deeper
        in the other lip than at rest and by as much as the two have moved against each other.
        """
        rest, normals = self.skin.vertices, vertex_normals(skin, self._about_lips)
        result = np.zeros(len(skin))
        for side, patch, rim in zip(self.sides, self.patches[::-1], self.rims[::-1]):
            index = np.flatnonzero(side)
            found = Surface(skin, patch).closest(skin[index])
            normal = interpolate(normals, patch, found.faces, found.barycentric)
            way, depth = skin[index] - found.points, found.distance
            maybe = ((way * normal).sum(axis=1) < 0) & (depth > 0.5 * CROSSING_BAR_MM) & (depth < MOST_MM)
            maybe &= ~(rim[patch[found.faces]] & (found.barycentric > 1e-6)).any(axis=1)
            before = rest[index] - interpolate(rest, patch, found.faces, found.barycentric)
            maybe &= depth < self.entered[index] + lengths(way - before) + 0.5 * CROSSING_BAR_MM
            asked = index[maybe]
            turns = winding_numbers(self.with_apex(skin), self.closed, skin[asked] + _OFF_MM * normals[asked])
            result[asked] = np.where(turns > 0.5, depth[maybe], 0.0)
        return result

    def with_apex(self, skin):
        """(n + 1, 3) the skin and, deep in the head, the point of the cone that closes the mouth's surroundings."""
        return np.vstack([skin, self.apex])

    def in_teeth(self, skin, teeth):
        """Depth in mm of the deepest vertex of a lip inside the teeth [(vertices, faces)]."""
        deepest = 0.0
        for vertices, faces in teeth:
            points = skin[self.lips]
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            points = points[((points > low) & (points < high)).all(axis=1)]
            points = points[_inside(vertices, faces, points)]
            if len(points):
                deepest = max(deepest, Surface(vertices, faces).closest(points).distance.max())
        return float(deepest)

    def through(self, skin, teeth):
        """How far in mm teeth stand out of the skin of a pose, beyond the red of the lips."""
        farthest = 0.0
        surface, normals = Surface(skin, self.around), vertex_normals(skin, self._about)
        for vertices, _ in teeth:
            found = surface.closest(vertices)
            normal = interpolate(normals, self.around, found.faces, found.barycentric)
            out = ((vertices - found.points) * normal).sum(axis=1) > 0
            out &= self.beyond[self.around[found.faces]].all(axis=1)
            farthest = max(farthest, found.distance[out].max(initial=0.0))
        return float(farthest)


def _coned(faces, apex):
    """Faces (m + b, 3) of an open patch (m, 3) and the cone from its border to a vertex: a closed surface.

    A winding number on it costs a tenth of the whole skin's, and near the lips it is the same.
    """
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = int(faces.max()) + 1
    there, back = directed[:, 0] * size + directed[:, 1], directed[:, 1] * size + directed[:, 0]
    border = directed[~np.isin(there, back)]
    return np.concatenate([faces, np.column_stack([border[:, ::-1], np.full(len(border), apex)])])


def _inside(vertices, faces, points):
    """(k,) bool: points (k, 3) inside a closed mesh, by winding number."""
    if not len(points):
        return np.zeros(0, bool)
    arrays = (np.ascontiguousarray(a) for a in (vertices, faces, points))
    return np.asarray(igl.fast_winding_number(*arrays)).reshape(-1) > 0.5
