"""The tongue of an open mouth lies on its floor: a jaw that turns would carry its back up into the palate's place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import border_vertices


@dataclass(frozen=True)
class TongueOptions:
    """share      of the opening between the lips, from below, that the tongue may fill at jawOpen 1
    body       shares of its length from the root between which its back begins to sink and sinks as a whole
    border_mm  from where it is joined to the gums: there it stays
    most_mm    by which it sinks at most
    """

    share: float = 0.5
    body: tuple[float, float] = (0.8, 0.35)
    border_mm: float = 8.0
    most_mm: float = 18.0


def lay_tongue(face, deltas, options=None):
    """Shapes (s, n, 3) mm of a data.Face whose jawOpen lets the tongue's back sink behind the lower teeth.

    The tip, and with it a tongue that is out, goes with the jaw as before. Unchanged without jaw or tongue.
    """
    options = options or TongueOptions()
    template = face.template
    part = next((part for part in template.parts if part.name == "tongue"), None)
    if part is None or "jawOpen" not in template.shape_names:
        return deltas
    number, at = template.shape_names.index("jawOpen"), part.vertex_slice
    upper, lower = (
        _middle(face.vertices + deltas[number], face.lines[f"lip_seam_{lip}"]) for lip in ("upper", "lower")
    )
    level = ((1 - options.share) * lower + options.share * upper)[1]
    weights = _sinks(template.vertices[at], template.faces[part.face_slice] - part.vertices[0], options)
    above = (face.vertices + deltas[number])[at, 1] - level
    depth = (above[weights > 0.5] / weights[weights > 0.5]).max(initial=0.0)
    result = np.array(deltas)
    result[number, at, 1] -= np.clip(depth, 0.0, options.most_mm) * weights
    return result


def _middle(vertices, line):
    return vertices[line[len(line) // 2]]


def _sinks(vertices, faces, options):
    """(k,) 0..1: how far each vertex of a tongue (k, 3) at rest sinks, more to the back; joined edges do not."""
    z = vertices[:, 2]
    share = (z - z.min()) / np.ptp(z)
    start, full = options.body
    t = np.clip((start - share) / (start - full), 0.0, 1.0)
    border = border_vertices(faces, len(vertices))
    held = cKDTree(vertices[border]).query(vertices)[0] / options.border_mm if border.any() else 1.0
    held = np.clip(held, 0.0, 1.0)
    return t * t * (3 - 2 * t) * held * held * (3 - 2 * held)
