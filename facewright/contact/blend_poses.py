"""Poses in which a head's shapes are asked together, the same for every head."""

from __future__ import annotations

from facewright.blending import all_blends
from facewright.conventions import EYE_PAIRS, MOUTH_PAIRS, TONGUE_PAIR
from facewright.transfer.shapes import CORRECTIVE_BASE
from facewright.working_set import read_working_set

_ON_WAY, _FINE = (0.4, 0.75, 1.0), (0.2, 0.35, 0.5, 0.6, 0.75, 0.85, 0.93, 1.0)  # weights of shapes, with in-betweens
_LIDS, _LOOKS = (0.15, 0.3, 0.45, 0.6, 0.8), (0.35, 0.65, 1.0)  # weights of a blink, and of the looks with it
_BOTH = (1.0, 1.0), (0.83, 0.83), (0.65, 0.65), (0.9, 0.5), (0.5, 0.9)  # weights of two shapes with a corrective
_DIRECTIONS = (("Up",), ("Down",), ("In",), ("Out",), ("In", "Up"), ("In", "Down"), ("Out", "Up"), ("Out", "Down"))


def sample_poses(targets):
    """list of {shape: weight}: shapes on their way, looks with lids half shut, blends of the working set."""
    poses = []
    for names in together(targets.names):
        for weight in _FINE if names[0] in targets.in_betweens else _ON_WAY:
            bases = {CORRECTIVE_BASE[name]: weight for name in names if CORRECTIVE_BASE.get(name) in targets.names}
            poses.append(dict.fromkeys(names, weight) | bases)
    for blink in _LIDS:
        for looks in _DIRECTIONS:
            for look in _LOOKS:
                weights = {"eyeBlink": blink} | {f"eyeLook{direction}": look for direction in looks}
                poses.append({name + side: w for name, w in weights.items() for side in ("Left", "Right")})
    for drivers in targets.correctives.values():
        poses += [dict(zip(drivers, weights)) for weights in _BOTH if not drivers[0].startswith("eye")]
    poses += pair_poses(targets)
    words = read_working_set()
    poses += all_blends(words.expressions, words.visemes)
    known = set(targets.names)
    return [{name: weight for name, weight in pose.items() if name in known} for pose in poses]


def plain_poses(targets):
    """list of {shape: weight}: each shape, and the pairs that lids and lips must survive, as they are at the end."""
    known, poses = set(targets.names), []
    for names in together(targets.names):
        bases = {CORRECTIVE_BASE[name]: 1.0 for name in names if CORRECTIVE_BASE.get(name) in known}
        poses.append(dict.fromkeys(names, 1.0) | bases)
    return poses + pair_poses(targets)


def pair_poses(targets):
    """list of {shape: weight}: the pairs that lids and lips must survive."""
    known, poses = set(targets.names), []
    for pair in (*EYE_PAIRS, *MOUTH_PAIRS, TONGUE_PAIR):
        sided = {name + side for name in pair for side in ("", "Left", "Right")}
        poses.append(dict.fromkeys(sorted(sided & known), 1.0))
    return poses


def together(names):
    """Tuples of shapes that can be asked at once: the two eyes are far from each other, all else stands alone."""
    right = {name.removesuffix("Left") + "Right" for name in names if name.startswith("eye") and name.endswith("Left")}
    for name in names:
        other = name.removesuffix("Left") + "Right"
        if name not in right:
            yield (name, other) if other in right and other in names else (name,)
