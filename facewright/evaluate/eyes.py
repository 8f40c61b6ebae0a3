"""How lids and eyeballs of a rig get on: as a right runtime plays it, and with the plain shapes alone."""

from __future__ import annotations

import numpy as np

from facewright.evaluate.eye_views import EyeView
from facewright.evaluate.play import Player
from facewright.evaluate.rows import Row
from facewright.mesh.closest import Surface
from facewright.mesh.radial import radial_table
from facewright.solve.procrustes import best_rotation

CORNER_SHARE = 0.15  # of a margin at either canthus: there lies the caruncle, not the ball
NEAR_MM = 24.0
BLINKS = (0.25, 0.5, 0.75, 1.0)
LOOKS = {"eyeLookIn": 30.0, "eyeLookOut": 30.0, "eyeLookDown": 30.0, "eyeLookUp": 25.0}
RADIUS_BAR_MM, LID_GAP_BAR_MM = (11.5, 12.5), 0.3
DEPTH_BAR_MM, GAP_BAR_MM = 0.2, 0.3
KINK_BAR_DEG, TURN_BAR_DEG = 20.0, 0.5
SWELL_BAR, PLAIN_SWELL_BAR = 0.01, 0.04
SEEN_BAR_MM2 = 0.05  # one pixel of the views
INSIDE_BAR_MM2 = 1.0  # where cheek and lid meet in a crease a few pixels look behind it


def eye_poses():
    """name -> weights of shapes without their side: the poses that lids must survive."""
    poses = {f"eyeBlink {weight:g}": {"eyeBlink": weight} for weight in BLINKS}
    poses |= {f"eyeBlink + {other}": {"eyeBlink": 1.0, other: 1.0} for other in ("eyeLookDown", "eyeSquint")}
    poses |= {name: {name: 1.0} for name in (*LOOKS, "eyeWide", "eyeSquint")}
    return poses | diagonal_looks() | pressing_poses()


def pressing_poses():
    """name -> weights of shapes that press the skin under the eye to the ball: smiles, disgust, looks down."""
    pressing = [
        ("eyeSquint", "cheekSquint"),
        ("eyeSquint", "noseSneer"),
        ("eyeSquint", "cheekSquint", "noseSneer"),
        ("eyeLookDown", "eyeSquint"),
        ("eyeLookDown", "cheekSquint"),
        ("eyeLookDown", "eyeSquint", "cheekSquint"),
    ]
    return {" + ".join(names): dict.fromkeys(names, 1.0) for names in pressing}


def diagonal_looks():
    """name -> weights of the four looks past a corner of the eye."""
    pairs = [(f"eyeLook{side}", f"eyeLook{way}") for side in ("In", "Out") for way in ("Up", "Down")]
    return {" + ".join(pair): dict.fromkeys(pair, 1.0) for pair in pairs}


def measure_eyes(rig, views=True):
    """dict of figures of both eyes, the worse side each.

    radius_mm, lid_gap_mm  of the eyeball; largest distance of a margin from it at rest, the outer 15 % at either
                           canthus left out
    poses      name -> {"depth_mm", "margins_mm"} for each of eye_poses: deepest outer lid vertex inside the eyeball;
               largest distance between the margins, only where the eye shall be shut
    kink_deg   sharpest bend of a closed margin beyond the neutral's own
    visible_mm2  largest area of the ball seen at eyeBlink 1 from the front, 30 degrees to each side and 30 below
    through_mm2  weight of eyeBlink -> largest area of the ball seen through lid skin, from the front and both sides
    inside_mm2   name -> the same for each of pressing_poses, and of the lining of lids, beyond what the neutral shows
    turn_deg   look shape -> angle that the ball turns at 1
    swell, swell_diagonal  share by which the ball's radius changes on the way of the looks, and of the diagonal ones
    Figures of poses are pairs: (with in-betweens and correctives, plain). Without views nothing is looked at.
    """
    players = [Player(rig, full) for full in (True, False)]
    sides = [side for side in ("left", "right") if _has_eye(rig, side, players[0].names)]
    balls = [_Ball(rig, side) for side in sides]
    if not balls:
        return {}
    ways = [{name: weight} for name in LOOKS for weight in BLINKS]
    diagonals = [dict.fromkeys(pair, weight) for pair in diagonal_looks().values() for weight in (0.5, 1.0)]
    result = {
        "radius_mm": max((ball.radius for ball in balls), key=lambda radius: abs(radius - 12.0)),
        "turn_deg": {name: min(ball.turn(players[0], {name: 1.0}) for ball in balls) for name in LOOKS},
        "swell": _worst(players, balls, lambda ball, play: max(ball.swell(play, way) for way in ways)),
        "swell_diagonal": _worst(players, balls, lambda ball, play: max(ball.swell(play, way) for way in diagonals)),
    }
    return result | (_measure_lids(rig, sides, players, views) if "eyes" in rig.regions and rig.lines else {})


def _measure_lids(rig, sides, players, views):
    """The figures of measure_eyes that need the lids' lines and regions."""
    eyes = [_Eye(rig, side) for side in sides]
    poses = {}
    for name, weights in eye_poses().items():
        poses[name] = {"depth_mm": _worst(players, eyes, lambda eye, play, w=weights: eye.depth(play, w))}
        if weights.get("eyeBlink", 0.0) == 1.0:
            poses[name]["margins_mm"] = _worst(players, eyes, lambda eye, play, w=weights: eye.margins(play, w))
    blink = {"eyeBlink": 1.0}
    result = {
        "lid_gap_mm": max(eye.lid_gap() for eye in eyes),
        "poses": poses,
        "kink_deg": _worst(players, eyes, lambda eye, play: eye.kink(play, blink)),
    }
    if views:
        result["visible_mm2"] = _worst(players, eyes, lambda eye, play: eye.seen(play, blink))
        result["through_mm2"] = {
            weight: _worst(players, eyes, lambda eye, play, w=weight: eye.seen_through_lids(play, {"eyeBlink": w}))
            for weight in BLINKS
        }
        result["inside_mm2"] = {
            name: _worst(players, eyes, lambda eye, play, w=weights: eye.inside_seen(play, w))
            for name, weights in pressing_poses().items()
        }
    return result


def _worst(players, eyes, measure):
    """The largest of a figure over both eyes, for each player."""
    return tuple(max(measure(eye, player) for eye in eyes) for player in players)


def _has_eye(rig, side, names):
    return (
        f"eyeBlink{side.capitalize()}" in names
        and f"eye_{side}" in rig.skeleton.names
        and any(mesh.name in (f"eye_{side}", f"eye_{side}_mesh") for mesh in rig.meshes)
    )


def eye_rows(rig):
    """Rows of measure_eyes beside their bars."""
    found = measure_eyes(rig)
    if not found:
        return []
    rows = [Row("eyes", "neutral", "radius mm", found["radius_mm"], bar=RADIUS_BAR_MM)]
    if "lid_gap_mm" in found:
        rows += _lid_rows(found)
    for name, turn in found["turn_deg"].items():
        bar = (LOOKS[name] - TURN_BAR_DEG, LOOKS[name] + TURN_BAR_DEG)
        rows.append(Row("eyes", name, "ball turns deg", turn, bar=bar))
    # Without in-betweens and correctives there is only the plain way, which is judged as such.
    most = SWELL_BAR if rig.in_betweens or rig.correctives else PLAIN_SWELL_BAR
    bars = {"bar": (None, most), "plain_bar": (None, PLAIN_SWELL_BAR)}
    rows.append(Row("eyes", "looks on their way", "radius changes by", *found["swell"], **bars))
    bar = (None, most)
    rows.append(Row("eyes", "diagonal looks on their way", "radius changes by", *found["swell_diagonal"], bar=bar))
    return rows


def _lid_rows(found):
    rows = [Row("eyes", "neutral", "lid gap mm", found["lid_gap_mm"], bar=(None, LID_GAP_BAR_MM))]
    for pose, figures in found["poses"].items():
        rows.append(Row("eyes", pose, "lid in ball mm", *figures["depth_mm"], bar=(None, DEPTH_BAR_MM)))
        if "margins_mm" in figures:
            rows.append(Row("eyes", pose, "margins mm", *figures["margins_mm"], bar=(None, GAP_BAR_MM)))
    rows.append(Row("eyes", "eyeBlink 1", "kink deg", *found["kink_deg"], bar=(None, KINK_BAR_DEG)))
    bar = (None, SEEN_BAR_MM2)
    rows.append(Row("eyes", "eyeBlink 1", "ball seen mm2", *found["visible_mm2"], bar=bar))
    for weight, pair in found["through_mm2"].items():
        rows.append(Row("eyes", f"eyeBlink {weight:g}", "ball through lids mm2", *pair, bar=bar, plain_bar=bar))
    bar = (None, INSIDE_BAR_MM2)
    for pose, pair in found["inside_mm2"].items():
        rows.append(Row("eyes", pose, "ball or lining through lids mm2", *pair, bar=bar, plain_bar=bar))
    return rows


def margin_gap_mm(upper, lower):
    """Largest distance of a point of either polyline (u, 3), (l, 3) from the other one."""
    return max(_to_line(upper, lower).max(), _to_line(lower, upper).max())


def _to_line(points, line):
    start, edge = line[:-1], np.diff(line, axis=0)
    share = ((points[:, None] - start) * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=1), 1e-12)
    foot = start + np.clip(share, 0.0, 1.0)[:, :, None] * edge
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)


def bends_deg(line):
    """(k - 2,) degrees between neighbouring edges of a polyline (k, 3)."""
    edges = np.diff(line, axis=0)
    edges /= np.maximum(np.linalg.norm(edges, axis=1, keepdims=True), 1e-12)
    return np.degrees(np.arccos(np.clip((edges[1:] * edges[:-1]).sum(axis=1), -1.0, 1.0)))


def eye_meshes(rig, side):
    """The meshes that turn with one eyeball, the ball itself first."""
    bone = rig.skeleton.names.index(f"eye_{side}")
    own = [mesh for mesh in rig.meshes if (mesh.skin_weights[:, bone] > 0.99).all()]
    return sorted(own, key=lambda mesh: not mesh.name.startswith(f"eye_{side}"))


class LidDepth:
    """How deep the outer lid of one eye lies in its ball, for many poses: the ball by a table of its radii.

    The ball is taken as turning rigidly, as it does with in-betweens and correctives.
    """

    def __init__(self, rig, side):
        self.skin = rig.meshes[0]
        meshes = eye_meshes(rig, side)
        self.ball = meshes[0]
        self.center = rig.skeleton.positions[rig.skeleton.names.index(f"eye_{side}")]
        near = np.linalg.norm(self.skin.vertices - self.center, axis=1) < NEAR_MM
        self.lid = np.flatnonzero(near & rig.regions["eyes"] & ~rig.regions[f"socket_{side}"])
        self.rest = self.ball.vertices - self.center
        offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
        whole = np.concatenate([mesh.vertices for mesh in meshes]) - self.center
        faces = np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets)])
        self.surface = radial_table(whole, faces, otherwise=0.0)

    def __call__(self, play, skin, weights):
        """mm; skin (n, 3) the posed skin"""
        offset = skin[self.lid] - self.center
        turned = offset
        if any(name.startswith("eyeLook") for name in weights):
            turned = offset @ best_rotation(self.rest, play(self.ball, weights) - self.center)
        return float(np.maximum(self.surface(turned) - np.linalg.norm(offset, axis=1), 0.0).max())


class _Ball:
    """One eyeball of a rig: its meshes and what its shapes do to it."""

    def __init__(self, rig, side):
        self.side = side.capitalize()
        self.meshes = eye_meshes(rig, side)
        self.ball = self.meshes[0]
        self.center = rig.skeleton.positions[rig.skeleton.names.index(f"eye_{side}")]
        self.radii = np.linalg.norm(self.ball.vertices - self.center, axis=1)
        self.radius = float(np.median(self.radii[self.ball.vertices[:, 2] < self.center[2]]))

    def turn(self, play, weights):
        """Degrees of the ball's rotation."""
        R = best_rotation(self.ball.vertices - self.center, play(self.ball, self.sided(weights)) - self.center)
        return float(np.degrees(np.arccos(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0))))

    def swell(self, play, weights):
        """Largest share by which the distance of a ball vertex from the centre changes."""
        radii = np.linalg.norm(play(self.ball, self.sided(weights)) - self.center, axis=1)
        return float(np.abs(radii / self.radii - 1.0).max())

    def sided(self, weights):
        return {name + self.side: weight for name, weight in weights.items()}


class _Eye(_Ball):
    """One eye of a rig: its ball, and the lids around it."""

    def __init__(self, rig, side):
        super().__init__(rig, side)
        self.skin = rig.meshes[0]
        socket = rig.regions[f"socket_{side}"]
        near = np.linalg.norm(self.skin.vertices - self.center, axis=1) < NEAR_MM
        self.lid = np.flatnonzero(near & rig.regions["eyes"] & ~socket)
        self.lines = [np.asarray(rig.lines[f"lid_{lid}_{side}"]) for lid in ("upper", "lower")]
        balls = [(mesh.vertices, mesh.faces) for mesh in self.meshes]
        self.view = EyeView(self.skin.vertices, self.skin.faces, balls, socket, self.center)

    def lid_gap(self):
        inner = []
        for line in self.lines:
            steps = np.linalg.norm(np.diff(self.skin.vertices[line], axis=0), axis=1)
            share = np.append(0.0, np.cumsum(steps)) / steps.sum()
            inner.append(line[(share > CORNER_SHARE) & (share < 1 - CORNER_SHARE)])
        rest = [mesh.vertices for mesh in self.meshes]
        return float(self._gap(self.skin.vertices[np.concatenate(inner)], rest).max())

    def depth(self, play, weights):
        """mm of the deepest lid vertex inside the ball."""
        balls = [play(mesh, self.sided(weights)) for mesh in self.meshes]
        return max(0.0, -float(self._gap(play(self.skin, self.sided(weights), self.lid), balls).min()))

    def margins(self, play, weights):
        """mm between the two margins."""
        return float(margin_gap_mm(*(play(self.skin, self.sided(weights), line) for line in self.lines)))

    def kink(self, play, weights):
        """Degrees of the sharpest bend of a margin beyond its own at rest."""
        bent = [bends_deg(play(self.skin, self.sided(weights), line)) for line in self.lines]
        return float(max((now - bends_deg(self.skin.vertices[line])).max() for now, line in zip(bent, self.lines)))

    def seen(self, play, weights):
        return self.view.visible_mm2(*self._pose(play, weights))

    def seen_through_lids(self, play, weights):
        return self.view.through_lids_mm2(*self._pose(play, weights))

    def inside_seen(self, play, weights):
        """mm2 of the ball and of the lining of lids seen through their skin, beyond what the neutral shows of them."""
        posed, rest = (self.view.through_lids_mm2(*self._pose(play, w), lining=True) for w in (weights, {}))
        return max(posed - rest, 0.0)

    def _pose(self, play, weights):
        weights = self.sided(weights)
        return play(self.skin, weights), [play(mesh, weights) for mesh in self.meshes]

    def _gap(self, points, balls):
        """(k,) signed distance of points from the eye's meshes, cornea included, negative inside."""
        offsets = np.cumsum([0] + [len(ball) for ball in balls])
        faces = np.concatenate([mesh.faces + offset for mesh, offset in zip(self.meshes, offsets)])
        found = Surface(np.concatenate(balls), faces).closest(points)
        foot = np.linalg.norm(found.points - self.center, axis=1)
        inside = np.linalg.norm(points - self.center, axis=1) < foot
        return np.where(inside, -found.distance, found.distance)
