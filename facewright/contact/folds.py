"""Targets without folded faces: what contact and transfer have pressed together is turned back, face by face."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facewright.contact.teeth import out_of_teeth, rows_of_teeth
from facewright.mesh.adjacency import differing, touching
from facewright.mesh.folds import laid_flat
from facewright.mesh.normals import max_norms
from facewright.transfer.shapes import CORRECTIVE_BASE, even_handed

SEAM_MOBILITY = 0.2  # of the line where the lips meet
_MOVES_MM = 1e-3
_ROUNDS = 4  # of laying flat and keeping out of the teeth in turn


def lay_flat(face, targets):
    """Targets in which no face of the skin outside the inner mouth is folded, in-betweens and correctives included.

    face  data.Face; a corrective is looked at with its drivers at 1, mouthClose with jawOpen
    What has been laid flat stays out of the teeth.
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

    teeth = rows_of_teeth(face.template, face.vertices)

    def flat(name):
        delta = targets.delta(name)
        pose = delta + sum(targets.delta(other) for other in _beneath(name, targets))
        near = faces[touching(max_norms(pose[at]) > _MOVES_MM, faces)]
        moved = V + pose[at]
        result = moved
        for _ in range(_ROUNDS):
            before, result = result, laid_flat(V, result, near, ease)
            changed = np.flatnonzero(differing(result, moved))
            if result is before:
                break
            way = out_of_teeth(teeth, face.vertices + pose, result[changed])
            if not way.any():
                break
            result = np.array(result)
            result[changed] += way
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
