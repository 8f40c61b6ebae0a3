"""The jaw of one head: its hinge, and the arc that everything on it takes when it opens."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from facewright.solve.procrustes import best_rotation
from facewright.transfer.within import MARGIN, scale_of
from facewright.working_set import read_working_set


@dataclass(frozen=True)
class Jaw:
    """hinge (3,) mm on the axis, midway between the joints; turn (3,) rotation vector at jawOpen 1; slide (3,) mm along
    the axis, next to nothing; weights (n,) share of the jaw bone in each vertex."""

    hinge: np.ndarray
    turn: np.ndarray
    slide: np.ndarray
    weights: np.ndarray

    def moved(self, points, share):
        """Points (k, 3) turned by a share of the opening."""
        R = Rotation.from_rotvec(share * self.turn).as_matrix()
        return self.hinge + (points - self.hinge) @ R.T + share * self.slide

    def half_open(self, vertices, jaw_open, half=0.5):
        """(n, 3) jawOpen (n, 3) opened by a share: on the arc where the bone leads, on the chord for what is added."""
        by_bone = [self.weights[:, None] * (self.moved(vertices, share) - vertices) for share in (half, 1.0)]
        return by_bone[0] + half * (jaw_open - by_bone[1])

    def on_rig(self, rig):
        """The Rig with its jaw bone at the hinge; info["jaw_open_turn_deg"]: the bone's turn that matches jawOpen."""
        skeleton = rig.skeleton
        positions = np.array(skeleton.positions)
        positions[skeleton.names.index("jaw")] = self.hinge
        turn = {"jaw_open_turn_deg": np.degrees(self.turn).tolist()}
        return replace(rig, skeleton=replace(skeleton, positions=positions), info=rig.info | turn)


def find_jaw(face, jaw_open):
    """The Jaw of a data.Face from its jawOpen (n, 3): the axis about which the lower teeth turn. None without teeth."""
    template = face.template
    parts = [part for part in template.parts if part.attach == "jaw"]
    if not parts:
        return None
    lead = next((part for part in parts if part.name == "teeth_lower"), parts[0]).vertex_slice
    rest = face.vertices[lead]
    moved = rest + jaw_open[lead]
    R = best_rotation(rest, moved)
    turn = Rotation.from_matrix(R).as_rotvec()
    if np.linalg.norm(turn) < 0.05:
        return None
    axis = turn / np.linalg.norm(turn)
    shift = moved.mean(axis=0) - R @ rest.mean(axis=0)
    slide = (shift @ axis) * axis
    hinge = np.linalg.lstsq(np.eye(3) - R, shift - slide, rcond=1e-9)[0]
    # Any point of the axis will do; the bone sits on the midline of the teeth.
    hinge = hinge + ((rest.mean(axis=0) - hinge) @ axis) * axis
    weights = template.skin_weights[:, template.skeleton.names.index("jaw")]
    return Jaw(hinge, turn, slide, weights)


def keep_jaw_within(face, deltas):
    """Shapes (s, n, 3) mm of a data.Face whose jawOpen opens no farther than the working set says, along its arc.

    A long face carries its chin far when its jaw turns as the template's does. Unchanged without a jaw
    """
    names = face.template.shape_names
    if "jawOpen" not in names:
        return deltas
    number = names.index("jawOpen")
    jaw = find_jaw(face, deltas[number])
    most = read_working_set().words["jawOpen"].amplitude[1]
    opens = np.linalg.norm(deltas[number, face.regions["outer"]], axis=1).max() * scale_of(face)
    if jaw is None or opens <= most:
        return deltas
    result = np.array(deltas)
    result[number] = jaw.half_open(face.vertices, deltas[number], (1.0 - MARGIN) * most / opens)
    return result
