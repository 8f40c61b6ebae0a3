"""A jaw opens no farther than the working set says, and its teeth stay rigid."""

from dataclasses import replace

import numpy as np

from facewright.contact import find_jaw, keep_jaw_within
from facewright.parts import fit_parts
from facewright.solve.procrustes import best_rotation
from facewright.transfer import transfer_shapes
from facewright.transfer.within import scale_of
from facewright.working_set import read_working_set


def test_a_jaw_that_opens_too_far_is_held_on_its_arc(hm08_person):
    face = fit_parts(hm08_person(5))
    deltas = transfer_shapes(face)
    number, teeth = face.template.shape_names.index("jawOpen"), face.template.part("teeth_lower").vertex_slice
    jaw = find_jaw(face, deltas[number])
    wide = np.array(deltas)
    wide[number] = jaw.half_open(face.vertices, deltas[number], 1.4)
    held = keep_jaw_within(face, wide)
    outer = face.regions["outer"]
    reach = np.linalg.norm(held[number][outer], axis=1).max() * scale_of(face)
    least, most = read_working_set().words["jawOpen"].amplitude
    assert least < reach <= most < np.linalg.norm(wide[number][outer], axis=1).max() * scale_of(face)
    rest = face.vertices[teeth]
    moved = rest + held[number, teeth]
    fitted = (rest - rest.mean(axis=0)) @ best_rotation(rest, moved).T + moved.mean(axis=0)
    assert np.abs(moved - fitted).max() < 1e-3
    assert (np.delete(held, number, axis=0) == np.delete(wide, number, axis=0)).all()
    assert keep_jaw_within(face, held) is held


def test_without_a_jaw_nothing_changes(hm08_person):
    face = hm08_person(5)
    template = replace(face.template, shape_names=("mouthPucker",), deltas=face.template.deltas[:1])
    deltas = np.zeros((1, *face.vertices.shape))
    assert keep_jaw_within(replace(face, template=template), deltas) is deltas
