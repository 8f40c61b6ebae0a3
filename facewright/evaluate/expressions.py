"""Do a rig's expressions hold every shape, and how far do the shapes of one expression lie over each other."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from facewright.evaluate.play import Player
from facewright.evaluate.rows import Row
from facewright.evaluate.shapes import shape_names


def overlaps(rig):
    """expression -> (overlap, shape, shape) of the two of its shapes that lie over each other most.

    Overlap is the cosine between the sizes of their motions over the skin: 0 where no vertex moves under both, 1 where
    both move the same vertices alike. Left and Right of one shape are taken together.
    """
    play, skin = Player(rig, full=False), rig.meshes[0]
    sizes = {}

    def size(name, names):
        key = tuple(names)
        if key not in sizes:
            moved = play(skin, dict.fromkeys(names, 1.0)) - skin.vertices
            sizes[key] = np.linalg.norm(moved, axis=1)
        return name, sizes[key]

    result = {}
    for expression, weights in rig.expressions.items():
        groups: dict[str, list[str]] = {}
        for name in weights:
            side = next((s for s in ("Left", "Right") if name.endswith(s) and len(name) > len("mouthRight")), "")
            groups.setdefault(name.removesuffix(side) if side else name, []).append(name)
        found = [size(name, names) for name, names in groups.items()]
        pairs = [(_cosine(a, b), one, other) for (one, a), (other, b) in combinations(found, 2)]
        result[expression] = max(pairs) if pairs else (0.0, "", "")
    return result


def _cosine(a, b):
    return float(a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-12))


def expression_rows(rig):
    """Rows: how many shapes no expression holds, and the overlap in each (without a bar)."""
    if not rig.expressions:
        return []
    held = {name for weights in rig.expressions.values() for name in weights}
    missing = [name for name in shape_names(rig) if name not in held]
    rows = [Row("expressions", f"all {len(rig.expressions)}", "shapes in none of them", len(missing), bar=(None, 0))]
    for expression, (overlap, one, other) in overlaps(rig).items():
        rows.append(Row("expressions", expression, f"overlap of {one}, {other}", overlap))
    return rows
