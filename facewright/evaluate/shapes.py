"""Is every shape of a rig sound: folds, tears, crossings, reach and size; and do left and right agree."""

from __future__ import annotations

import numpy as np

from facewright.conventions import EYE_PAIRS, INTERPUPILLARY_MM, MOUTH_PAIRS, TONGUE_PAIR, mirrored_name
from facewright.evaluate.eyes import margin_gap_mm
from facewright.evaluate.play import Player, both_sides
from facewright.evaluate.quality import torn_edges
from facewright.evaluate.rows import Row
from facewright.mesh.adjacency import touching, unique_edges
from facewright.mesh.folds import folded_by_shape
from facewright.mesh.intersect import self_intersections
from facewright.working_set import read_working_set, region_depth

MIRROR_X = np.array([-1.0, 1.0, 1.0])
SWAPPED = {"jawLeft": "jawRight", "mouthLeft": "mouthRight"}
MOVES_MM = 0.1
MIRROR_BAR_MM = 0.01
BASES = {"mouthClose": "jawOpen"}
EYE_OPENING_MM = 11.0  # of the eye that a blink's amplitude is said of: a lid goes no farther than its eye is open
_STILL_MM = 1e-4


class SkinCheck:
    """The skin of a Rig, asked how sound it is in any pose.

    Folds, tears and crossings are looked for outside the inner mouth, where the rig says what that is.
    """

    def __init__(self, rig):
        self.rig, self.skin = rig, rig.meshes[0]
        n = len(self.skin.vertices)
        inner = rig.regions.get("mouth_interior", np.zeros(n, bool))
        self.outside = ~inner
        self.outer = rig.regions.get("outer", np.ones(n, bool))
        self._asked = self.outside[self.skin.faces].all(axis=1)
        self._edges = unique_edges(self.skin.faces)
        self._before = None
        self._face = rig.regions.get("face", np.ones(n, bool))[self.skin.faces].all(axis=1)

    def folded(self, moved):
        """Indices of folded faces of a pose (n, 3)."""
        return folded_by_shape(self.skin.vertices, moved, self.skin.faces, self._asked)

    def torn(self, moved):
        """(k, 2) torn edges."""
        return torn_edges(self.skin.vertices, moved, self.skin.faces, self.outside, edges=self._edges)

    def crossing(self, moved):
        """Number of crossing pairs, one in the face, that the neutral has not; only what moves is looked at."""
        rest, faces = self.skin.vertices, self.skin.faces
        going = np.abs(moved - rest).max(axis=1) > _STILL_MM
        if not going.any():
            return 0
        low, high = moved[going].min(axis=0) - 1.0, moved[going].max(axis=0) + 1.0
        near = going | ((rest > low) & (rest < high)).all(axis=1)
        now = self_intersections(moved, faces, touching(near, faces))
        now = now[self._face[now].any(axis=1)]
        if self._before is None:
            self._before = _pair_keys(self_intersections(rest, faces), faces)
        return int((~np.isin(_pair_keys(now, faces), self._before)).sum())


def _pair_keys(pairs, faces):
    return pairs[:, 0] * len(faces) + pairs[:, 1]


def eye_scale(rig):
    """Factor that brings millimetres of a rig to a head with 63 mm between the eyes; 1 where it has no eyes."""
    names = rig.skeleton.names
    if not {"eye_left", "eye_right"} <= set(names):
        return 1.0
    left, right = (rig.skeleton.positions[names.index(f"eye_{side}")] for side in ("left", "right"))
    return INTERPUPILLARY_MM / float(np.linalg.norm(left - right))


def shape_names(rig):
    """The rig's own shapes, without in-betweens, correctives and halves."""
    return rig.plain().target_names


def measure_shapes(rig):
    """dict shape -> {"max_mm", "folded", "torn", "self_intersections"} of the skin at weight 1.

    mouthClose is made for an open jaw: its folds and crossings are those of the pose with jawOpen.
    Halves stand beside their sums.
    """
    check, play = SkinCheck(rig), Player(rig, full=True)
    result = {}
    halves = [half for pair in rig.halves.values() for half in pair if half in rig.target_names]
    for name in (*shape_names(rig), *halves):
        weights = with_base(name, play.names)
        moved = play(check.skin, weights)
        alone = play(check.skin, {name: 1.0}) - check.skin.vertices
        result[name] = {
            "max_mm": float(np.linalg.norm(alone, axis=1).max()),
            "folded": len(check.folded(moved)),
            "torn": len(check.torn(moved)),
            "self_intersections": check.crossing(moved),
        }
    return result


def with_base(name, names):
    """The pose that shows a shape: at 1, with jawOpen where it is made for an open jaw."""
    base = BASES.get(name)
    return {name: 1.0} | ({base: 1.0} if base in names else {})


def stray_mm(rig):
    """shape -> (mm at 63 mm between the eyes by which it moves outer skin outside its region, at most)."""
    words, play = read_working_set(), Player(rig, full=True)
    skin = rig.meshes[0]
    masks, result = {}, {}
    for name in shape_names(rig):
        word = words.words.get(name)
        if word is None:
            continue
        key = (word.region, word.side)
        if key not in masks:
            region = words.regions[word.region]
            masks[key] = region_depth(skin.vertices, rig.lines, region, word.side, eye_scale(rig)) > 0.0
        beyond = rig.regions["outer"] & ~masks[key]
        motion = np.linalg.norm(play(skin, {name: 1.0}) - skin.vertices, axis=1)
        result[name] = float(motion[beyond].max(initial=0.0)) * eye_scale(rig)
    return result


def amplitudes(rig):
    """shape -> how far it goes at weight 1, measured where working_set.Word.at says; gaze is left to evaluate.eyes.

    In mm at 63 mm between the eyes; a lid's margin in mm of an eye that opens EYE_OPENING_MM.
    """
    words, play = read_working_set().words, Player(rig, full=True)
    skin, scale = rig.meshes[0], eye_scale(rig)
    tongue = [mesh for mesh in rig.meshes if mesh.name == "tongue"]
    result = {}
    for name in shape_names(rig):
        word = words.get(name)
        if word is None or word.at == "gaze" or (word.at == "tongue" and not tongue):
            continue
        mesh = tongue[0] if word.at == "tongue" else skin
        motion = np.linalg.norm(play(mesh, {name: 1.0}) - mesh.vertices, axis=1) * scale
        if word.at == "margin":
            upper, lower = (rig.lines[f"lid_{lid}_{word.side}"] for lid in ("upper", "lower"))
            opening = margin_gap_mm(skin.vertices[upper], skin.vertices[lower])
            motion = motion[upper] * (EYE_OPENING_MM / (scale * opening))
        elif word.at == "corner":
            seam = rig.lines["lip_seam_upper"]  # from the person's right to the left
            motion = motion[[seam[-1] if word.side == "left" else seam[0]]]
        elif word.at == "skin":
            motion = motion[rig.regions["outer"]]
        result[name] = float(motion.max())
    return result


def mirror_mm(rig, mirror):
    """shape -> mm by which it differs from the mirror image of its namesake; for a symmetric head.

    mirror (n_skin,) twin of each skin vertex
    """
    play, skin = Player(rig, full=False), rig.meshes[0]
    swapped = SWAPPED | {other: name for name, other in SWAPPED.items()}
    deltas = {name: play(skin, {name: 1.0}) - skin.vertices for name in shape_names(rig)}
    result = {}
    for name, delta in deltas.items():
        other = deltas[swapped.get(name, mirrored_name(name))]
        result[name] = float(np.abs(delta - other[mirror] * MIRROR_X).max())
    return result


def pair_crossings(rig):
    """ "a + b" -> new crossing pairs of faces in each of the pairs that lids and lips must survive, and with the tongue
    out of an open mouth."""
    check, play = SkinCheck(rig), Player(rig, full=True)
    pairs = (*EYE_PAIRS, *MOUTH_PAIRS, TONGUE_PAIR)
    poses = {" + ".join(pair): both_sides(dict.fromkeys(pair, 1.0), play.names) for pair in pairs}
    return {name: check.crossing(play(check.skin, weights)) for name, weights in poses.items() if weights is not None}


def crossings(rig):
    """Pose -> number of crossing pairs of faces, one in the face, that the neutral has not: shapes and pairs."""
    singles = {_pose(name, rig): figures["self_intersections"] for name, figures in measure_shapes(rig).items()}
    return singles | pair_crossings(rig)


def _pose(name, rig):
    return " + ".join(with_base(name, rig.target_names))


def shape_rows(rig, own=None):
    """Rows of every shape: folded, torn, crossings of shapes and pairs, stray motion, amplitude.

    own  crossings of the template's own head: what a rig may have too; None: no bar
    """
    rows, crossing = [], {}
    for name, figures in measure_shapes(rig).items():
        pose = _pose(name, rig)
        rows.append(Row("shapes", pose, "folded faces", figures["folded"], bar=(None, 0)))
        rows.append(Row("shapes", pose, "torn edges", figures["torn"], bar=(None, 0)))
        crossing[pose] = figures["self_intersections"]
    for pose, value in (crossing | pair_crossings(rig)).items():
        bar = (None, None) if own is None else (None, own.get(pose, 0))
        rows.append(Row("shapes", pose, "new self-intersections", value, bar=bar))
    if {"outer", "eyes"} <= set(rig.regions) and rig.lines:
        for name, value in stray_mm(rig).items():
            rows.append(Row("shapes", name, "moves outside its region mm", value, bar=(None, MOVES_MM)))
        words = read_working_set().words
        for name, value in amplitudes(rig).items():
            rows.append(Row("shapes", name, f"amplitude mm ({words[name].at})", value, bar=words[name].amplitude))
    return rows
