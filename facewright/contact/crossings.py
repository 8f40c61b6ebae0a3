"""Targets without new crossings of faces: what contact has left is moved apart, pose by pose."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from facewright.contact.parting import Parting
from facewright.contact.targets import is_even
from facewright.contact.teeth import out_of_teeth, rows_of_teeth
from facewright.conventions import EYE_PAIRS, MOUTH_PAIRS, TONGUE_PAIR, mouth_sides
from facewright.mesh.adjacency import differing
from facewright.mesh.seam import inner_sides
from facewright.transfer.halves import left_share
from facewright.transfer.shapes import CORRECTIVE_BASE
from facewright.working_set import read_working_set

_REACH_MM = {"lip_seam": 25.0, "lid_": 10.0, "nostril": 14.0}  # from these lines: skin that may come to cross
_SEEN_MM, _HIDDEN_MM, _MARGIN_MM = 0.5, 1.5, 0.08  # by which skin is moved at most
# Where crossings are left, skin is tried so much farther: a corner of the mouth that mouthRollUpper folds on ICT (a
# scan, a simulated face) keeps 23 and 40 pairs with 0.5 mm, 1 and none with 1.5. At the eyes less: shut lids that moved
# three times as far showed 0.9 mm2 of the ball, but a last pair of a blink goes with twice as far.
_FARTHER, _LITTLE_FARTHER = 3.0, 2.0
_FAR_MM = 20.0  # a shape that goes farther may cross elsewhere, as chin and neck do,
_MOVES_MM = 1.0  # where an open jaw moves the skin by so much
_ON_WAY = 0.25, 0.5, 0.75  # weights of shapes with in-betweens at which a correction must not enter the teeth either


def part_crossings(face, targets, pairs=None):
    """Targets of a data.Face in which no shape, none of its halves and no named pair has crossings of its own.

    What crosses in the neutral may go on doing so; where little can be moved a few pairs of faces are left.
    Corrections of pairs go into their correctives; a shape's in-betweens get their share of its own.
    pairs  gives Targets whose shapes are sound the correctives that are made from those
    """
    work = _Crossings(face, targets)
    targets = work.with_shapes(targets)
    targets = work.with_pairs(pairs(targets) if pairs else targets)
    return targets.evened(face.template.mirror) if is_even(face) else targets


class _Crossings:
    """The skin of one face: where it may cross, and poses of it."""

    def __init__(self, face, targets):
        template = face.template
        self.at, self.before = template.skin.vertex_slice, targets
        self.rest, self.teeth = face.vertices, rows_of_teeth(template, face.vertices)
        self.V, faces = face.vertices[self.at], template.faces[template.skin.face_slice]
        asked = face.regions["face"][self.at][faces].all(axis=1)
        self.outer = face.regions["outer"][self.at]
        farthest = np.where(self.outer, _SEEN_MM, _HIDDEN_MM)
        near, lids = np.zeros((2, len(self.V)), bool)
        for name, line in face.lines.items():
            reach = next((reach for start, reach in _REACH_MM.items() if name.startswith(start)), None)
            if reach is None:
                continue
            there = cKDTree(self.V[line]).query(self.V, distance_upper_bound=reach)[0] < reach
            near |= there
            if name.startswith("lid_"):
                farthest[line] = _MARGIN_MM  # margins lie on the ball, in a smooth line
                lids |= there
        farther = np.where(lids, _LITTLE_FARTHER, _FARTHER) * farthest
        # Skin and lining nearest to a corner of the mouth may cross as one turned inside out.
        seams = (face.lines[f"lip_seam_{lip}"] for lip in ("upper", "lower"))
        lips = inner_sides(self.V, faces, *seams, _REACH_MM["lip_seam"])
        self.near = Parting(self.V, faces, near[faces].all(axis=1), asked, farthest, lips, farther)
        if "jawOpen" in targets.names:
            near |= np.abs(targets.delta("jawOpen")[self.at]).max(axis=1) > _MOVES_MM
        self.wide = Parting(self.V, faces, near[faces].all(axis=1), asked, farthest, lips, farther)
        self.halves = read_working_set().halves(targets.names)
        self.left = left_share(template)[self.at, None]
        self.is_left = (template.vertices[self.at, 0] > 0.0)[:, None]

    def _apart(self, motions, acts, left=(), **known):
        """(k, 3) correction of the skin for motions (n, 3) of the head in which it acts as acts say; known: clean
        and on_way as Parting takes them, left: motions as contact has left them."""
        heads = [self.rest + motion for motion in motions]
        far = max(np.abs(motion[self.at]).max(initial=0.0) for motion in motions) > _FAR_MM
        ways_out = [partial(out_of_teeth, self.teeth, head) for head in heads]
        left = [(self.rest + motion)[self.at] for motion in left]
        # Outer skin that a shape leaves alone lies outside its region.
        still = self.outer & ~np.any([differing(motion[self.at], 0.0) for motion in motions], axis=0)
        parting = self.wide if far else self.near
        return parting([head[self.at] for head in heads], acts, ways_out, still, left=left, **known)

    def with_shapes(self, targets):
        """Targets whose shapes have no crossings, nor the halves of those that have any."""
        deltas, extras = np.array(targets.deltas), dict(targets.extras)

        def field(name):
            motion, base = targets.delta(name), CORRECTIVE_BASE.get(name)
            if base in targets.names:
                return self._apart([motion + targets.delta(base)], [1.0])
            shares = [1.0, self.left, 1.0 - self.left] if name in self.halves else [1.0]
            on_way = _ON_WAY if name in targets.in_betweens else ()
            way = [targets.motion({name: weight}) for weight in on_way]
            motions = [_shared(motion, share, self.at) for share in shares]
            return self._apart([*motions, *way], [*shares, *on_way], on_way=len(way))

        def fields(names):
            """Of a left and a right shape: the two, each by itself first, then what both together need."""
            alone = [field(name) for name in names]
            if len(names) == 1:
                return alone
            motions = [_plus(targets.delta(name), change, self.at) for name, change in zip(names, alone)]
            # What one side leaves alone lies outside its region.
            own = [~self.outer[:, None] | differing(motion[self.at], 0.0)[:, None] for motion in motions]
            acts = [share * mask for share, mask in zip((self.left, 1.0 - self.left), own)]
            both = self._apart([sum(motions), *motions], [1.0, *acts], clean=2)
            return [change + act * both for change, act in zip(alone, acts)]

        changes = {}
        for names in _with_twins(targets.names):
            changes |= zip(names, fields(names))
        for number, name in enumerate(targets.names):
            # What was asked about with another shape beneath stays with it what it became.
            change = changes[name] - changes.get(CORRECTIVE_BASE.get(name), 0.0)
            deltas[number, self.at] += change
            for weight, step in targets.in_betweens.get(name, {}).items():
                extras[step] = _plus(extras[step], weight * change, self.at)
        return replace(targets, deltas=deltas, extras=extras)

    def with_pairs(self, targets):
        """Targets whose named pairs have none."""
        extras = dict(targets.extras)
        windows = [(EYE_PAIRS, self.is_left), ((*MOUTH_PAIRS, TONGUE_PAIR), self.left)]
        pairs = [(_of_pair(pair, targets), window) for pairs, window in windows for pair in pairs]

        def field(names):
            drivers = {driver for name in names for driver in targets.correctives[name]}
            pose = dict.fromkeys(sorted(drivers), 1.0)
            left = [self.before.motion(pose)] if set(names) <= set(self.before.correctives) else ()
            return self._apart([targets.motion(pose)], [1.0], left=left)

        changes = [(names, window, field(names)) for names, window in pairs if names]
        for names, window, change in changes:
            shares = (window, 1.0 - window) if len(names) > 1 else (1.0,)
            for name, share in zip(names, shares):
                extras[name] = _plus(extras[name], share * change, self.at)
        return replace(targets, extras=extras)


def _with_twins(names):
    """Names in tuples: a left and a right shape of the mouth together, since their sides meet at its middle."""
    pairs = mouth_sides(names)
    paired = {name for pair in pairs for name in pair}
    return [*pairs, *((name,) for name in names if name not in paired)]


def _of_pair(pair, targets):
    """The correctives of a pair of shapes: one, or those of left and right; () where there is none."""
    sides = [name for name in targets.correctives if _unsided(targets.correctives[name]) == set(pair)]
    return tuple(sorted(sides, key=lambda name: "Right" in name))


def _unsided(names):
    return {name.removesuffix("Left").removesuffix("Right") for name in names}


def _shared(motion, share, at):
    return _plus(np.zeros_like(motion), share * motion[at], at)


def _plus(delta, change, at):
    result = np.array(delta)
    result[at] += change
    return result
