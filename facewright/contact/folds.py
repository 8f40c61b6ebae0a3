"""Targets without folded faces: what contact and transfer have pressed together is turned back, face by face."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facewright.mesh.adjacency import touching
from facewright.mesh.folds import laid_flat
from facewright.transfer.shapes import CORRECTIVE_BASE, even_handed

SEAM_MOBILITY = 0.2  # of the line where the lips meet
_MOVES_MM = 1e-3


def lay_flat(face, targets):
    """Targets in which no face of the skin outside the inner mouth is folded, in-betweens and correctives included.

    face  data.Face; a corrective is looked at with its drivers at 1, mouthClose with jawOpen
    """
    skin = face.template.skin
    at = skin.vertex_slice
    V = face.vertices[at]
    faces = face.template.faces[skin.face_slice]
    faces = faces[~face.regions["mouth_interior"][at][faces].any(axis=1)]
    faces = even_handed(faces, face.template.mirror)[0]
    ease = (~face.regions["mouth_interior"][at]).astype(float)
    for name, line in face.lines.items():
        if name.startswith("lip_seam"):
            ease[line] = SEAM_MOBILITY
        elif name.startswith("lid_") or name == "neck_ring":
            ease[line] = 0.0

    def flat(name):
        delta = targets.delta(name)
        pose = delta[at] + sum(targets.delta(other)[at] for other in _beneath(name, targets))
        near = faces[touching(np.abs(pose).max(axis=1) > _MOVES_MM, faces)]
        moved = V + pose
        result = laid_flat(V, moved, near, ease)
        if result is moved:
            return delta
        delta = delta.copy()
        delta[at] += result - moved
        return delta

    deltas = np.array([flat(name) for name in targets.names])
    targets = replace(targets, deltas=deltas)
    return replace(targets, extras={name: flat(name) for name in targets.extras})


def _beneath(name, targets):
    """The targets that a target is played with."""
    if name in targets.correctives:
        return targets.correctives[name]
    base = CORRECTIVE_BASE.get(name)
    return (base,) if base in targets.names else ()
