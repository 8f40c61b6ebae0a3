"""Random poses as animation meets them: blends of expressions and visemes, and mixes of any eight shapes."""

from __future__ import annotations

import numpy as np

from facewright.evaluate.eyes import LidDepth
from facewright.evaluate.play import Player
from facewright.evaluate.rows import Row
from facewright.evaluate.shapes import SkinCheck, shape_names

SEED = 20
BAR_MM, SHARE_BAR = 0.5, 0.99
MIXED = 8
# Shapes that no face makes together: the weaker is left out.
OPPOSED = (("eyeLookUp", "eyeLookDown"), ("eyeLookIn", "eyeLookOut"), ("eyeWide", "eyeBlink"), ("eyeWide", "eyeSquint"))
OPPOSED_MIDDLE = (("jawLeft", "jawRight"), ("mouthLeft", "mouthRight"))


def random_blends(expressions, visemes, count, seed=SEED):
    """count poses {shape: weight}: two expressions faded into each other, and a viseme that speaks at the same time.

    Both fade and the strengths of expression and viseme are even in 0..1; weights add up and end at 1.
    """
    rng = np.random.default_rng(seed)
    faces, words = list(expressions.values()), list(visemes.values())
    poses = []
    for _ in range(count):
        one, other = (faces[i] for i in rng.integers(len(faces), size=2))
        fade, strength, speech = rng.random(3)
        parts = ((one, strength * (1 - fade)), (other, strength * fade), (words[rng.integers(len(words))], speech))
        poses.append(possible(_sum(parts)))
    return poses


def random_mixes(names, count, seed=SEED, mixed=MIXED):
    """count poses of `mixed` shapes each at even weights in 0..1."""
    rng = np.random.default_rng(seed)
    names = list(names)
    return [
        possible({names[i]: rng.random() for i in rng.choice(len(names), min(mixed, len(names)), replace=False)})
        for _ in range(count)
    ]


def possible(weights):
    """A pose that a face could make: of opposed shapes the stronger, mouthClose no more than jawOpen.

    mouthClose is made on top of jawOpen and is no pose without it; the tongue comes out between open teeth.
    """
    result = {name: min(weight, 1.0) for name, weight in weights.items() if weight > 0.0}
    pairs = [(a + side, b + side) for a, b in OPPOSED for side in ("Left", "Right")]
    for a, b in (*pairs, *OPPOSED_MIDDLE):
        if a in result and b in result:
            del result[a if result[a] < result[b] else b]
    for name, share in (("mouthClose", 1.0), ("tongueOut", 2.0)):
        if name in result:
            result[name] = min(result[name], share * result.get("jawOpen", 0.0))
    return result


def measure_blends(rig, poses, lips=None):
    """dict of arrays (k, 2): figures of poses, with in-betweens and correctives, and plain.

    lids_mm  depth of the deepest lid vertex in an eyeball; folded  faces outside the inner mouth
    lips_mm  depth of a lip in the other one, by lips: function (skin (n, 3)) -> mm; left out without it
    """
    players = [Player(rig, full) for full in (True, False)]
    lids = [LidDepth(rig, side) for side in ("left", "right")] if "eyes" in rig.regions else []
    check = SkinCheck(rig)
    found = {"lids_mm": [], "folded": []} | ({"lips_mm": []} if lips else {})
    for pose in poses:
        skins = [play(check.skin, pose) for play in players]
        if lids:
            depths = [max(lid(play, skin, pose) for lid in lids) for play, skin in zip(players, skins)]
            found["lids_mm"].append(depths)
        found["folded"].append([len(check.folded(skin)) for skin in skins])
        if lips:
            found["lips_mm"].append([lips(skin) for skin in skins])
    return {name: np.array(values) for name, values in found.items() if values}


def blend_rows(rig, count=1000, lips=None):
    """Rows of random blends of the rig's expressions and visemes, and of random mixes (these without a bar)."""
    rows = []
    if rig.expressions and rig.visemes:
        figures = measure_blends(rig, random_blends(rig.expressions, rig.visemes, count), lips)
        rows += _rows(figures, f"{count} blends of expressions", (SHARE_BAR, None), (None, 0))
    mixes = random_mixes(shape_names(rig), max(count // 5, 1))
    return rows + _rows(measure_blends(rig, mixes, lips), f"{len(mixes)} mixes of {MIXED} shapes")


def _rows(figures, pose, share_bar=(None, None), fold_bar=(None, None)):
    rows = []
    for name in ("lids_mm", "lips_mm"):
        if name in figures:
            shares = (figures[name] <= BAR_MM).mean(axis=0)
            what = name.removesuffix("_mm")
            rows.append(Row("blends", pose, f"{what} within {BAR_MM} mm, share", *map(float, shares), bar=share_bar))
            rows.append(Row("blends", pose, f"{what} worst mm", *map(float, figures[name].max(axis=0))))
    with_folds = (figures["folded"] > 0).mean(axis=0)
    rows.append(Row("blends", pose, "poses with a folded face, share", *map(float, with_folds), bar=fold_bar))
    rows.append(Row("blends", pose, "folded faces, worst", *map(float, figures["folded"].max(axis=0))))
    return rows


def _sum(parts):
    total = {}
    for weights, strength in parts:
        for name, weight in weights.items():
            total[name] = total.get(name, 0.0) + strength * weight
    return total
