"""Everything that must hold for a finished rig, as rows of figures beside their bars."""

from __future__ import annotations

from facewright.evaluate.blends import blend_rows
from facewright.evaluate.expressions import expression_rows
from facewright.evaluate.eyes import eye_rows
from facewright.evaluate.lashes import lash_rows
from facewright.evaluate.mouth import lip_crossing, mouth_rows
from facewright.evaluate.rig import measure_jaw
from facewright.evaluate.rows import Row
from facewright.evaluate.shapes import shape_rows
from facewright.evaluate.teeth import teeth_rows

BLENDS = 1000


def rig_rows(rig, blends=BLENDS, own_crossings=None):
    """list of rows.Row of a data.Rig: eyes, mouth, jaw, teeth, lashes, shapes, expressions, `blends` blends, a fifth as
    many mixes.

    own_crossings  shapes.crossings of the template's own head, or None
    What a rig does not say (a GLB has no regions and no feature lines) is left out.
    """
    whole = bool(rig.regions and rig.lines)
    rows = [*eye_rows(rig), *(mouth_rows(rig) if whole else ()), *(jaw_rows(rig) if whole else ())]
    rows += [
        *(teeth_rows(rig) if whole else ()),
        *lash_rows(rig),
        *shape_rows(rig, own_crossings),
        *expression_rows(rig),
    ]
    return rows + blend_rows(rig, blends, lip_crossing(rig) if whole else None) if blends else rows


def jaw_rows(rig):
    """Rows: how far jawOpen is from the jaw bone's turn, without a bar."""
    found = measure_jaw(rig)
    if found is None:
        return []
    return [
        Row("jaw", "jawOpen", "teeth from the bone's mm", found["teeth_mm"]),
        Row("jaw", "jawOpen", "skin from the bone's, mean mm", found["skin_mean_mm"]),
        Row("jaw", "jawOpen", "hinge before the ear mm", found["before_ear_mm"]),
    ]
