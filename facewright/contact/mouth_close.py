"""mouthClose by rule: the neutral's own closed lips, carried by the jaw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.seam import seam_sides
from facewright.mesh.spread import spread_smoothly


@dataclass(frozen=True)
class MouthCloseOptions:
    """zone_mm   along the skin from the seam: lips that move as one
    reach_mm  skin this far from the seam follows
    share     of the jaw's turn at which the lips meet
    """

    zone_mm: float = 9.0
    reach_mm: float = 36.0
    share: float = 0.25


def mouth_close(vertices, faces, seams, jaw, opens, forward, options=None):
    """Deltas (k, n, 3) of mouthClose for jaws opened by shares of their way: opens dict share -> (n, 3) of jawOpen.

    With jawOpen the lips are a rigid copy of the neutral's, turned about the hinge by a part of the jaw's turn, so they
    touch as the neutral's do and their corners cannot pinch; the skin between follows biharmonically. The upper teeth
    stay: what the turn would take the lips back into them is given back.
    vertices (n, 3) the neutral skin, faces (m, 3), seams the upper and lower line, jaw a jaw.Jaw
    forward  (3,) unit, where the face looks
    """
    options = options or MouthCloseOptions()
    sides = seam_sides(vertices, faces, *seams, options.zone_mm)
    zone = sides[0] | sides[1]
    seam = np.unique(np.concatenate(seams))
    zone[seam] = True
    away = cKDTree(vertices[seam]).query(vertices)[0]
    handles = np.flatnonzero(zone)
    values = []
    for share, opened in opens.items():
        moved = jaw.moved(vertices[handles], options.share * share) - vertices[handles]
        back = min(0.0, (jaw.moved(vertices[seam], options.share * share) - vertices[seam]).mean(axis=0) @ forward)
        values.append(moved - back * forward - opened[handles])
    field = spread_smoothly(vertices, faces, handles, np.concatenate(values, axis=1), away < options.reach_mm)
    return np.stack(np.split(field, len(opens), axis=1))
