"""Everything that must hold for a finished rig, as rows of figures beside their bars."""

from __future__ import annotations

from facewright.evaluate.blends import blend_rows
from facewright.evaluate.expressions import expression_rows
from facewright.evaluate.eyes import eye_rows
from facewright.evaluate.shapes import shape_rows

BLENDS = 1000


def rig_rows(rig, blends=BLENDS):
    """list of rows.Row of a data.Rig: eyes, shapes, expressions, `blends` random blends, a fifth as many random mixes.

    What a rig does not say (a GLB has no regions and no feature lines) is left out.
    """
    rows = [*eye_rows(rig), *shape_rows(rig), *expression_rows(rig)]
    return rows + blend_rows(rig, blends) if blends else rows
