"""Lids that do not sink into the eyeball when a shape moves them.

Deformation transfer knows triangles and no eyeball: on a person whose eye stands farther out than the template's, the
closed lid would cut through the cornea. Every lid vertex that comes closer to the ball than it does on the template is
pushed outwards along the ray from the eye's centre, as a smooth function of its own gap, so no crease appears.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.solve.procrustes import best_rotation
from facewright.transfer.eyeball import carried_eyeball, eye_parts, lid_clearance, measure_eyeball

_MOVES_MM = 0.02


@dataclass(frozen=True)
class ContactOptions:
    """gap_mm     distance of the margin from the ball
    skin_clear_mm distance of the lids' outer skin from the ball, away from the margin
    soft_mm       width over which the push sets in
    """

    gap_mm: float = 0.15
    skin_clear_mm: float = 0.8
    soft_mm: float = 0.4


def clear_lids(face, deltas, options=None):
    """Shapes (s, n, 3) of a face whose lids come no closer to the eyeballs than the template's do: (s, n, 3) mm.

    face  data.Face with its parts in place; deltas from face.vertices. On the template itself nothing changes.
    """
    options = options or ContactOptions()
    result = np.array(deltas)
    for side in ("left", "right"):
        lid = _lid_vertices(face, side)
        margin = np.unique(np.concatenate([face.lines[f"lid_{lid_name}_{side}"] for lid_name in ("upper", "lower")]))
        person = _Gaps(face.template, face.vertices, deltas, carried_eyeball(face.template, face.vertices, side), side)
        own = _Gaps(
            face.template, face.template.vertices, face.template.deltas, measure_eyeball(face.template, side), side
        )
        scale = person.ball.radius / own.ball.radius
        clear = lid_clearance(face.vertices[lid], face.vertices[margin], options.gap_mm, options.skin_clear_mm)
        for k in range(len(deltas)):
            moves = np.linalg.norm(deltas[k, lid], axis=1) > _MOVES_MM
            if not moves.any():
                continue
            at = lid[moves]
            wanted, direction = person.missing(at, k, clear[moves], 1.0, options.soft_mm)
            allowed, _ = own.missing(at, k, clear[moves], scale, options.soft_mm)
            result[k, at] += np.maximum(wanted - allowed, 0.0)[:, None] * direction
    return result


class _Gaps:
    """Distances of a head's lid vertices from its eyeball, at rest and under its shapes."""

    def __init__(self, template, vertices, deltas, ball, side):
        self.vertices, self.deltas, self.ball = vertices, deltas, ball
        self.eye = [part.vertex_slice for part in eye_parts(template, side)]

    def missing(self, index, shape, clear, scale, soft_mm):
        """(k,) mm by which vertices come too close under a shape, and (k, 3) directions away from the eye's centre.

        Too close is closer than clear (k,), or than at rest where that is less. Gaps count times scale; the measure is
        0 far outside, the whole depth inside, and smooth in between.
        """
        points, ball = self.vertices[index], self.ball
        rest = scale * ball.gap(points)
        points, ball = points + self.deltas[shape, index], self._turned(shape)
        floor = np.minimum(rest, clear)
        offset = points - ball.center
        missing = _soft(floor - scale * ball.gap(points), soft_mm) - _soft(floor - rest, soft_mm)
        return missing, offset / np.linalg.norm(offset, axis=1, keepdims=True)

    def _turned(self, shape):
        """The ball under a shape that turns the eye: its cornea looks elsewhere."""
        part = self.eye[0]
        if not self.deltas[shape, part].any():
            return self.ball
        R = best_rotation(self.vertices[part], self.vertices[part] + self.deltas[shape, part])
        return self.ball.turned(R)


def _lid_vertices(face, side):
    """Vertices of the outer skin near one eye."""
    ball = carried_eyeball(face.template, face.vertices, side)
    near = np.linalg.norm(face.vertices - ball.center, axis=1) < 2.0 * ball.radius
    return np.flatnonzero(face.regions["eyes"] & near & ~face.regions[f"socket_{side}"])


def _soft(value, width):
    """The positive part of values, rounded over a width."""
    return 0.5 * (value + np.sqrt(value**2 + width**2))
