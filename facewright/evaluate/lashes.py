"""Do lashes stay where they grow? Their roots against the skin that they stand on, in every pose of the lids."""

from __future__ import annotations

import numpy as np

from facewright.evaluate.eyes import eye_poses
from facewright.evaluate.play import Player
from facewright.evaluate.rows import Row
from facewright.evaluate.shapes import shape_names
from facewright.mesh.adjacency import border_edges
from facewright.mesh.closest import Surface, interpolate

ROOT_MM = 0.05  # edges of cards whose ends are this near to the skin at rest are roots; a tip may touch it too
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
        near = found.distance <= ROOT_MM
        edges = border_edges(mesh.faces)
        self.roots = np.unique(edges[near[edges].all(axis=1)])
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
