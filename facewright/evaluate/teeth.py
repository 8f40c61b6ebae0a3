"""Teeth, gums and tongue of a rig: how many teeth a smile shows, whether anything pokes through the skin, and how the
tongue leaves the mouth. By rays from the front and the sides, as a viewer would see it."""

from __future__ import annotations

from itertools import pairwise

import igl
import numpy as np
from scipy.ndimage import binary_opening

from facewright.conventions import MOUTH_PAIRS, SHUT_PAIRS, SHUT_SHAPES
from facewright.evaluate.play import Player, both_sides
from facewright.evaluate.rows import Row
from facewright.evaluate.shapes import shape_names
from facewright.mesh.adjacency import vertex_components
from facewright.mesh.closest import Surface
from facewright.mesh.polyline import arc_lengths
from facewright.mesh.raster import Camera, RayScene

INSIDE = ("teeth_", "gums_", "tongue")
VIEWS = ((0.0, 0.0), (-40.0, 0.0), (40.0, 0.0), (0.0, -25.0))
SMILE = {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0, "jawOpen": 0.3}
TONGUE = {"tongueOut": 1.0, "jawOpen": 0.5}
TEETH_BAR, TONGUE_BAR_MM, POKE_BAR_MM2, SLIT_BAR_MM2 = 6, 0.5, 0.5, 2.0
SEEN_MM2 = 4.0  # a tooth counts as shown from this much of it on
_STILL_MM = 0.05
_MM_PER_PIXEL, _HALF_MM = 0.5, 45.0
_SLIT_MM_PER_PIXEL = 0.25  # a slit twice as high is the least that is seen
_LIPS_MM = 1.0  # a ray that meets something this little before it passes the lips has not been stopped by them


def mouth_pairs():
    """name -> weights of the pairs of shapes that mouths must survive."""

    def both(name):
        return {f"{name}Left": 1.0, f"{name}Right": 1.0}

    return {
        "smile + jawOpen": both("mouthSmile") | {"jawOpen": 1.0},
        "smile + funnel": both("mouthSmile") | {"mouthFunnel": 1.0},
        "funnel + pucker": {"mouthFunnel": 1.0, "mouthPucker": 1.0},
        "frown + press": both("mouthFrown") | both("mouthPress"),
        "rollUpper + rollLower": {"mouthRollUpper": 1.0, "mouthRollLower": 1.0},
        "shrugUpper + shrugLower": {"mouthShrugUpper": 1.0, "mouthShrugLower": 1.0},
    }


def measure_mouth(rig):
    """dict of a rig's mouth, as a right runtime plays it and (plain) without in-betweens and correctives.

    teeth_shown       (full, plain) upper teeth of which 4 mm2 or more are seen from the front at smile + jawOpen 0.3
    tongue_in_lips_mm (full, plain) of the deepest tongue vertex inside the flesh at tongueOut + jawOpen 0.5
    tongue_out_mm     how far the tip lies before the lips there
    through_skin_mm2  pose -> largest area of teeth, gums, tongue or lining seen past the lips rather than between them;
                      every single shape that moves the mouth, and mouth_pairs; a tongue that is out is left out
    slit_mm2          pose -> area of what lies behind the lips that is seen between them from the front, in shut_poses
    teeth_moved_mm    most that an upper tooth moves under any target
    """
    singles = shape_names(rig)
    poses = {name: _with_jaw(name) for name in singles} | mouth_pairs()
    through = {}
    for name, weights in poses.items():
        if set(weights) <= set(singles) and _moves_mouth(rig, weights):
            through[name] = _Mouth(rig, weights, True).through_skin_mm2()
    upper = [mesh for mesh in rig.meshes if mesh.name in ("teeth_upper", "gums_upper") and mesh.deltas is not None]
    smile = [_Mouth(rig, _known(SMILE, rig), full) for full in (True, False)]
    tongue = [_Mouth(rig, _known(TONGUE, rig), full) for full in (True, False)]
    return {
        "teeth_shown": tuple(mouth.teeth_shown() for mouth in smile),
        "tongue_in_lips_mm": tuple(mouth.tongue_in_flesh_mm() for mouth in tongue),
        "tongue_out_mm": tongue[0].tongue_out_mm(),
        "through_skin_mm2": through,
        "slit_mm2": {name: _Mouth(rig, weights, True).slit_mm2() for name, weights in shut_poses(rig).items()},
        "teeth_moved_mm": max((float(np.abs(mesh.deltas).max()) for mesh in upper), default=0.0),
    }


def teeth_rows(rig):
    """Rows (rows.Row) of teeth, gums and tongue for `facewright evaluate rig`; none for a rig without them."""
    if not any(mesh.name.startswith(INSIDE) for mesh in rig.meshes) or rig.meshes[0].deltas is None:
        return []
    found = measure_mouth(rig)
    through = found["through_skin_mm2"]
    worst = max(through, key=through.get, default="")
    smile, tongue = "smile + jawOpen 0.3", "tongueOut + jawOpen 0.5"
    rows = [Row("teeth", worst, "through the skin mm2", through.get(worst, 0.0), bar=(None, POKE_BAR_MM2))]
    for pose, area in found["slit_mm2"].items():
        rows.append(Row("lips", pose, "slit seen mm2", area, bar=(None, SLIT_BAR_MM2)))
    rows.append(Row("teeth", "any", "upper teeth move mm", found["teeth_moved_mm"], bar=(None, 0.0)))
    if set(SMILE) <= set(rig.target_names):
        rows.append(Row("teeth", smile, "upper teeth shown", *found["teeth_shown"], bar=(TEETH_BAR, None)))
    if set(TONGUE) <= set(rig.target_names):
        rows.append(Row("tongue", tongue, "in the lips mm", *found["tongue_in_lips_mm"], bar=(None, TONGUE_BAR_MM)))
        rows.append(Row("tongue", tongue, "before the lips mm", found["tongue_out_mm"], bar=(0.0, None)))
    return rows


def shut_poses(rig):
    """name -> weights of the poses of a rig under which lips that are shut stay shut."""
    names = shape_names(rig)
    single = ((name,) for name in SHUT_SHAPES)
    pairs = (pair for pair in MOUTH_PAIRS if set(pair) <= set(SHUT_SHAPES))
    poses = {" + ".join(pose): dict.fromkeys(pose, 1.0) for pose in (*single, *pairs, *SHUT_PAIRS)}
    found = {name: both_sides(weights, names) for name, weights in poses.items()}
    return {name: weights for name, weights in found.items() if weights is not None}


def _with_jaw(name):
    """Weights of a single shape; mouthClose means something with an open jaw only."""
    return {name: 1.0} | ({"jawOpen": 1.0} if name == "mouthClose" else {})


def _known(weights, rig):
    return {name: weight for name, weight in weights.items() if name in rig.target_names}


def _moves_mouth(rig, weights):
    """Whether any of some shapes moves the lips or what lies behind them."""
    lips = rig.regions["lips"]
    targets = [rig.target_names.index(name) for name in weights]
    moved = [
        mesh.deltas[targets] for mesh in rig.meshes[1:] if mesh.name.startswith(INSIDE) and mesh.deltas is not None
    ]
    moved.append(rig.meshes[0].deltas[targets][:, lips])
    return max(float(np.abs(deltas).max()) for deltas in moved) > _STILL_MM


class _Mouth:
    """A rig in one pose, seen from VIEWS around the mouth."""

    def __init__(self, rig, weights, full):
        play = Player(rig, full)
        self.rig = rig
        meshes = [mesh for mesh in rig.meshes if mesh is rig.meshes[0] or mesh.name.startswith(INSIDE)]
        self.names = [mesh.name for mesh in meshes]
        # The last entry is for rays that meet nothing: their face is -1, and so is its number.
        self.may_pass = np.array([name == "tongue" and "tongueOut" in weights for name in self.names] + [True])
        self.posed = [play(mesh, weights) for mesh in meshes]
        self.meshes = meshes
        start = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
        self.faces = np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, start)])
        self.first_face = np.cumsum([0] + [len(mesh.faces) for mesh in meshes])
        self.scene = RayScene(np.concatenate(self.posed), self.faces)
        self.lining = np.zeros(len(self.faces) + 1, bool)  # the last is for rays that meet nothing
        self.lining[: self.first_face[1]] = rig.regions["mouth_interior"][meshes[0].faces].all(axis=1)
        self.upper, self.lower = (self.posed[0][rig.lines[f"lip_seam_{lip}"]] for lip in ("upper", "lower"))
        self.center = np.concatenate([self.upper, self.lower]).mean(axis=0)

    def _seen(self, view, mm_per_pixel=_MM_PER_PIXEL):
        """Rays (origins, directions) of a view and what they meet first."""
        pixels = round(2 * _HALF_MM / mm_per_pixel)
        camera = Camera.looking_at(self.center, *view, _HALF_MM, (pixels, pixels))
        origins, directions = camera.rays()
        return origins, directions, self.scene.cast(origins, directions)

    def teeth_shown(self):
        """Upper teeth seen from the front."""
        if "teeth_upper" not in self.names:
            return 0
        number = self.names.index("teeth_upper")
        mesh = self.meshes[number]
        tooth = vertex_components(mesh.faces, len(mesh.vertices))[mesh.faces[:, 0]]
        _, _, hits = self._seen(VIEWS[0])
        local = hits.face - self.first_face[number]
        mine = local[(hits.face >= 0) & (local >= 0) & (local < len(mesh.faces))]
        return int((np.bincount(tooth[mine]) * _MM_PER_PIXEL**2 >= SEEN_MM2).sum()) if len(mine) else 0

    def through_skin_mm2(self):
        """Largest area, over the views, of inner parts met by rays that have not passed between the lips."""
        opening = _strip(self.upper, self.lower)
        most = 0.0
        for view in VIEWS:
            origins, directions, hits = self._seen(view)
            number = np.searchsorted(self.first_face, hits.face, side="right") - 1
            inner = np.flatnonzero(((number > 0) | self.lining[hits.face]) & ~self.may_pass[number])
            if len(inner):
                gate = RayScene(*opening).cast(origins[inner], directions[inner])
                passed = (gate.face >= 0) & (gate.distance < hits.distance[inner] + _LIPS_MM)
                outside = np.zeros(len(origins), bool)
                outside[inner] = ~passed
                side = round(np.sqrt(len(origins)))
                # A row of pixels along the lips' outline says nothing: there a ray grazes both.
                patches = binary_opening(outside.reshape(side, side), np.ones((2, 2)))
                most = max(most, float(patches.sum()) * _MM_PER_PIXEL**2)
        return most

    def slit_mm2(self):
        """Area of the inner mouth and what it holds that is seen from the front."""
        hits = self._seen(VIEWS[0], _SLIT_MM_PER_PIXEL)[2]
        inner = np.array(self.lining)
        inner[self.first_face[1] : -1] = True
        side = round(np.sqrt(len(hits.face)))
        seen = binary_opening(inner[hits.face].reshape(side, side), np.ones((2, 2)))
        return float(seen.sum()) * _SLIT_MM_PER_PIXEL**2

    def tongue_in_flesh_mm(self):
        """Depth of the deepest tongue vertex between the outer skin and the mouth bag, the root apart."""
        if "tongue" not in self.names:
            return 0.0
        number = self.names.index("tongue")
        rest = self.meshes[number].vertices
        front = rest[:, 2] > rest[:, 2].min() + 0.4 * np.ptp(rest[:, 2])
        points = np.ascontiguousarray(self.posed[number][front])
        V, F = np.ascontiguousarray(self.posed[0]), np.ascontiguousarray(self.rig.meshes[0].faces)
        inside = np.asarray(igl.fast_winding_number(V, F, points)).reshape(-1) > 0.5
        return float(Surface(V, F).closest(points[inside]).distance.max()) if inside.any() else 0.0

    def tongue_out_mm(self):
        """How far the foremost point of the tongue lies before the foremost point of the lips' line."""
        if "tongue" not in self.names:
            return 0.0
        tip = self.posed[self.names.index("tongue")][:, 2].max()
        return float(tip - max(self.upper[:, 2].max(), self.lower[:, 2].max()))


def _strip(upper, lower):
    """Vertices and faces of the surface between the lips' lines (k, 3); the lines may differ in length."""
    share = np.linspace(0, 1, 40)
    rows = [np.stack([np.interp(share, _along(line), line[:, c]) for c in range(3)], axis=1) for line in (upper, lower)]
    n = len(share)
    faces = [face for a, b in pairwise(range(n)) for face in ((a, b, n + b), (a, n + b, n + a))]
    return np.concatenate(rows), np.array(faces)


def _along(line):
    steps = arc_lengths(line)
    return steps / max(steps[-1], 1e-12)
