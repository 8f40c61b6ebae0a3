"""The shapes of jaw and mouth, made sound on each head: the jaw's arc, mouthClose, lips and teeth that do not cross."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from facewright.contact.bag import NOSTRILS, MouthBag
from facewright.contact.folds import SEAM_MOBILITY
from facewright.contact.jaw import find_jaw
from facewright.contact.lips import LipContact, LipOptions
from facewright.contact.mouth_close import MouthCloseOptions, mouth_close
from facewright.contact.targets import is_even
from facewright.contact.teeth import rows_of_teeth
from facewright.contact.tongue import over_the_lip
from facewright.conventions import (
    MOUTH_PAIRS,
    SHUT_PAIRS,
    SHUT_SHAPES,
    corrective_name,
    in_between_name,
    mouth_sides,
)
from facewright.mesh.fade import smooth_step
from facewright.mesh.folds import laid_flat
from facewright.solve.procrustes import best_rotation
from facewright.transfer.shapes import even_cut
from facewright.transfer.within import region_shares

HALF = 0.5
_AGAIN = 2  # times that lips are shut and parted once more where two shapes that keep them shut leave a slit
_MOVES_MM = 0.1  # of a lip: less cannot bring it into what it does not touch at rest
PAIRS = (
    *MOUTH_PAIRS,
    ("mouthDimple", "jawOpen"),
    ("mouthStretch", "jawOpen"),
    ("mouthUpperUp", "jawOpen"),
    ("mouthFunnel", "jawOpen"),
    ("mouthLeft", "jawOpen"),
    ("mouthRight", "jawOpen"),
    ("mouthPress", "mouthRollLower"),
    ("mouthPress", "mouthRollUpper"),
    ("mouthPress", "mouthShrugLower"),
    ("mouthDimple", "mouthPress"),
    ("mouthDimple", "mouthShrugLower"),
    ("mouthFrown", "mouthShrugLower"),
    ("mouthPucker", "mouthShrugLower"),
    ("mouthRollLower", "mouthShrugLower"),
)
"""What people do together and what then crosses on some head of either template."""


@dataclass(frozen=True)
class MouthOptions:
    """lips, close  how lips meet, how mouthClose is made
    flat_mm      from the seam: skin that may give way where a shape folds it
    window_mm    width over the midline over which left hands over to right
    tongue_half  shares of its whole way by which the mouth is parted and the tongue has come at half: first it opens
    once         shapes that draw the same muscle together: of the last only a share of 1 - once_share comes on top
    halves       shapes that get an in-between at half: lips rolled in, which pass round the teeth, and a lip that a jaw
                 takes forward, which passes round the other
    rolls        shapes that take lips in; pressed: share of itself by which one goes on from where outer skin meets the
                 teeth
    pairs        shapes, or both sides of them, that get a corrective together
    spared_mm    how deep the inside of a lip may lie in a tooth half way to such a pair: there its corrective acts by a
                 quarter, and what would push it out does four times as much in the end, where it crumples the corner
    """

    lips: LipOptions = field(default_factory=LipOptions)
    close: MouthCloseOptions = field(default_factory=MouthCloseOptions)
    flat_mm: float = 12.0
    tongue_half: tuple[float, float] = (0.85, 0.35)
    once: tuple[str, ...] = ("mouthFunnel", "mouthPucker")
    once_share: float = 0.6
    window_mm: float = 44.0
    halves: tuple[str, ...] = ("mouthRollLower", "mouthRollUpper", "jawForward")
    rolls: tuple[str, ...] = ("mouthRollLower", "mouthRollUpper")
    pressed: float = 0.5
    pairs: tuple[tuple[str, str], ...] = PAIRS
    spared_mm: float = 1.0


def part_lips(face, options=None):
    """The Face with a neutral whose lips neither cross nor stand in the teeth (its parts are in place)."""
    mouth = _Mouth(face, options or MouthOptions())
    still = np.zeros_like(face.vertices)
    clear = mouth.contact.apart(lambda weight: still, (1.0,), closed=True)
    clear = clear + mouth.contact.lifted(clear, mouth.forward)
    if is_even(face):
        clear = 0.5 * (clear + clear[face.template.mirror] * [-1.0, 1.0, 1.0])
    return replace(face, vertices=face.vertices + clear)


def solve_mouth(face, targets, options=None):
    """Targets with the shapes of the mouth as this head needs them.

    face  data.Face with its parts in place and its lips parted (part_lips); targets from transfer and solve_eyes
    """
    mouth = _Mouth(face, options or MouthOptions())
    result = mouth.with_room(mouth.with_arc(targets))
    result = mouth.with_single_shapes(mouth.with_flat_corners(result))
    result = mouth.with_both_sides(result)
    result = mouth.with_halves(result)
    result = mouth.with_mouth_close(result)
    result = mouth.with_pairs(result)
    result = mouth.with_bag(mouth.with_tongue(result))
    return result.evened(face.template.mirror) if is_even(face) else result


class _Mouth:
    """The mouth of one face: lips, teeth, jaw, and a window that tells left from right."""

    def __init__(self, face, options):
        self.face, self.options = face, options
        template = face.template
        self.skin = template.skin.vertex_slice
        self.faces = even_cut(template.faces[template.skin.face_slice], template.mirror, template.vertices[:, 0])
        self.seams = face.lines["lip_seam_upper"], face.lines["lip_seam_lower"]
        teeth = rows_of_teeth(template, face.vertices)
        skull = face.regions["skull"]
        still = skull if skull.any() else face.regions["outer"]
        self.forward = best_rotation(template.vertices[still], face.vertices[still])[:, 2]
        self.contact = LipContact(face.vertices, self.faces, self.seams, face.regions["outer"], teeth, options.lips)
        self.left = smooth_step(0.5 + template.vertices[:, 0] / options.window_mm)[:, None]

    def with_arc(self, targets):
        """Targets whose jawOpen passes the arc at half; unchanged where the template has no jaw."""
        if "jawOpen" not in targets.names:
            return targets
        opened = targets.delta("jawOpen")
        jaw = find_jaw(self.face, opened)
        if jaw is None:
            return targets
        half = in_between_name("jawOpen", HALF)
        extras = targets.extras | {half: jaw.half_open(self.face.vertices, opened, HALF)}
        return replace(targets, extras=extras, in_betweens=targets.in_betweens | {"jawOpen": {HALF: half}})

    def with_room(self, targets):
        """Targets whose rolls are no stronger than the teeth leave room for.

        What is drawn for lips alone takes thick ones several millimetres into the teeth. Pushed out of them the two
        sides of a lip would change places.
        """
        deltas = np.array(targets.deltas)
        for name in set(self.options.rolls) & set(targets.names):
            met = self.contact.meets_teeth(targets.delta(name), 1.0 - self.options.pressed)
            deltas[targets.names.index(name)] *= min(1.0, met + self.options.pressed)
        return replace(targets, deltas=deltas)

    def with_single_shapes(self, targets):
        """Targets of which each by itself keeps the lips apart on its whole way."""
        names = self._lip_shapes(targets)
        lacks = [self._lack(targets, {name: 1.0}) for name in names]
        for lack, share in zip(lacks, region_shares(self.face, names)):
            lack[self.skin] *= share  # lips that are shut on one side pull at the other corner
        return _added(targets, [(lack, {name: 1.0}) for name, lack in zip(names, lacks)])

    def with_both_sides(self, targets):
        """Targets of which left and right together keep the lips apart too; each side gets its share."""
        pairs = self._both_sides(targets)
        lacks = [self._lack(targets, dict.fromkeys(pair, 1.0)) for pair in pairs]
        return self._added_to_sides(targets, pairs, lacks)

    def with_flat_corners(self, targets):
        """Targets of which none folds the skin around the lips, as where both pull at the small faces of a corner."""
        skin = self.face.vertices[self.skin]
        away = cKDTree(skin[np.concatenate(self.seams)]).query(skin)[0]
        mobility = (away <= self.options.flat_mm).astype(float)
        mobility[np.concatenate(self.seams)] = SEAM_MOBILITY
        deltas = np.array(targets.deltas)
        near = self.faces[(away <= 2.0 * self.options.flat_mm)[self.faces].any(axis=1)]
        for name in self._lip_shapes(targets):
            moved = skin + targets.delta(name)[self.skin]
            deltas[targets.names.index(name), self.skin] += laid_flat(skin, moved, near, mobility) - moved
        return replace(targets, deltas=deltas)

    def with_mouth_close(self, targets):
        """Targets whose mouthClose closes the lips of a jaw that opens by the same weight."""
        if not {"mouthClose", "jawOpen"} <= set(targets.names):
            return targets
        jaw = find_jaw(self.face, targets.delta("jawOpen"))
        if jaw is None:
            return targets
        opens = {1.0: targets.delta("jawOpen")[self.skin]}
        for weight, target in targets.in_betweens.get("jawOpen", {}).items():
            opens[weight] = targets.delta(target)[self.skin]
        skin = self.face.vertices[self.skin]
        closed = dict(
            zip(opens, mouth_close(skin, self.faces, self.seams, jaw, opens, self.forward, self.options.close))
        )
        deltas = np.array(targets.deltas)
        k = targets.names.index("mouthClose")
        deltas[k] = 0.0
        deltas[k, self.skin] = closed.pop(1.0)
        extras, steps = dict(targets.extras), {}
        for weight, delta in closed.items():
            steps[weight] = in_between_name("mouthClose", weight)
            extras[steps[weight]] = np.zeros_like(deltas[k])
            extras[steps[weight]][self.skin] = delta
        in_betweens = targets.in_betweens | ({"mouthClose": steps} if steps else {})
        made = replace(targets, deltas=deltas, extras=extras, in_betweens=in_betweens)
        return self._corrected(made, {"jawOpen": 1.0, "mouthClose": 1.0}, {"mouthClose": 1.0}, closed=True)

    def with_pairs(self, targets):
        """Targets with a corrective for each pair of options.pairs that the template has."""
        extras, correctives = dict(targets.extras), dict(targets.correctives)
        pairs = [[_sides(name, targets.names) for name in pair] for pair in self.options.pairs]
        pairs = [sides for sides in pairs if all(sides)]
        path = {"weights": (1.0, HALF), "acts": _square, "spared_mm": self.options.spared_mm}
        for sides in pairs:
            lack = self._lack(targets, _together(sides), **path)
            for drivers, share in self._shared(sides):
                name = corrective_name(drivers)
                extras[name], correctives[name] = share * lack, drivers
        return replace(targets, extras=extras, correctives=correctives)

    def with_bag(self, targets):
        """Targets of which none, and no pair, draws outer skin over the lining of the mouth or the nostrils."""
        regions, skin = self.face.regions, self.face.vertices[self.skin]
        outer = regions["outer"][self.skin]
        bags = [MouthBag(skin, self.faces, self.seams, regions["mouth_interior"][self.skin], outer)]
        rims = [line for name, line in self.face.lines.items() if name.startswith("nostril")]
        if rims and "nostrils" in regions:
            bags.append(MouthBag(skin, self.faces, rims, regions["nostrils"][self.skin], outer, NOSTRILS))

        def tucked(pose):
            posed = skin + targets.motion(pose)[self.skin]
            return sum(bag.tucked(posed) for bag in bags)

        poses = {name: {name: 1.0} for name in self._lip_shapes(targets)}
        if {"mouthClose", "jawOpen"} <= set(targets.names):
            poses["mouthClose"] = {"mouthClose": 1.0, "jawOpen": 1.0}
        deltas, extras = np.array(targets.deltas), dict(targets.extras)
        for name, pose in poses.items():
            push = tucked(pose)
            deltas[targets.names.index(name), self.skin] += push
            for weight, step in targets.in_betweens.get(name, {}).items():
                extras[step] = np.array(extras[step])
                extras[step][self.skin] += weight * push
        targets = replace(targets, deltas=deltas, extras=extras)
        pairs = self._both_sides(targets)
        pushes = [self._of_head(tucked(dict.fromkeys(pair, 1.0))) for pair in pairs]
        targets = self._added_to_sides(targets, pairs, pushes)
        extras = dict(targets.extras)
        drivers = [names for names in targets.correctives.values() if set(names) <= set(poses)]
        for names in drivers:
            name, push = corrective_name(names), tucked(dict.fromkeys(names, 1.0))
            extras[name] = np.array(extras[name])
            extras[name][self.skin] += push
        return replace(targets, extras=extras)

    def with_tongue(self, targets):
        """Targets with a corrective for a tongue that comes out of an open mouth, and an in-between for its way.

        It parts the teeth by itself, and both together would open the jaw farther than it goes, where the throat folds
        into itself: what it adds to a jaw that is open is taken back. By itself, with the jaw and half way it lies on
        the lower lip.
        """
        parts = {part.name: part.vertex_slice for part in self.face.template.parts}
        if not {"teeth_lower", "tongue"} <= set(parts) or not {"jawOpen", "tongueOut"} <= set(targets.names):
            return targets
        teeth, tongue = parts["teeth_lower"], parts["tongue"]
        opened, out = targets.delta("jawOpen"), np.array(targets.delta("tongueOut"))
        share = np.vdot(out[teeth], opened[teeth]) / max(np.vdot(opened[teeth], opened[teeth]), 1e-12)
        out += over_the_lip(self.face, [(out, 1.0)], -opened)
        parted = np.array(out)
        parted[tongue] = share * opened[tongue]
        parts_first, comes = self.options.tongue_half
        on_way = comes * out + (parts_first - comes) * parted
        on_way += over_the_lip(self.face, [(on_way, 1.0)], -opened)
        deltas, half = np.array(targets.deltas), in_between_name("tongueOut", HALF)
        deltas[targets.names.index("tongueOut")] = out
        drivers = ("jawOpen", "tongueOut")
        name = corrective_name(drivers)
        back = -share * opened
        made = replace(
            targets,
            deltas=deltas,
            extras=targets.extras | {half: on_way, name: back},
            in_betweens=targets.in_betweens | {"tongueOut": {HALF: half}},
            correctives=targets.correctives | {name: drivers},
        )
        motions = [(made.motion({"jawOpen": weight, "tongueOut": 1.0}), weight) for weight in (HALF, 1.0)]
        return replace(made, extras=made.extras | {name: back + over_the_lip(self.face, motions, -opened)})

    def with_halves(self, targets):
        """Targets with an in-between for shapes whose way no straight line follows: it passes round the teeth."""
        names = [name for name in self.options.halves if name in targets.names]
        for name in names:
            targets = self._corrected(targets, {name: 1.0}, {name: 1.0}, weights=(1.0,))
        path = {"weights": (HALF, 0.5 * HALF, 1.5 * HALF), "acts": _hat}
        extras, in_betweens = dict(targets.extras), dict(targets.in_betweens)
        for name in names:
            lack, half = self._lack(targets, {name: 1.0}, **path), in_between_name(name, HALF)
            extras[half] = HALF * targets.delta(name) + lack
            in_betweens[name] = {HALF: half}
        return replace(targets, extras=extras, in_betweens=in_betweens)

    def _shared(self, sides):
        """(drivers, share (n, 1) or 1) of the correctives of a pair; each shape is given by one name or two sides."""
        one, other = sides
        if len(one) == len(other) == 1:
            return [((one[0], other[0]), 1.0)]
        lefts, rights = zip(*((side[0], side[-1]) for side in sides))
        return [(lefts, self.left), (rights, 1.0 - self.left)]

    def _lip_shapes(self, targets):
        """Names of the shapes that move lips; mouthClose, which comes with jawOpen, apart."""
        motion = np.abs(targets.deltas[:, self.contact.lips]).max(axis=(1, 2))
        return [name for name, most in zip(targets.names, motion) if most > _MOVES_MM and name != "mouthClose"]

    def _both_sides(self, targets):
        """(left, right) names of the shapes that move lips on one side each."""
        moving = set(self._lip_shapes(targets))
        return [pair for pair in mouth_sides(targets.names) if pair[0] in moving]

    def _added_to_sides(self, targets, pairs, fields):
        """Targets with a field (n, 3) for each pair of a left and a right shape, of which each gets its side."""
        shares = self.left, 1.0 - self.left
        return _added(targets, [(field, dict(zip(pair, shares))) for pair, field in zip(pairs, fields)])

    def _of_head(self, field):
        """(n, 3) a field of the skin (k, 3) as one of the whole head."""
        result = np.zeros_like(self.face.vertices)
        result[self.skin] = field
        return result

    def _lack(self, targets, pose, weights=None, acts=None, closed=False, spared_mm=0.0):
        """(n, 3) what a pose lacks along its way; weights, acts, closed, spared_mm as LipContact.apart takes them."""
        act = acts or (lambda weight: weight)
        first = self._too_much(targets, pose)

        def motion(weight):
            return targets.motion(_scaled(pose, weight)) + act(weight) * first

        shut, twice = _stays_shut(pose)
        if shut:
            spared_mm = 0.0  # lips that are rolled in lie at the teeth
            first = first + self.contact.shut(motion, weights, acts, lifted=twice)
        first = first + self.contact.apart(motion, weights, acts, closed, shut, spared_mm)
        # Lips that two shapes have taken far through each other part with a slit; from there it is a short way to shut.
        best, least = first, self.contact.ajar(motion, weights, acts) if twice else 0.0
        for _ in range(_AGAIN):
            if not least:
                break
            first = first + self.contact.shut(motion, weights, acts, lifted=True)
            first = first + self.contact.apart(motion, weights, acts, closed, shut, spared_mm)
            left = self.contact.ajar(motion, weights, acts)
            if left < least:
                best, least = first, left
        return best

    def _too_much(self, targets, pose):
        """(n, 3) what a pose does twice: the ring of muscle around the mouth draws together only once."""
        names = [name for name in self.options.once if name in pose]
        if len(names) < 2:
            return np.zeros_like(self.face.vertices)
        return -self.options.once_share * targets.motion({names[-1]: pose[names[-1]]})

    def _corrected(self, targets, pose, shares, **how):
        """Targets after the contact of a pose has been solved along its way; shares: name -> its part of the result."""
        return _added(targets, [(self._lack(targets, pose, **how), shares)])


def _added(targets, fields):
    """Targets with shares of fields added to shapes and to what they pass: pairs of (n, 3) and dict name -> factor."""
    fields = [(change, shares) for change, shares in fields if change.any()]
    if not fields:
        return targets
    deltas, extras = np.array(targets.deltas), dict(targets.extras)
    for change, shares in fields:
        for name, share in shares.items():
            deltas[targets.names.index(name)] += share * change
            for weight, target in targets.in_betweens.get(name, {}).items():
                extras[target] = extras[target] + weight * share * change
    return replace(targets, deltas=deltas, extras=extras)


def _together(sides):
    return {name: 1.0 for side in sides for name in side}


def _square(weight):
    return weight * weight


def _hat(weight):
    """How strongly an in-between at half acts."""
    return 1.0 - abs(2.0 * weight - 1.0)


def _scaled(weights, by):
    return {name: weight * by for name, weight in weights.items()}


def _stays_shut(pose):
    """Whether lips that are shut stay so under a pose (dict shape -> weight), and whether two shapes see to that."""
    names = {name if name in SHUT_SHAPES else name.removesuffix("Left").removesuffix("Right") for name in pose}
    each = names <= set(SHUT_SHAPES)
    return each or names in map(set, SHUT_PAIRS), each and len(names) > 1


def _sides(name, names):
    """A shape of the template by its name, or the names of its left and right; () if it has neither."""
    if name in names:
        return (name,)
    both = (f"{name}Left", f"{name}Right")
    return both if set(both) <= set(names) else ()
