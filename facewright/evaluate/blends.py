"""Random poses as animation meets them: blends of expressions and visemes, and mixes of any eight shapes."""

from __future__ import annotations

import numpy as np

from facewright.blending import possible, random_blends
from facewright.evaluate.eyes import LidDepth
from facewright.evaluate.play import Player
from facewright.evaluate.rows import Row
from facewright.evaluate.shapes import SkinCheck, shape_names

SEED = 20
BAR_MM, SHARE_BAR = 0.5, 0.99
MIXED = 8


def random_mixes(names, count, seed=SEED, mixed=MIXED):
    """count poses of `mixed` shapes each at even weights in 0..1."""
    rng = np.random.default_rng(seed)
    names = list(names)
    return [
        possible({names[i]: rng.random() for i in rng.choice(len(names), min(mixed, len(names)), replace=False)})
        for _ in range(count)
    ]


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
        figures = measure_blends(rig, random_blends(rig.expressions, rig.visemes, count, SEED), lips)
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
