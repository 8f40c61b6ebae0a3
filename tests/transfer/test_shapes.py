"""All shapes on a person: exact on the template, blind to rigid motion, mirrored on a mirrored head, parts along."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.conventions import mirrored_name
from facewright.data import Face
from facewright.parts import fit_parts
from facewright.solve.procrustes import best_rotation, best_similarity
from facewright.transfer.shapes import TransferOptions, even_cut, even_handed, feature_links, transfer_shapes

MIRROR = np.array([-1.0, 1.0, 1.0])
TURNED = {"jawLeft": "jawRight", "mouthLeft": "mouthRight"}
TURNED |= {right: left for left, right in TURNED.items()}


@pytest.fixture(scope="module")
def person(hm08_person):
    return fit_parts(hm08_person(2))


@pytest.fixture(scope="module")
def shapes(person):
    return transfer_shapes(person)


def template_face(template):
    seen = np.ones(len(template.vertices), bool)
    V = template.vertices
    return Face(template, V, V, template.regions, template.lines, seen, {}, {"left": False, "right": False}, {})


def test_onto_the_template_itself_is_exact(hm08):
    off = np.abs(transfer_shapes(template_face(hm08)) - hm08.deltas).max(axis=(0, 2))
    riding = np.concatenate([np.arange(*part.vertices) for part in hm08.parts if part.attach.startswith("lid_")])
    assert off[riding].max() < 0.01  # made anew from the skin, whose stored deltas are rounded
    assert np.delete(off, riding).max() < 1e-8


def test_rigid_motion_of_the_person_commutes(person, shapes):
    points = np.random.default_rng(1).normal(size=(2, 5, 3))
    R = best_rotation(points[0], points[1])
    turned = replace(person, vertices=person.vertices @ R.T + [10, -20, 30])
    assert np.abs(transfer_shapes(turned) - shapes @ R.T).max() < 1e-8


def test_a_mirrored_person_gets_the_mirrored_rig(hm08, person, shapes):
    twin = hm08.mirror
    other = [hm08.shape_names.index(TURNED.get(name, mirrored_name(name))) for name in hm08.shape_names]
    mirrored = transfer_shapes(replace(person, vertices=person.vertices[twin] * MIRROR))
    assert np.abs(mirrored - shapes[other][:, twin] * MIRROR).max() < 1e-8


def test_left_is_left(hm08, person, shapes):
    for name in ("mouthSmileLeft", "eyeBlinkLeft", "browDownLeft", "noseSneerLeft"):
        motion = np.linalg.norm(shapes[hm08.shape_names.index(name)], axis=1)
        assert motion[person.vertices[:, 0] > 0].sum() > 5 * motion[person.vertices[:, 0] < 0].sum(), name


def test_the_skull_does_not_drift(hm08, shapes):
    assert not shapes[:, hm08.regions["skull"]].any()


def test_eyes_turn_about_their_own_centres(hm08, person, shapes):
    part = hm08.part("eye_left").vertex_slice
    k = hm08.shape_names.index("eyeLookOutLeft")
    before, after = person.vertices[part], person.vertices[part] + shapes[k, part]
    R, scale, t = best_similarity(hm08.vertices[part], before)
    center = scale * R @ hm08.skeleton.positions[hm08.skeleton.names.index("eye_left")] + t
    assert np.allclose(np.linalg.norm(after - center, axis=1), np.linalg.norm(before - center, axis=1), atol=0.05)
    assert (after - before)[np.argmax(before[:, 2]), 0] > 2  # the pupil goes to the person's left


def test_lower_teeth_stay_rigid_and_follow_the_chin(hm08, person, shapes):
    part = hm08.part("teeth_lower").vertex_slice
    k = hm08.shape_names.index("jawOpen")
    before, after = person.vertices[part], person.vertices[part] + shapes[k, part]
    R, scale, t = best_similarity(before, after)
    assert abs(scale - 1) < 0.01 and np.abs(scale * before @ R.T + t - after).max() < 0.6
    lip = hm08.lines["lip_seam_lower"][len(hm08.lines["lip_seam_lower"]) // 2]
    gap = np.linalg.norm(person.vertices[lip] - before.mean(axis=0)) - np.linalg.norm(
        person.vertices[lip] + shapes[k, lip] - after.mean(axis=0)
    )
    own_lip, own = hm08.vertices[lip], hm08.vertices[part]
    own_gap = np.linalg.norm(own_lip - own.mean(axis=0)) - np.linalg.norm(
        own_lip + hm08.deltas[k, lip] - (own + hm08.deltas[k, part]).mean(axis=0)
    )
    assert abs(gap - own_gap) < 1.5


def test_upper_teeth_do_not_move(hm08, shapes):
    assert not shapes[:, hm08.part("teeth_upper").vertex_slice].any()


def lip_gap(vertices, template):
    upper, lower = template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]
    return np.linalg.norm(vertices[upper] - vertices[lower], axis=1).max()


def test_the_mouth_stays_closed_when_jaw_and_mouth_close_meet(hm08, hm08_person):
    close = [hm08.shape_names.index(name) for name in ("jawOpen", "mouthClose")]
    own = lip_gap(hm08.vertices + hm08.deltas[close].sum(axis=0), hm08)
    for seed in (2, 3):
        face = fit_parts(hm08_person(seed))
        closed = face.vertices + transfer_shapes(face)[close].sum(axis=0)
        assert lip_gap(closed, hm08) < max(own, lip_gap(face.vertices, hm08)) + 0.5


def test_triangles_count_the_same_on_both_sides():
    """Two mirrored quads cut along diagonals that are not mirrored."""
    mirror = np.array([1, 0, 3, 2, 5, 4])  # 0 2 4 left of 1 3 5
    faces = np.array([[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4]])
    both, weights = even_handed(faces, mirror)
    assert len(both) == 8 and (weights == 0.5).all()
    found = {tuple(sorted(face)) for face in both.tolist()}
    assert found == {tuple(sorted(mirror[list(face)].tolist())) for face in found}
    apart = np.array([[0, 2, 4], [1, 5, 3]])
    same, ones = even_handed(apart, mirror)
    assert np.array_equal(same, apart) and (ones == 1).all()


def test_links_pair_the_lines_and_can_be_left_out(hm08):
    links = feature_links(hm08.lines, hm08.vertices)
    assert [link.by_gap for link in links] == [True, True, False]
    assert all(
        (hm08.vertices[link.pairs[:, 0], 0] * hm08.vertices[link.pairs[:, 1], 0] >= -1.0).all() for link in links
    )
    assert feature_links(hm08.lines, hm08.vertices, TransferOptions(w_lids=0, w_lips=0)) == ()


def test_eyelids_do_not_follow_the_jaw(hm08, hm08_person):
    """What rests on the template rests on the person, however far the jaw opens."""
    k = hm08.shape_names.index("jawOpen")
    for seed in (4, 5):
        motion = np.linalg.norm(transfer_shapes(fit_parts(hm08_person(seed)))[k], axis=1)
        still = np.linalg.norm(hm08.deltas[k], axis=1) < 0.05
        assert motion[still & hm08.regions["skin"]].max() < 0.12


def test_quads_are_cut_alike_on_both_sides():
    x = np.array([1.0, 2.0, 2.0, 1.0, -1.0, -2.0, -2.0, -1.0])
    mirror = np.array([4, 5, 6, 7, 0, 1, 2, 3])
    left, right = [[0, 1, 2], [0, 2, 3]], [[5, 4, 7], [5, 7, 6]]  # 4, 5, 6, 7 runs the other way round
    cut = even_cut(np.array(left + right), mirror, x)
    keys = {tuple(sorted(face)) for face in cut}
    assert keys == {tuple(sorted(mirror[list(face)])) for face in keys} and len(cut) == 4
    assert {(0, 1, 2), (0, 2, 3)} <= keys
