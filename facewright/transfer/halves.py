"""Shapes of both sides cut into a left and a right half that add up to them."""

from __future__ import annotations

import numpy as np

from facewright.conventions import in_between_name


def left_share(template):
    """(n,) share of a shape that its left half gets: 1 on the person's left, 0 on the right, smooth over the lips.

    The window is as wide as the lips of the template, and by correspondence as wide as any person's; a narrow one
    kinks them. The right half gets the rest, so the two add up to the shape.
    """
    width = np.ptp(template.vertices[template.lines["lip_seam_upper"], 0])
    place = np.clip(template.vertices[:, 0] / width, -0.5, 0.5)
    return 0.5 + place * (1.5 - 2.0 * place**2)  # smoothstep, odd about the midline


def split_in_halves(template, targets, halves, in_betweens):
    """Targets of the halves, and in-betweens that these pass.

    targets  name -> (n, 3) delta; halves: sum -> (left, right); in_betweens: shape -> {weight: target}
    returns  dict name -> (n, 3), dict half -> {weight: target}
    """
    made, passed = {}, {}
    shares = left_share(template) if halves else np.empty(0)
    for name, sides in halves.items():
        for half, share in zip(sides, (shares, 1.0 - shares)):
            made[half] = targets[name] * share[:, None]
            steps = {weight: in_between_name(half, weight) for weight in in_betweens.get(name, {})}
            made |= {steps[w]: targets[target] * share[:, None] for w, target in in_betweens.get(name, {}).items()}
            if steps:
                passed[half] = steps
    return made, passed
