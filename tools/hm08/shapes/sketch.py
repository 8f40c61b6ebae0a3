"""Shapes from sketches.toml: a few displacements, lip sections and folds each."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from hm08.shapes.folds import Fold
from hm08.shapes.wrinkles import LipLines

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SKETCHES = Path(__file__).with_name("sketches.toml")
SIDES_MM = 22.0  # half the width over which left hands over to right: the lips' own; less kinks them
FLIP = np.array([-1.0, 1.0, 1.0])


def read_sketches():
    """places name -> (x, y) mm; folds name -> places; shapes name -> sketch."""
    content = tomllib.loads(SKETCHES.read_text(encoding="utf-8"))
    return content["places"], content["folds"], content["shapes"]


class Studio:
    """Makes fields of sketches on a Canvas."""

    def __init__(self, canvas, folds):
        self.canvas = canvas
        self.folds = {name: Fold(canvas, through) for name, through in folds.items()}
        self.lip_lines = LipLines(canvas.head)

    def field(self, sketch):
        """(n, 3) displacement of a sketch: of both sides where it is symmetric or tells of the right one too."""
        canvas = self.canvas
        points = [(name, 1, np.array(d)) for name, d in sketch["points"].items()]
        other = sketch.get("right", {})
        points += [
            (name, -1, np.array(other[name]) if name in other else d * FLIP)
            for name, _, d in points
            if canvas.off_middle(name)
        ]
        lines = self._lips(sketch) + canvas.lids(sketch.get("lower_lid_deg", 0.0))
        field = canvas.field(points, lines, sketch.get("reach_mm", 45.0))
        for fold in sketch.get("folds", []):
            values = {key: value for key, value in fold.items() if key != "line"}
            left = self.folds[fold["line"]](canvas.V + field, canvas.F, **values)
            field = field + left + left[canvas.mirror] * FLIP
        if "lip_lines_mm" in sketch:
            left = self.lip_lines(canvas.V + field, canvas.F, sketch["lip_lines_mm"])
            field = field + left + left[canvas.mirror] * FLIP
        return field if other else symmetric_field(field, canvas.mirror)

    def _lips(self, sketch):
        """[(vertices, displacements, weights)] of both halves of the lips."""
        if "upper" not in sketch:
            return []
        canvas, section = self.canvas, self.canvas.section
        halves = {side: [np.array(sketch.get(key + side, [])) for key in ("upper", "lower")] for side in ("", "_right")}
        upper, lower = (
            (left, right if len(right) else left * FLIP) for left, right in zip(halves[""], halves["_right"])
        )
        turns = [sketch.get("turn_upper", [0.0]), sketch.get("turn_lower", [0.0])]
        left = section.moved(canvas.V, upper, lower, *turns)
        right = section.moved(canvas.V, *((b * FLIP, a * FLIP) for a, b in (upper, lower)), *turns) * FLIP
        weights, twins = section.weights(), canvas.mirror[section.vertices]
        off_middle = twins != section.vertices
        return [
            (section.vertices, left, weights),
            (twins[off_middle], right[off_middle], weights[off_middle]),
        ]


def symmetric_field(field, mirror):
    return 0.5 * (field + field[mirror] * FLIP)


def left_half(V, field, half_width_mm=SIDES_MM):
    """(n, 3) a symmetric field on the left, handed over to the right smoothly: it and its mirror image add up to it."""
    t = np.clip(0.5 + 0.5 * V[:, 0] / half_width_mm, 0.0, 1.0)
    return field * (t * t * t * (t * (6 * t - 15) + 10))[:, None]
