"""From the fit to the neutral: the expression that the scan wears is taken out by deformation transfer."""

from __future__ import annotations

import numpy as np

from facewright.transfer.deformation import deformation_transfer

# Less than this of a shape is taken for the person's own rest face.
REMOVE_FROM = 0.15


def take_out_expression(template, fit, expression):
    """The neutral (n, 3) of a fit (n, 3) that wears expression {shape: weight}, and what was removed.

    Transfers the way back, from the template wearing the same expression to the template at rest, onto the fit. Shapes
    under REMOVE_FROM stay: what a model calls a tenth of a smile is more likely a face.
    """
    removed = {name: weight for name, weight in expression.items() if weight >= REMOVE_FROM}
    if not removed:
        return fit, removed
    way = sum(weight * template.shape(name) for name, weight in removed.items())
    still = np.linalg.norm(way, axis=1) < 0.02
    moving = ~still
    fixed = still & template.regions["skin"]
    delta = deformation_transfer(template.vertices + way, fit, template.faces, -way[None], fixed=fixed | _far(moving))[0]
    return fit + delta, removed


def _far(moving):
    return ~moving
