"""Do lashes stay where they grow? Their roots against the skin that they stand on, in every pose of the lids."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from facewright.evaluate.eyes import eye_poses
from facewright.evaluate.play import Player
from facewright.evaluate.rows import Row
from facewright.evaluate.shapes import shape_names
from facewright.mesh.adjacency import border_loops
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import face_corners, normalized

ROOT_MM = 0.05  # from the skin at rest
_OF_A_SIDE = 2 / 3  # of a card's side that lies on the skin from which on it is the one that lashes grow from
_CORNER_DEG = 140.0  # of a card at its border: less is a corner of it
LASH_BAR_MM = 0.2
STEPS = (0.25, 0.5, 0.75, 1.0)


def measure_lashes(rig):
    """dict: "roots" (their number), "off_mm" and "at": most that a root leaves its own point of the skin, under any
    shape by itself at 0.25 to 1, as a right runtime plays it, and in eye_poses; None without lashes.
    """
    found = [_Lashes(rig, mesh) for mesh in rig.meshes if mesh.name.startswith("lashes")]
    found = [lashes for lashes in found if len(lashes.roots)]
    if not found:
        return None
    poses = {f"{name} {step:g}": {name: step} for name in shape_names(rig) for step in STEPS}
    for name, weights in eye_poses().items():
        sided = {f"{shape}{side}": weight for shape, weight in weights.items() for side in ("Left", "Right")}
        if set(sided) <= set(rig.target_names):
            poses[name] = sided
    play, worst, at = Player(rig, full=True), 0.0, ""
    for name, weights in poses.items():
        expanded = play.targets(weights)
        off = max(lashes.off_mm(expanded) for lashes in found)
        if off > worst:
            worst, at = off, name
    return {"roots": sum(len(lashes.roots) for lashes in found), "off_mm": worst, "at": at}


def lash_rows(rig):
    """The row of rows.Row that `facewright evaluate rig` prints; none without lashes."""
    found = measure_lashes(rig)
    if found is None:
        return []
    return [Row("lashes", found["at"], "off the margin mm", found["off_mm"], bar=(None, LASH_BAR_MM))]


class _Lashes:
    """One mesh of lashes and the points of the skin that its roots stand on."""

    def __init__(self, rig, mesh):
        self.rig, self.mesh, self.skin = rig, mesh, rig.meshes[0]
        found = Surface(self.skin.vertices, self.skin.faces).closest(mesh.vertices)
        self.roots = _roots(mesh.vertices, mesh.faces, found.distance <= ROOT_MM)
        self.faces, self.barycentric = found.faces[self.roots], found.barycentric[self.roots]

    def off_mm(self, weights):
        """Largest change of a root's offset from its point of the skin, mm."""
        number = self.rig.target_names.index
        roots = np.zeros((len(self.roots), 3))
        skin = np.zeros_like(roots)
        for name, weight in weights.items():
            skin += weight * self._on(self.skin.deltas[number(name)])
            if self.mesh.deltas is not None:
                roots += weight * self.mesh.deltas[number(name)][self.roots]
        return float(np.linalg.norm(roots - skin, axis=1).max())

    def _on(self, values):
        return interpolate(values, self.skin.faces, self.faces, self.barycentric)


def _roots(vertices, faces, near):
    """Indices of the vertices of cards that stand on the skin; near (n,) bool: on it at rest.

    Lashes grow from one side of their card. A corner of it that hangs into the skin, as at the inner corner of an eye,
    lies there by chance and goes with its lash.
    """
    inner, roots = _inner_angles(vertices, faces), []
    for loop in border_loops(faces):
        corners = np.flatnonzero(inner[loop] < np.radians(_CORNER_DEG))
        loop = np.roll(loop, -corners[0]) if len(corners) else loop
        ends = np.append(corners - corners[0], len(loop)) if len(corners) else [0, len(loop)]
        for start, stop in pairwise(ends):
            side = np.append(loop, loop[0])[start : stop + 1]
            if near[side].mean() > _OF_A_SIDE:
                roots.append(side[near[side]])
    return np.unique(np.concatenate(roots)) if roots else np.empty(0, int)


def _inner_angles(vertices, faces):
    """(n,) radians that the faces at each vertex take up there."""
    total, corners = np.zeros(len(vertices)), face_corners(vertices, faces)
    for i in range(3):
        a, b, c = (corners[(i + k) % 3] for k in range(3))
        cosine = (normalized(b - a) * normalized(c - a)).sum(axis=1)
        np.add.at(total, faces[:, i], np.arccos(np.clip(cosine, -1.0, 1.0)))
    return total
