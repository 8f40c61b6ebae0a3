"""Shapes whose blends fold no face: what no shape does by itself, two or three of them may do together.

A face that keeps a third of its area in one shape and a half in another may lie upside down where both play, and one
that turns between two in-betweens half way. Such faces are few. They are asked in a sample of poses that is the same
for every head: shapes on their way, pairs with a corrective, looks with lids half shut, blends of expressions and
visemes. Where one folds or nearly does, the shapes at fault are changed together with what lies around
(contact.opening).

Tried: what is missing of a face shared out pose by pose until none is missing (0.39 mm where the least motion needs
0.11, other faces folded by it); blends alone as the sample, 1,000 of them (folds stay where a lid half shut meets a
look); margins of lids that give way to nothing (a face between three of their vertices stays folded); every two
expressions blended twice (no fold fewer on three of four heads).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facewright.contact.blend_poses import plain_poses, sample_poses, together
from facewright.contact.opening import Faces, Surroundings
from facewright.contact.targets import is_even
from facewright.expand import expand_weights
from facewright.mesh.adjacency import dilate, face_components, touching
from facewright.mesh.folds import expected_normals
from facewright.mesh.normals import dot, face_cross, max_norms
from facewright.transfer.shapes import CORRECTIVE_BASE, even_handed

_SUSPECT = 0.5  # of its area at rest, seen as it should look: less of a face in one shape makes it suspect
_EVERY = 2  # pose of the sample in which they are asked whether they are at risk
_SEAM_EASE, _MARGIN_EASE = 0.2, 0.03  # how readily the lips' line and margins of lids give way; the rest: 1
_STILL_MM, _STIRRED_MM = 1e-4, 0.02  # by which a target moves a vertex, and a shape one that is asked about


def lay_blends_flat(face, targets):
    """Targets of a data.Face in whose blends no face of the skin outside the inner mouth folds, as far as the sample
    of poses can tell; those in which none comes near to it are returned as they are."""
    skin = _Skin(face, targets)
    weights = skin.weights(sample_poses(targets))
    touched = np.zeros(len(skin.V), bool)
    risk = np.zeros(len(skin.faces), bool)
    for patch in skin.patches(skin.suspects()):
        risk[patch] = skin.faces_of(patch).at_risk(weights[::_EVERY])
    touched[skin.faces[risk]] = True
    touched = dilate(touched, skin.faces)
    ease = skin.ease * touched
    patches = skin.patches(np.flatnonzero(touching(touched, skin.faces)))
    plain = skin.weights(plain_poses(targets))
    for asked in patches:
        # One after the other: both margins of a lid may change, each soundly as long as the other stays.
        patch = skin.faces_of(asked)
        own = ease[patch.used]
        around = Surroundings(patch, own > 0.0, skin.V, skin.all_faces, skin.deltas, plain)
        skin.change(patch, patch.opened(weights, risk[asked], own, around))
    result = skin.changed()
    return result.evened(face.template.mirror) if patches and is_even(face) else result


class _Skin:
    """The skin of a face with all its targets."""

    def __init__(self, face, targets):
        skin = face.template.skin
        self.at, self.targets = skin.vertex_slice, targets
        self.V = face.vertices[self.at]
        self.all_faces = face.template.faces[skin.face_slice]
        inner = face.regions["mouth_interior"][self.at]
        self.faces = even_handed(self.all_faces[~inner[self.all_faces].any(axis=1)], face.template.mirror)[0]
        self.names = [*targets.names, *targets.extras]
        self.deltas = [targets.delta(name)[self.at] for name in self.names]
        self.changes = set()  # of these by change: their indices
        self.ease = np.ones(len(self.V))
        for name, line in face.lines.items():
            if name.startswith("lip_seam"):
                self.ease[line] = _SEAM_EASE
            elif name.startswith("lid_"):
                self.ease[line] = _MARGIN_EASE
            elif name == "neck_ring":
                self.ease[line] = 0.0

    def weights(self, poses):
        """(p, t) weights of the targets that play poses."""
        index = {name: i for i, name in enumerate(self.names)}
        result = np.zeros((len(poses), len(self.names)))
        for row, pose in zip(result, poses):
            for name, weight in expand_weights(pose, self.targets.in_betweens, self.targets.correctives).items():
                row[index[name]] = weight
        return result

    def suspects(self):
        """(k,) indices of faces that some shape or in-between leaves little of, seen as they should look."""
        rest = face_cross(self.V, self.faces)
        area, found = dot(rest, rest), np.zeros(len(self.faces), bool)
        for motion in self._stops():
            stirred = max_norms(motion) > _STIRRED_MM
            near = np.flatnonzero(touching(stirred, self.faces) & ~found)
            now = face_cross(self.V + motion, self.faces[near])
            small = near[dot(now, rest[near]) < _SUSPECT * area[near]]
            if len(small):
                moved = self.V + motion
                normals = expected_normals(self.V, moved, self.faces, small)
                seen = dot(face_cross(moved, self.faces[small]), normals)
                found[small[seen < _SUSPECT * np.sqrt(area[small])]] = True
        return np.flatnonzero(found)

    def _stops(self):
        """(n, 3) motions of the skin by each shape and each in-between, both eyes at once."""
        motion = dict(zip(self.names, self.deltas))
        for names in together(self.targets.names):
            base = [motion[CORRECTIVE_BASE[name]] for name in names if CORRECTIVE_BASE.get(name) in motion]
            steps = [sorted(self.targets.in_betweens.get(name, {}).items()) for name in names]
            for stop in zip(*([*(target for _, target in own), name] for own, name in zip(steps, names))):
                yield sum((motion[target] for target in stop), sum(base, 0.0))

    def patches(self, asked):
        """List of (k,) indices of faces, of those asked, that hang together by their corners."""
        corners = self.faces[asked]
        _, local = np.unique(corners, return_inverse=True)
        local = local.reshape(-1, 3)
        label = face_components(local, local.max(initial=-1) + 1) if len(asked) else asked
        return [asked[label == one] for one in np.unique(label)]

    def faces_of(self, asked):
        """The Faces of indices (k,), their vertices numbered anew, with the targets that move them."""
        touched = np.zeros(len(self.V), bool)
        touched[self.faces[asked]] = True
        ring = self.all_faces[touching(touched, self.all_faces)]
        used, local = np.unique(ring, return_inverse=True)
        deltas = np.array([delta.take(used, axis=0) for delta in self.deltas])
        played = np.flatnonzero(np.abs(deltas).max(axis=(1, 2)) > _STILL_MM)
        faces = np.searchsorted(used, self.faces[asked])
        return Faces(asked, used, played, self.V[used], deltas[played], faces, local.reshape(-1, 3))

    def change(self, patch, change):
        """Add changes (t, n, 3) of the deltas of a Faces' vertices."""
        for i, own in zip(patch.played, change):
            if own.any():
                self.deltas[i] = np.array(self.deltas[i])
                self.deltas[i][patch.used] += own
                self.changes.add(i)

    def changed(self):
        """The Targets with all changes."""
        deltas, extras = np.array(self.targets.deltas), dict(self.targets.extras)
        for i in self.changes:
            name = self.names[i]
            if i >= len(deltas):
                extras[name] = np.array(extras[name])
            whole = deltas[i] if i < len(deltas) else extras[name]
            whole[self.at] = self.deltas[i]
        return replace(self.targets, deltas=deltas, extras=extras)
