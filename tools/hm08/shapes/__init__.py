"""The 52 ARKit shapes of the template: sketched by rule, or cleaned from hm08's own face units."""

from __future__ import annotations

import numpy as np

from facewright.conventions import ARKIT_SHAPES, mirrored_name
from hm08.carry import carry_nostrils
from hm08.shapes.canvas import Canvas
from hm08.shapes.eyes import just_closing
from hm08.shapes.fair import Fairing, Masks, falloff, symmetrised
from hm08.shapes.jaw import closing, rounded
from hm08.shapes.sketch import FLIP, Studio, left_half, read_sketches, symmetric_field

LIDS_FAIR_MM, FAIR_MM = 2.5, 4.5  # waves of a face unit shorter than about this are taken for noise
STILL_MM = (0.02, 0.10)  # motion below the first is none, above the second all


def build_shapes(raw, control, head, regions, jaw):
    """(52, n, 3) deltas of the skin from raw (52, c_skin, 3) control deltas; jaw (R, t) its motion in jawOpen."""
    masks, nostrils = Masks(head, regions), carry_nostrils(control)
    lids, rest = Fairing(head, LIDS_FAIR_MM), Fairing(head, FAIR_MM)
    places, folds, sketches = read_sketches()
    studio = Studio(Canvas(head, regions, places), folds)
    raw = dict(zip(ARKIT_SHAPES, symmetrised(raw, control.mirror[: control.n_skin])))
    made = {}
    for name in ARKIT_SHAPES:
        sketch = sketches.get(name.removesuffix("Left"), sketches.get(name))
        twin = mirrored_name(name)
        if twin in made:
            made[name] = made[twin][head.mirror] * FLIP
        elif name == "mouthClose":
            made[name] = closing(head, made["jawOpen"], *jaw)
        elif sketch is None:
            fair = lids if name.startswith("eye") else rest
            field = fair(head.S @ (nostrils @ raw[name])) * masks.of(name)[:, None]
            if name == "eyeBlinkLeft":
                field = just_closing(head, field)
            made[name] = rounded(head, field) if name == "jawOpen" else field
        else:
            field = settled(studio.field(sketch) * masks.of(name)[:, None])
            made[name] = left_half(head.V, field) if sketch.get("side") else field
        if twin == name:
            made[name] = symmetric_field(made[name], head.mirror)
    out = np.stack([made[name] for name in ARKIT_SHAPES])
    out[np.abs(out).max(axis=2) < 0.005] = 0.0
    return out


def settled(field):
    """A field without its long thin tail: what hardly moves rests."""
    return field * (1.0 - falloff(np.linalg.norm(field, axis=1), STILL_MM))[:, None]
