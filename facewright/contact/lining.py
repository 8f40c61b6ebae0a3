"""Lips and lids at rest: lips with a lining, which no scan shows, as thick as the template's; nothing that crosses."""

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
from facewright.transfer.eyeball import carried_eyeball
from facewright.transfer.riders import SIDES, LidRiders

_LINING_MM = 10.0  # from the lips' line: lining that is made anew
_REACH_MM, _LID_REACH_MM = 15.0, 8.0  # from the lips' line and from the margins of lids: skin that may cross
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
    rest, faces = template.vertices[skin.vertex_slice], template.faces[skin.face_slice]
    out = partial(out_of_teeth, rows_of_teeth(template, face.vertices), face.vertices)
    return _cleared(face, _seams(face), _REACH_MM, inner_sides(rest, faces, *_seams(face), _REACH_MM), out)


def clear_lids(face):
    """The data.Face, its parts in place, in whose neutral no faces around the lids cross that do not in the template.

    At the inner corner of the eye skin and lining lie a few hundredths of a millimetre apart, and identity modes push
    one through the other; what is the wrong way round at rest has no right way out in any pose.
    """
    lids = [face.lines[name] for name in sorted(face.lines) if name.startswith("lid_")]
    if not lids:
        return face
    cleared = _cleared(face, lids, _LID_REACH_MM, (), np.zeros_like)
    vertices = np.array(cleared.vertices)
    for side in SIDES:
        riders = LidRiders(face.template, side)
        if len(riders.index):
            vertices[riders.index] = riders.placed(vertices, carried_eyeball(face.template, vertices, side))
    return replace(cleared, vertices=vertices)


def _cleared(face, lines, reach_mm, sides, way_out):
    """The Face in whose neutral no faces within reach of some lines cross; sides and way_out as Parting takes them."""
    template, skin = face.template, face.template.skin
    at, faces = skin.vertex_slice, template.faces[skin.face_slice]
    rest = template.vertices[at]
    near = cKDTree(rest[np.concatenate(lines)]).query(rest)[0] < reach_mm
    farthest = np.where(face.regions["outer"][at], _SEEN_MM, _HIDDEN_MM)
    parting = Parting(rest, faces, within(near, faces), np.ones(len(faces), bool), farthest, sides)
    return _moved(face, parting([face.vertices[at]], [1.0], [way_out]))


def _seams(face):
    return face.lines["lip_seam_upper"], face.lines["lip_seam_lower"]


def _moved(face, field):
    """The Face with its skin moved by (k, 3); an even one stays even."""
    every = np.zeros_like(face.vertices)
    every[face.template.skin.vertex_slice] = field
    if is_even(face):
        every = 0.5 * (every + every[face.template.mirror] * [-1.0, 1.0, 1.0])
    return replace(face, vertices=face.vertices + every)
