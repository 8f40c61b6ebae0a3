"""From a face to its rig: the template's shapes carried to it, contact solved, the parts put together.

The main job does this between registration and writing; benchmarks, evaluation and documentation do it with faces that
were never scanned.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facewright.contact import (
    EyeShapes,
    clear_lids,
    clear_lips,
    even_lining,
    find_jaw,
    hold_neck,
    keep_jaw_within,
    lay_blends_flat,
    lay_flat,
    lay_tongue,
    part_crossings,
    part_lips,
    solve_mouth,
)
from facewright.data import Face
from facewright.parts import build_rig, fit_parts
from facewright.transfer import keep_within_amplitudes, keep_within_regions, ride_on_lids, transfer_shapes


def shapes_of(face):
    """All targets of a Face with its parts in place: the template's shapes carried to it, contact solved."""
    carried = keep_within_amplitudes(face, hold_neck(face, keep_within_regions(face, transfer_shapes(face))))
    carried = lay_tongue(face, keep_jaw_within(face, carried))
    eyes = EyeShapes(face)
    skin = solve_mouth(face, eyes.shapes(carried))
    skin = part_crossings(face, lay_flat(face, skin), eyes.with_pairs)
    return _with_riders(face, lay_blends_flat(face, skin))


def rig_from_face(face, maps=None):
    """The data.Rig of a Face with its parts in place, as the job makes it; maps as bake gives them."""
    return assembled(face, shapes_of(face), maps)


def unscanned_face(template, vertices):
    """The data.Face of a head that no scan was needed for: vertices (n, 3) at rest in the Template's topology."""
    seen, closed = np.ones(len(vertices), bool), {"left": False, "right": False}
    return Face(template, vertices, vertices, template.regions, template.lines, seen, {}, closed, {})


def in_place(face, irises=None):
    """A Face with its parts fitted, its lips and lids clear of each other; irises as parts.find_irises gives them."""
    return clear_lips(part_lips(even_lining(clear_lids(fit_parts(face, irises=irises)))))


def template_rig(template):
    """The data.Rig of a Template's own head, made as a person's is."""
    return rig_from_face(in_place(unscanned_face(template, template.vertices)))


def assembled(face, targets, maps=None, options=None):
    """The Rig with the jaw's bone at the hinge that jawOpen turns about."""
    rig = build_rig(face, targets.deltas, maps, options, targets)
    jaw = find_jaw(face, targets.delta("jawOpen")) if "jawOpen" in targets.names else None
    return rig if jaw is None else jaw.on_rig(rig)


def _with_riders(face, shapes):
    """The shapes with lashes and all else that rides on the lids as their final skin wants it."""
    names = [*face.template.shape_names, *shapes.extras]
    deltas = ride_on_lids(face, [*shapes.deltas, *shapes.extras.values()], names, shapes.correctives)
    n = len(shapes.deltas)
    return replace(shapes, deltas=deltas[:n], extras=dict(zip(shapes.extras, deltas[n:])))
