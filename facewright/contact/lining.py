"""The lining of the lips at rest, which no scan shows: flesh as thick as the template's, and nothing that crosses."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from facewright.contact.parting import Parting
from facewright.contact.targets import is_even
from facewright.contact.teeth import out_of_teeth, rows_of_teeth
from facewright.mesh.adjacency import within
from facewright.mesh.seam import inner_sides
from facewright.mesh.spread import spread_smoothly

_LINING_MM = 10.0  # from the lips' line: lining that is made anew
_REACH_MM = 15.0  # from the lips' line: skin that may cross
_SEEN_MM, _HIDDEN_MM = 0.1, 1.5  # by which skin is moved at most where it crosses


def even_lining(face):
    """The data.Face with a lining of the lips that goes from their line into the mouth as the template's does.

    Identity modes and fits leave thin flaps and hooks there, behind which the other lip lies: nothing tells which side
    of them is in. What the lips' seen skin and the lining deep in the mouth have been displaced by is spread between
    the two with the least bending.
    """
    template, skin = face.template, face.template.skin
    at, faces = skin.vertex_slice, template.faces[skin.face_slice]
    rest, now = template.vertices[at], face.vertices[at]
    seam = np.concatenate(_seams(face))
    away = cKDTree(rest[seam]).query(rest)[0]
    free = face.regions["mouth_interior"][at] & ~face.regions["outer"][at] & (away < _LINING_MM)
    free[seam] = False
    held = np.flatnonzero(~free)
    field = spread_smoothly(rest, faces, held, (now - rest)[held], free)
    return _moved(face, np.where(free[:, None], rest + field - now, 0.0))


def clear_lips(face):
    """The data.Face in whose neutral no faces around the lips cross that do not in the template."""
    template, skin = face.template, face.template.skin
    at, faces = skin.vertex_slice, template.faces[skin.face_slice]
    rest, seams = template.vertices[at], _seams(face)
    near = cKDTree(rest[np.concatenate(seams)]).query(rest)[0] < _REACH_MM
    farthest = np.where(face.regions["outer"][at], _SEEN_MM, _HIDDEN_MM)
    every = np.ones(len(faces), bool)
    sides = inner_sides(rest, faces, *seams, _REACH_MM)
    parting = Parting(rest, faces, within(near, faces), every, farthest, sides)
    out = partial(out_of_teeth, rows_of_teeth(template, face.vertices), face.vertices)
    return _moved(face, parting([face.vertices[at]], [1.0], [out]))


def _seams(face):
    return face.lines["lip_seam_upper"], face.lines["lip_seam_lower"]


def _moved(face, field):
    """The Face with its skin moved by (k, 3); an even one stays even."""
    every = np.zeros_like(face.vertices)
    every[face.template.skin.vertex_slice] = field
    if is_even(face):
        every = 0.5 * (every + every[face.template.mirror] * [-1.0, 1.0, 1.0])
    return replace(face, vertices=face.vertices + every)
