"""The tongue of an open mouth lies on its floor: a jaw that turns would carry its back up into the palate's place.

A tongue that is out lies on the lower lip, which a jaw that opens wide draws away beneath it.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import border_vertices
from facewright.mesh.closest import Surface
from facewright.mesh.fade import smooth_step

_ASKED = 0.5  # lifted by less than this share is the root, which lies in the floor of the mouth


@dataclass(frozen=True)
class TongueOptions:
    """share      of the opening between the lips, from below, that the tongue may fill at jawOpen 1
    body       shares of its length from the root between which its back begins to sink and sinks as a whole
    border_mm  from where it is joined to the gums: there it stays
    most_mm    by which it sinks at most
    front      shares of its length between which a tongue that is out begins to be lifted and is so as a whole
    lift_shares of what the jaw did to it: the first that brings it off the lower lip, or as far off as any
    touch_mm   deeper in the lip it does not lie
    """

    share: float = 0.5
    body: tuple[float, float] = (0.8, 0.35)
    border_mm: float = 8.0
    most_mm: float = 18.0
    front: tuple[float, float] = (0.25, 0.7)
    lift_shares: tuple[float, ...] = tuple(k / 20 for k in range(15))
    touch_mm: float = 0.2


def lay_tongue(face, deltas, options=None):
    """Shapes (s, n, 3) mm of a data.Face whose jawOpen lets the tongue's back sink behind the lower teeth.

    The tip, and with it a tongue that is out, goes with the jaw as before. Unchanged without jaw or tongue.
    """
    options = options or TongueOptions()
    template = face.template
    part = next((part for part in template.parts if part.name == "tongue"), None)
    if part is None or "jawOpen" not in template.shape_names:
        return deltas
    number, at = template.shape_names.index("jawOpen"), part.vertex_slice
    upper, lower = (
        _middle(face.vertices + deltas[number], face.lines[f"lip_seam_{lip}"]) for lip in ("upper", "lower")
    )
    level = ((1 - options.share) * lower + options.share * upper)[1]
    weights = _sinks(template.vertices[at], template.faces[part.face_slice] - part.vertices[0], options)
    above = (face.vertices + deltas[number])[at, 1] - level
    depth = (above[weights > 0.5] / weights[weights > 0.5]).max(initial=0.0)
    result = np.array(deltas)
    result[number, at, 1] -= np.clip(depth, 0.0, options.most_mm) * weights
    return result


def _middle(vertices, line):
    return vertices[line[len(line) // 2]]


def _sinks(vertices, faces, options):
    """(k,) 0..1: how far each vertex of a tongue (k, 3) at rest sinks, more to the back; joined edges do not."""
    z = vertices[:, 2]
    share = (z - z.min()) / np.ptp(z)
    start, full = options.body
    border = border_vertices(faces, len(vertices))
    held = cKDTree(vertices[border]).query(vertices)[0] / options.border_mm if border.any() else 1.0
    return smooth_step(share, start, full) * smooth_step(held)


def over_the_lip(face, motions, way, options=None):
    """(n, 3) share of a way by which a tongue that is out is lifted off the lower lip; the rest of the head stays.

    motions  displacements (n, 3) of the poses in question, with how strongly the correction acts in each: (motion, act)
    way      (n, 3) mm of the whole correction: the front of the tongue takes as much of it as it needs
    """
    options = options or TongueOptions()
    template, still = face.template, np.zeros_like(face.vertices)
    part = next((part for part in template.parts if part.name == "tongue"), None)
    if part is None:
        return still
    at, skin = part.vertex_slice, template.skin.vertex_slice
    faces = np.ascontiguousarray(template.faces[template.skin.face_slice])
    lifts = _lifts(template.vertices[at], options)
    asked = lifts > _ASKED
    posed = [(face.vertices + motion, act) for motion, act in motions]
    poses = [(_Flesh(np.ascontiguousarray(pose[skin]), faces), pose[at], act) for pose, act in posed]
    best, least = 0.0, np.inf
    for share in options.lift_shares:
        lift = share * lifts[:, None] * way[at]
        depth = max((flesh.depth((tongue + act * lift)[asked]) for flesh, tongue, act in poses), default=0.0)
        if depth < least:
            best, least = share, depth
        if depth <= options.touch_mm:
            break
    still[at] = best * lifts[:, None] * way[at]
    return still


def _lifts(vertices, options):
    """(k,) 0..1: how far each vertex of a tongue (k, 3) at rest is lifted with its tip."""
    z = vertices[:, 2]
    start, full = options.front
    return smooth_step((z - z.min()) / np.ptp(z), start, full)


class _Flesh:
    """What lies between outer skin and lining of a pose: vertices (n, 3), faces (m, 3)."""

    def __init__(self, vertices, faces):
        self._surface, self._tree = Surface(vertices, faces), igl.FastWindingNumberBVH()
        self._tree.init(self._surface.vertices, self._surface.faces)

    def depth(self, points):
        """How deep in mm the deepest of points (k, 3) lies in it."""
        inside = np.asarray(self._tree.winding_number(np.ascontiguousarray(points))).reshape(-1) > 0.5
        return float(self._surface.closest(points[inside]).distance.max()) if inside.any() else 0.0
