"""The tongue lies low in an open mouth; its tip and everything else go as before."""

from dataclasses import replace

import numpy as np

from facewright.contact import Targets, TongueOptions, lay_tongue, solve_mouth
from facewright.contact.mouth import MouthOptions
from facewright.contact.tongue import over_the_lip
from facewright.evaluate.teeth import _Mouth
from facewright.parts import build_rig, fit_parts
from facewright.transfer import transfer_shapes


def test_the_back_sinks_and_the_tip_stays(hm08_person):
    face = fit_parts(hm08_person(5))
    deltas = transfer_shapes(face)
    laid = lay_tongue(face, deltas)
    number, tongue = face.template.shape_names.index("jawOpen"), face.template.part("tongue").vertex_slice
    change = laid[number] - deltas[number]
    others = np.ones(len(change), bool)
    others[tongue] = False
    assert not change[others].any()
    assert (np.delete(laid, number, axis=0) == np.delete(deltas, number, axis=0)).all()
    rest = face.vertices[tongue]
    tip = rest[:, 2] > np.quantile(rest[:, 2], 0.9)
    assert not change[tongue][tip].any()
    posed = (face.vertices + laid[number])[tongue]
    upper, lower = ((face.vertices + laid[number])[face.lines[f"lip_seam_{lip}"]][:, 1] for lip in ("upper", "lower"))
    share = TongueOptions().share
    body = (rest[:, 2] > np.quantile(rest[:, 2], 0.3)) & ~tip
    assert posed[body, 1].max() < lower.min() + (share + 0.1) * (upper.max() - lower.min())
    assert change[tongue][:, 1].min() < -3.0


def test_without_a_jaw_nothing_changes(hm08_person):
    face = hm08_person(5)
    template = replace(face.template, shape_names=("mouthPucker",), deltas=face.template.deltas[:1])
    deltas = np.zeros((1, *face.vertices.shape))
    assert lay_tongue(replace(face, template=template), deltas) is deltas


def test_a_tongue_that_is_out_comes_off_the_lower_lip(hm08_person):
    face = fit_parts(hm08_person(5))
    deltas = transfer_shapes(face)
    names, tongue = face.template.shape_names, face.template.part("tongue").vertex_slice
    opened, out = deltas[names.index("jawOpen")], deltas[names.index("tongueOut")]
    lowered = out.copy()
    lowered[tongue, 1] -= 12.0 * (face.vertices[tongue, 2] > np.median(face.vertices[tongue, 2]))
    free, low = ([(0.5 * opened + shape, 0.5)] for shape in (out, lowered))
    assert not over_the_lip(face, free, -opened).any()
    lift = over_the_lip(face, low, -opened)
    others = np.ones(len(lift), bool)
    others[tongue] = False
    assert not lift[others].any()
    assert lift[tongue, 1].max() > 0.5
    root = face.vertices[tongue, 2] < np.quantile(face.vertices[tongue, 2], 0.1)
    assert not lift[tongue][root].any()
    moved = [(low[0][0] + 0.5 * lift, 0.5)]
    assert np.abs(over_the_lip(face, moved, -opened)).max() < 0.2 * np.abs(lift).max()


def test_a_tongue_that_is_out_lies_on_the_lip_by_itself_too(hm08_person):
    face = fit_parts(hm08_person(5))
    carried, tongue = transfer_shapes(face), face.template.part("tongue").vertex_slice
    names = ("jawOpen", "tongueOut")
    deltas = carried[[face.template.shape_names.index(name) for name in names]]
    low = deltas.copy()
    low[1, tongue, 1] -= 5.0 * (face.vertices[tongue, 2] > np.median(face.vertices[tongue, 2]))
    solved = solve_mouth(face, Targets(names, low), MouthOptions(pairs=()))
    face = replace(face, template=replace(face.template, shape_names=names, deltas=low))
    before, after = (build_rig(face, targets.deltas, eyes=targets) for targets in (Targets(names, low), solved))
    assert _Mouth(before, {"tongueOut": 1.0}, True).tongue_in_flesh_mm() > 1.0
    for weight in (0.0, 0.5, 1.0):
        mouth = _Mouth(after, {"tongueOut": 1.0, "jawOpen": weight}, True)
        assert mouth.tongue_in_flesh_mm() < 0.5 and mouth.tongue_out_mm() > 5.0
        mouth = _Mouth(after, {"tongueOut": 0.5, "jawOpen": weight}, True)
        assert mouth.tongue_in_flesh_mm() < 0.5
    teeth = face.template.part("teeth_lower").vertex_slice
    opened, both = (solved.motion(dict.fromkeys(pose, 1.0))[teeth] for pose in (names[:1], names))
    assert np.linalg.norm(both - opened, axis=1).max() < 0.02 * np.linalg.norm(opened, axis=1).max()
