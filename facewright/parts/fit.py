"""All parts of a head placed for a person, and the skeleton that carries them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import igl
import numpy as np
from scipy.spatial import cKDTree

from facewright.data import Skeleton
from facewright.mesh.closest import Surface
from facewright.mesh.raster import RayScene
from facewright.parts.eyes import LidOptions, eye_radius, fit_lids, moved_to, place_eyeball
from facewright.solve.procrustes import best_similarity
from facewright.transfer.eyeball import carried_eyeball
from facewright.transfer.riders import LidRiders

_MOUTH_REACH_MM = 18.0  # skin this near to the teeth says where they belong
_JOINT_REACH_MM = 35.0
_FRONT_TEETH_MM = 10.0  # from the foremost tooth backwards: incisors and canines
_NEIGHBOURS = 12


@dataclass(frozen=True)
class PartOptions:
    """lids           how lids meet the eyeballs
    mouth_scale    least and most that teeth and tongue are scaled: teeth vary less than faces
    most_back_mm   how far teeth may be moved back when they would stand in the lips
    poke_mm        how much deeper than in the template a tooth may stand in the flesh
    show_share     how much more of the teeth than in the template may be seen from the front at rest
    """

    lids: LidOptions = field(default_factory=LidOptions)
    mouth_scale: tuple[float, float] = (0.85, 1.2)
    most_back_mm: float = 4.0
    poke_mm: float = 0.3
    show_share: float = 0.01


def fit_parts(face, options=None, irises=None):
    """The Face with every part in its place: eyes and lids first, then teeth and tongue, then what hangs on the skin.

    face    data.Face; its skin decides, whatever its other vertices say
    irises  side -> iris_scan.Iris of the eyes that the scan shows: there the rig's lie, of that colour
    returns data.Face with new vertices; stats gain "parts"
    """
    options = options or PartOptions()
    template = face.template
    V = np.array(face.vertices)
    irises = irises or {}
    stats = {}
    radius = eye_radius(template, V, face.lines)
    for side in ("left", "right"):
        seen = irises[side].center if side in irises else None
        ball = place_eyeball(template, V, face.lines, side, radius, options.lids, seen)
        V, lids = fit_lids(template, V, face.regions, face.lines, side, ball, options.lids)
        for name, placed in moved_to(template, side, ball).items():
            V[template.part(name).vertex_slice] = placed
        stats[f"eye_{side}"] = {"radius_mm": ball.radius, "center_mm": ball.center.tolist(), **lids}
        if side in irises:
            pupil = ball.center + ball.radius * ball.axis
            stats[f"eye_{side}"]["iris_off_mm"] = float(np.linalg.norm(irises[side].center - pupil[:2]))
    if irises:
        stats["iris_color"] = np.mean([iris.lit_color for iris in irises.values()], axis=0).tolist()
        stats["eye_light"] = float(np.mean([iris.light for iris in irises.values()]))
        stats["eye_white"] = float(np.mean([iris.whiteness for iris in irises.values()]))
    mouth = [part for part in template.parts if part.attach in ("skull", "jaw")]
    if mouth:
        V, stats["mouth"] = _fit_mouth(template, V, face.lines, mouth, options)
    for part in template.parts[1:]:
        if part.attach == "skin":
            V[part.vertex_slice] = _carried(template, V, part)
    for side in ("left", "right"):
        riders = LidRiders(template, side)
        if len(riders.index):
            V[riders.index] = riders.placed(V, carried_eyeball(template, V, side))
    return replace(face, vertices=V, stats=face.stats | {"parts": stats})


def fit_skeleton(template, vertices):
    """The template's Skeleton moved to a person's joints: eyes to their balls, the rest with the skin around.

    vertices (n, 3) as fit_parts leaves them
    """
    skin = template.skin.vertex_slice
    positions = []
    for name, joint in zip(template.skeleton.names, template.skeleton.positions):
        if name.startswith("eye_"):
            part = template.part(name).vertex_slice
            R, scale, t = best_similarity(template.vertices[part], vertices[part])
        else:
            distance = np.linalg.norm(template.vertices[skin] - joint, axis=1)
            reach = max(_JOINT_REACH_MM, float(distance.min()))
            weights = np.exp(-0.5 * (distance / reach) ** 2)
            R, scale, t = best_similarity(template.vertices[skin], vertices[skin], weights)
        positions.append(scale * R @ joint + t)
    return Skeleton(template.skeleton.names, template.skeleton.parents, np.array(positions))


def _fit_mouth(template, vertices, lines, parts, options):
    """Teeth, gums and tongue by one similarity of the skin around them, so that the bite stays as it is.

    Only the outer skin counts where there is any: nobody scans the inside of a closed mouth. Edges stand to the line
    where the lips meet as they do on the template: that decides how much of them a smile shows.
    """
    index = np.concatenate([np.arange(*part.vertices) for part in parts])
    rest = template.vertices[index]
    skin = template.regions["outer"] & template.regions["skin"]
    distance = cKDTree(rest).query(template.vertices[skin])[0]
    weights = np.exp(-0.5 * (distance / _MOUTH_REACH_MM) ** 2)
    R, scale, t = best_similarity(template.vertices[skin], vertices[skin], weights, options.mouth_scale)
    placed = scale * rest @ R.T + t
    there, here = _lip_line(template.vertices, template.lines), _lip_line(vertices, lines)
    placed += (here - scale * R @ there - t) * [1.0, 1.0, 0.0]
    front = _front_teeth(template, parts)
    depth, share = _Mouth(template, template.vertices).misplaced(rest[front])
    allowed = np.array([scale * depth + options.poke_mm, share + options.show_share])
    person = _Mouth(template, vertices)
    steps = np.arange(0.0, options.most_back_mm + 1e-9, 0.5)
    tried = []
    for back in steps:
        tried.append(person.misplaced(placed[front] - [0.0, 0.0, back]))
        if (tried[-1] <= allowed).all():
            break
    best = int(np.argmin([np.maximum(found - allowed, 0.0) @ [1.0, 20.0] for found in tried]))
    result = vertices.copy()
    result[index] = placed - [0.0, 0.0, steps[best]]
    stats = {"scale": scale, "moved_back_mm": float(steps[best])}
    return result, stats | {"deepest_in_skin_mm": float(tried[best][0]), "seen_from_front_share": float(tried[best][1])}


def _lip_line(vertices, lines):
    """(3,) middle of the middle third of the line where the lips meet."""
    points = []
    for name in ("lip_seam_upper", "lip_seam_lower"):
        line = vertices[lines[name]]
        points.append(line[len(line) // 3 : len(line) - len(line) // 3].mean(axis=0))
    return np.mean(points, axis=0)


def _front_teeth(template, parts):
    """(k,) bool over the vertices of parts: the teeth behind the lips; all of them where no part is named teeth."""
    depth = np.concatenate([template.vertices[part.vertex_slice, 2] for part in parts])
    teeth = np.concatenate([np.full(np.diff(part.vertices), part.name.startswith("teeth")) for part in parts])
    if not teeth.any():
        teeth[:] = True
    return teeth & (depth > depth[teeth].max() - _FRONT_TEETH_MM)


class _Mouth:
    """A head's skin, asked where teeth would stand. Flesh lies between the outer skin and the mouth bag, which are one
    surface, closed but for the neck."""

    def __init__(self, template, vertices):
        part = template.skin
        self.V = np.ascontiguousarray(vertices[part.vertex_slice])
        self.F = np.ascontiguousarray(template.faces[part.face_slice])
        self.surface, self.scene = Surface(self.V, self.F), RayScene(self.V, self.F)

    def misplaced(self, points):
        """Depth in mm of the deepest of points (k, 3) inside the flesh, and the share of them seen from the front."""
        winding = igl.fast_winding_number(self.V, self.F, np.ascontiguousarray(points))
        inside = np.asarray(winding).reshape(-1) > 0.5
        depth = self.surface.closest(points[inside]).distance.max() if inside.any() else 0.0
        seen = ~self.scene.occluded(points, np.broadcast_to([0.0, 0.0, 1.0], points.shape))
        return np.array([depth, seen.mean()])


def _carried(template, vertices, part):
    """Vertices of a part that hangs on the skin (lashes, fluid): moved as the skin around them, the nearest most."""
    skin = template.skin.vertex_slice
    rest = template.vertices[part.vertex_slice]
    distance, near = cKDTree(template.vertices[skin]).query(rest, k=_NEIGHBOURS)
    weights = 1.0 / (distance + 0.05) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    shift = vertices[skin] - template.vertices[skin]
    return rest + np.einsum("pk,pkd->pd", weights, shift[near])
