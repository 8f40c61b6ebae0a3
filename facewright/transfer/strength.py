"""How strong a shape is on a person, read off the feature lines of the mouth.

Deformation transfer scales motion with the triangles it passes, and spreads what contradicts itself; so a smile may end
a tenth too wide or too narrow for the mouth that it is on. What the eye compares is the lines (Xu et al. 2014, as used
in 2019 "facial rigs" 3.5): their points should travel as far, in lengths of the mouth, as the template's do.
"""

from __future__ import annotations

import numpy as np

LINES = ("lip_seam_upper", "lip_seam_lower", "lip_outer_upper", "lip_outer_lower")
_LEAST_MM = 0.3  # mean motion of the lines under which a shape is not about the mouth
_LIMITS = (0.8, 1.25)


def line_strengths(source, target, deltas, carried, lines, rotation):
    """(s,) factors for shapes carried (s, n, 3) mm to the target so that the mouth's lines move by their measure.

    source, target (n, 3) mm neutrals, deltas (s, n, 3) of the source, lines name -> vertices, rotation (3, 3) source to
    target. 1 where a shape hardly moves the lines; on the source itself exactly 1.
    """
    found = [line for line in LINES if line in lines]
    if not found:
        return np.ones(len(deltas))
    index = np.concatenate([np.asarray(lines[line]) for line in found])
    size = sum(_length(target[lines[line]]) for line in found) / sum(_length(source[lines[line]]) for line in found)
    wanted = size * deltas[:, index] @ rotation.T
    got = carried[:, index]
    power = (got**2).sum(axis=(1, 2))
    factors = (got * wanted).sum(axis=(1, 2)) / np.maximum(power, 1e-12)
    moves = np.linalg.norm(wanted, axis=2).mean(axis=1) > _LEAST_MM
    return np.where(moves, np.clip(factors, *_LIMITS), 1.0)


def _length(chain):
    return np.linalg.norm(np.diff(chain, axis=0), axis=1).sum()
