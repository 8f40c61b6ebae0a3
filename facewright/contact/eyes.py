"""The shapes of the eyes, made by rule on each head: blink, squint, wide and gaze, with what their path and pairs need.

A morph target moves vertices along chords, lids and eyeballs move along arcs: an in-between at half weight keeps lids
out of the ball. Two shapes that both lower a lid add up to too much: a corrective per pair, weighted by the product of
the two, brings the margins together again.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from facewright.contact.gaze import gaze_rotation, look_shapes
from facewright.contact.lids import LidMotionOptions, Lids
from facewright.contact.meeting import along_line
from facewright.contact.pouch import LidLining
from facewright.contact.retraction import needed_retraction
from facewright.contact.rims import from_ends
from facewright.contact.targets import Targets, is_even
from facewright.conventions import corrective_name, in_between_name
from facewright.mesh.fade import smooth_step
from facewright.mesh.normals import max_norms
from facewright.mesh.polyline import arc_lengths
from facewright.transfer.eyeball import carried_eyeball, eye_parts

HALF = 0.5
_PRESSING_LOOKS, _RAISING = ("Down", "Out"), ("cheekSquint", "noseSneer")
_BLINK_STEPS = 0.35, 0.7, 1.0  # a lid turns farthest; chords of a third of its way stay out of the ball
_FULLNESS, _STILL_MM = 0.6, 5.0  # of margins that turn; so far from the canthi they turn less, which stay
_CHEEK_MM = 14.0, 30.0  # from the margins: so far a template's squint counts whole, and not at all
_CORNER_MM = 6.0  # so far from the canthi margins go with the skin in a squint: the nearer, the more
_MOST_SHUT, _SOFT_SHARE = 0.6, 0.1  # of the opening, by which lids that follow the gaze shut; how softly that sets in
_SHUT_FOLLOWS = 0.4  # of what the lower lid alone follows the gaze: shut lids that went as far would hang in a U


@dataclass(frozen=True)
class EyeShapeOptions:
    """lids            how lids move
    look_turn_deg   direction -> degrees by which upper and lower margin follow the gaze (up is positive): the upper
                    one nearly as far as a ball that turns down by 30, or white shows above the iris as in a stare
    wide_turn_deg   the same for eyeWide
    squint_share    of the opening by which eyeSquint lowers the upper and raises the lower lid
    passing_mm      by which lids lie higher where a blink passes on its way
    free_mm         skin this far from the margins may move with the lids
    """

    lids: LidMotionOptions = field(default_factory=LidMotionOptions)
    look_turn_deg: dict[str, tuple[float, float]] = field(
        default_factory=lambda: {"Down": (-21.0, -10.0), "Up": (16.0, 5.0), "In": (0.0, 0.0), "Out": (0.0, 0.0)}
    )
    wide_turn_deg: tuple[float, float] = (12.0, -4.0)
    squint_share: tuple[float, float] = (0.10, 0.30)
    passing_mm: float = 0.15
    free_mm: float = 14.0


def solve_eyes(face, deltas, options=None):
    """Targets of a Face with its parts in place from its transferred shapes (s, n, 3) mm; eye shapes made anew."""
    eyes = EyeShapes(face, options)
    made = eyes.with_pairs(eyes.shapes(deltas))
    # A lining that just clears a lid may be pushed on one side and not on the other.
    return made.evened(face.template.mirror) if is_even(face) else made


class EyeShapes:
    """The eye shapes of a Face with its parts in place."""

    def __init__(self, face, options=None):
        self.face = face
        self._names = list(face.template.shape_names)
        self._eyes = [_Eye(face, side, options or EyeShapeOptions()) for side in ("left", "right")]

    def shapes(self, deltas):
        """Targets from transferred shapes (s, n, 3) mm: eye shapes made anew, and what gaze past a corner needs."""
        names, result = self._names, np.array(deltas)
        extras, in_betweens, correctives = {}, {}, {}
        for eye in self._eyes:
            found = eye.shapes(names, deltas)
            pressed = eye.pressed(found)
            for name, poses in found.items():
                result[names.index(name)] = poses.pop(1.0)
                if poses:
                    in_betweens[name] = {weight: in_between_name(name, weight) for weight in poses}
                    extras |= {in_betweens[name][weight]: delta for weight, delta in poses.items()}
            for name, cleared in eye.raised(names, result, pressed):
                result[names.index(name)] = cleared
            for pair in eye.diagonals(names):
                target = corrective_name(pair)
                extras[target] = eye.diagonal(pair, [result[names.index(name)] for name in pair], pressed)
                correctives[target] = pair
        blinks = [(eye, result[names.index(eye.blink)]) for eye in self._eyes if eye.blink in names]
        back = max([eye.retraction(blink) for eye, blink in blinks], default=0.0)
        for eye, blink in blinks:
            for part in eye_parts(self.face.template, eye.side):
                blink[part.vertex_slice] -= [0.0, 0.0, back]
        return Targets(tuple(names), result, extras, in_betweens, correctives)

    def with_pairs(self, targets):
        """Targets with what shut lids need beside other shapes of the eye: what has been mended since stays so."""
        extras, correctives = dict(targets.extras), dict(targets.correctives)
        for eye in self._eyes:
            for other in eye.partners(self._names):
                target = corrective_name((eye.blink, other))
                extras[target] = eye.corrective(targets.delta(eye.blink), targets.delta(other), other)
                correctives[target] = (eye.blink, other)
        return replace(targets, extras=extras, correctives=correctives)


class _Eye:
    """One eye of a face: its lids and its ball."""

    def __init__(self, face, side, options):
        self.face, self.side, self.options = face, side, options
        self.blink = f"eyeBlink{side.capitalize()}"
        skin = face.template.skin
        self.skin = skin.vertex_slice
        self.V = face.vertices[self.skin]
        self.ball = carried_eyeball(face.template, face.vertices, side)
        upper, lower = face.lines[f"lid_upper_{side}"], face.lines[f"lid_lower_{side}"]
        faces = face.template.faces[skin.face_slice]
        # With their mirror images, so that both eyes are treated alike however their quads are cut.
        faces = np.concatenate([faces, face.template.mirror[faces][:, [0, 2, 1]]])
        socket = face.regions[f"socket_{side}"][self.skin]
        held = face.regions["mouth_interior"][self.skin] | face.regions["nostrils"][self.skin]
        margin = self.V[np.concatenate([upper, lower])]
        distance = cKDTree(margin).query(self.V)[0]
        # A template's own squint may reach far down the cheek, which is cheekSquint's.
        self.squints = smooth_step(distance, _CHEEK_MM[1], _CHEEK_MM[0])[:, None]
        free = (distance < options.free_mm) & ~held & ~(socket & (distance > 0.5 * options.free_mm))
        self.lids = Lids(self.V, faces, upper, lower, free, ~socket, self.ball, options.lids)
        faces = faces[: len(faces) // 2]
        self.lid_faces = faces[(free & ~socket)[faces].all(axis=1)]
        near = distance < options.free_mm
        lining = faces[(socket[faces] & near[faces]).any(axis=1)]
        self.lining = LidLining(self.V, self.lid_faces, lining, distance, socket & near, self.ball.center)
        self.profiles = [
            _profile(self.V[chain]) ** _FULLNESS * smooth_step(from_ends(self.V[chain], _STILL_MM))
            for chain in (upper, lower)
        ]

    def shapes(self, names, deltas):
        """shape name -> {weight: (n, 3) delta} of this eye's shapes that the template has."""
        side = self.side.capitalize()
        made = {self.blink: (self._blink, _BLINK_STEPS), f"eyeWide{side}": (self._wide, (HALF, 1.0))}
        found = {
            name: {weight: self._full(make(weight)) for weight in weights}
            for name, (make, weights) in made.items()
            if name in names
        }
        squint = f"eyeSquint{side}"
        if squint in names:
            own = deltas[names.index(squint), self.skin]
            found[squint] = {1.0: self._full(self._squint(own))}
        pressed = self.pressed(found)
        for name, direction in look_shapes(self.side).items():
            if name in names:
                own = deltas[names.index(name), self.skin]
                found[name] = {w: self._look(direction, own, w, pressed) for w in (HALF, 1.0)}
        return found

    def pressed(self, found):
        """(n, 3) motion of the skin in a squint, beside which others must clear the ball; found: as shapes returns."""
        squint = found.get(f"eyeSquint{self.side.capitalize()}")
        return squint[1.0][self.skin] if squint else np.zeros_like(self.V)

    def raised(self, names, shapes, pressed):
        """(name, (n, 3) delta) of the shapes that raise the skin under the eye, fit to be played with what presses it.

        pressed (n, 3): as above. Each is cleared beside those before it, with and without a squint and a look down.
        """
        rest, down = np.zeros_like(self.V), next(n for n, where in look_shapes(self.side).items() if where == "Down")
        looks = [(rest, self.ball)]
        if down in names:
            looks.append((shapes[names.index(down)][self.skin], self.ball.turned(gaze_rotation("Down", self.side))))
        raised = rest
        for name in (f"{shape}{self.side.capitalize()}" for shape in _RAISING):
            if name in names:
                beside = [(raised + squint + look, ball) for squint in (rest, pressed) for look, ball in looks]
                # By itself first; beside what is raised alone it is clear if it is so with a squint besides.
                delta = self._cleared(shapes[names.index(name)], [looks[0], *beside[1:]])
                raised = raised + delta[self.skin]
                yield name, delta

    def _cleared(self, delta, beside):
        """A shape's (n, 3) delta with lids clear of a ball, and their lining behind them, beside each of some motions
        of the skin (n, 3) and the ball as it has turned then."""
        delta = delta.copy()
        for motion, ball in beside:
            pose = self.V + motion + delta[self.skin]
            delta[self.skin] += self.lining.kept_behind(self.lids.lifted(pose, ball)) - pose
        return delta

    def retraction(self, blink):
        """mm by which this eye's ball must draw back in its blink (n, 3)."""
        return needed_retraction(self.V, self.lid_faces, blink[self.skin], self.ball)

    def partners(self, names):
        """Names of the shapes that need a corrective with this eye's blink, if there is one."""
        side = self.side.capitalize()
        wanted = [*look_shapes(self.side), f"eyeSquint{side}", f"eyeWide{side}", f"cheekSquint{side}"]
        return [name for name in wanted if {name, self.blink} <= set(names)]

    def corrective(self, blink, other, name):
        """(n, 3) what blink and another shape lack together: shut lids that go with the other shape as one."""
        shut, motion = self.V + blink[self.skin], other[self.skin]
        direction = look_shapes(self.side).get(name)
        ball = self.ball.turned(gaze_rotation(direction, self.side)) if direction else self.ball
        if direction:
            # A sine: with the fuller profile of open lids the closing line would drop at the corners and run in a U.
            degrees = _SHUT_FOLLOWS * self.options.look_turn_deg[direction][1]
            turn = np.radians(degrees) * _profile(self.V[self.lids.lower])
        else:
            turn = self.lids.turn_of(shut, motion)
        return self._full(self.lids.carried(shut, motion, turn, ball), shut + motion)

    def _closing_turns(self):
        """(u,), (l,) radians that bring both margins of the neutral to the closing line, where they will have slid."""
        lids = self.lids
        slides = lids.slides(self.V)
        goals = lids.closing(self.V, slides)
        return [goal - lids.angles(self.V[line]) for goal, line in zip(goals, (lids.upper, lids.lower))]

    def diagonals(self, names):
        """Pairs of look shapes that add up to a look past a corner of the eye."""
        side = self.side.capitalize()
        pairs = [(f"eyeLook{a}{side}", f"eyeLook{b}{side}") for a in ("In", "Out") for b in ("Down", "Up")]
        return [pair for pair in pairs if set(pair) <= set(names)]

    def diagonal(self, pair, shapes, pressed):
        """(n, 3) what lifts the lids off a cornea that looks past a corner; shapes: the pair's (n, 3) deltas; pressed
        (n, 3): the skin's motion in a squint, beside which it must do so too."""
        pose = self.V + sum(shape[self.skin] for shape in shapes)
        looks = look_shapes(self.side)
        turns = [gaze_rotation(looks[name], self.side) for name in pair]
        R = Rotation.from_rotvec(sum(Rotation.from_matrix(turn).as_rotvec() for turn in turns)).as_matrix()
        ball = self.ball.turned(R)
        full = self._full(self.lids.settled(self.lids.lifted(pose, ball), ball), pose)
        full = self._cleared(full, [(pose - self.V + pressed, ball)])
        # Two turns added up as chords swell the ball: it gets the one turn that they mean.
        missing = R - turns[0] - turns[1] + np.eye(3)
        for part in eye_parts(self.face.template, self.side):
            full[part.vertex_slice] = (self.face.vertices[part.vertex_slice] - self.ball.center) @ missing.T
        return full

    def _blink(self, weight):
        slides = [weight * slide for slide in self.lids.slides(self.V)]
        passing = self.options.passing_mm * (2.0 if weight == 1.0 else 1.0)
        turns = [weight * turn for turn in self._closing_turns()]
        pose = self.lids.turned(self.V, *turns, slides=slides, passing_mm=passing)
        return self.lids.joined(pose) if weight == 1.0 else self.lids.settled(pose)

    def _wide(self, weight):
        return self._by_degrees(self.V, self.options.wide_turn_deg, weight, self.ball)

    def _squint(self, own):
        open_u, open_l = self.lids.opening(self.V)
        pose = self.V + self.squints * own
        upper, lower = self.lids.upper, self.lids.lower
        wanted_u = self.lids.angles(self.V[upper]) - self.options.squint_share[0] * open_u
        wanted_l = self.lids.angles(self.V[lower]) + self.options.squint_share[1] * open_l
        turn_u = wanted_u - self.lids.angles(pose[upper])
        turn_l = wanted_l - self.lids.angles(pose[lower])
        # Towards the canthi, which stay with the skin, the margins do too: else they would be torn off the corner.
        turns = [turn * smooth_step(from_ends(self.V[c], _CORNER_MM)) for turn, c in ((turn_u, upper), (turn_l, lower))]
        return self.lids.settled(self.lids.turned(pose, *turns, slides=self.lids.spacing(pose)))

    def _look(self, direction, own, weight, pressed):
        R = gaze_rotation(direction, self.side, weight)
        turns = self.options.look_turn_deg[direction]
        pose = self.V if any(turns) else self.V + weight * own
        ball = self.ball.turned(R)
        full = self._full(self._by_degrees(pose, turns, weight, ball))
        for part in eye_parts(self.face.template, self.side):
            offset = self.face.vertices[part.vertex_slice] - self.ball.center
            full[part.vertex_slice] = offset @ R.T - offset
        return self._cleared(full, [(pressed, ball)]) if direction in _PRESSING_LOOKS else full

    def _by_degrees(self, pose, degrees, weight, ball):
        upper, lower = (np.radians(turn) * weight * profile for turn, profile in zip(degrees, self.profiles))
        if degrees[0] < degrees[1]:
            # Towards a corner, which may be narrow, the upper margin would pass the lower one.
            at, opening = pose @ self.lids.axis, np.maximum(self.lids.opening(pose)[0], 0.0)
            least = along_line(at[self.lids.upper], at[self.lids.lower], lower) - _MOST_SHUT * opening
            upper = 0.5 * (upper + least + np.hypot(upper - least, _SOFT_SHARE * opening))
        return self.lids.settled(self.lids.turned(pose, upper, lower, ball), ball)

    def _full(self, pose, base=None):
        """(n, 3) delta of all parts that leads the skin from base (the neutral) to a pose."""
        delta = np.zeros(self.face.vertices.shape)
        delta[self.skin] = pose - (self.V if base is None else base)
        delta[max_norms(delta) < 1e-4] = 0.0
        return delta


def _profile(chain):
    """(k,) 0 at the canthi, 1 over the middle of a margin."""
    steps = arc_lengths(chain)
    return np.maximum(np.sin(np.pi * steps / steps[-1]), 0.0)
