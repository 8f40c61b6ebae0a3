"""Lips keep off each other on the way of every shape, mouthClose closes, the jaw turns on an arc."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.contact import Targets, find_jaw, part_lips, solve_mouth
from facewright.contact.mouth import MouthOptions, _Mouth
from facewright.contact.watch import Watch
from facewright.evaluate.mouth import _Mouth as LipFigures
from facewright.evaluate.mouth import measure_mouth
from facewright.evaluate.quality import lip_gaps_mm
from facewright.evaluate.synthetic import random_identity
from facewright.mesh.normals import vertex_normals
from facewright.parts import build_rig, fit_parts
from facewright.rigging import unscanned_face
from facewright.transfer import transfer_shapes

KEPT = ("jawOpen", "mouthClose", "mouthPucker", "mouthFunnel", "mouthPressLeft", "mouthPressRight", "mouthShrugLower")
PAIRS = (("mouthFunnel", "mouthPucker"), ("mouthPress", "jawOpen"))


def only(face, deltas):
    """Targets with a few shapes of the mouth: the others cost time and show nothing new."""
    names = face.template.shape_names
    return Targets(KEPT, np.array([deltas[names.index(name)] for name in KEPT]))


def rig_of(face, targets):
    template = replace(face.template, shape_names=targets.names, deltas=targets.deltas)
    return build_rig(replace(face, template=template), targets.deltas, eyes=targets)


@pytest.fixture(scope="module")
def solved(hm08_person):
    """A person, the raw Targets and the solved ones."""
    person = part_lips(fit_parts(hm08_person(4)))
    raw = only(person, transfer_shapes(person))
    return person, raw, solve_mouth(person, raw, MouthOptions(pairs=PAIRS))


@pytest.fixture(scope="module")
def figures(solved):
    """Figures of crossing before and after: pose -> (full, plain)."""
    person, raw, targets = solved
    poses = {f"{name} {w}": {name: w} for name in KEPT if name != "mouthClose" for w in (0.25, 0.5, 0.75, 1.0)}
    poses |= {"both": {"mouthPressLeft": 1.0, "mouthPressRight": 1.0}}
    poses |= {"pair": {"mouthFunnel": 1.0, "mouthPucker": 1.0}}
    return [measure_mouth(rig_of(person, found), poses) for found in (raw, targets)]


def test_no_lip_enters_the_other(figures):
    before, after = ([f["crossing_mm"] for f in found["poses"].values()] for found in figures)
    assert max(full for full, _ in before) > 0.5
    assert max(full for full, _ in after) < 0.3


def test_single_shapes_need_no_corrective(figures):
    for pose, found in figures[1]["poses"].items():
        assert pose == "pair" or found["crossing_mm"][1] < 0.3, pose


def test_mouth_close_closes_the_open_jaw(solved, figures):
    person, _, targets = solved
    assert max(figures[1]["mouth_close_gap_mm"]) < 0.3
    skin = person.template.skin.vertex_slice
    half = person.vertices + targets.motion({"jawOpen": 0.5, "mouthClose": 0.5})
    assert lip_gaps_mm(half[skin], person.lines).max() < 0.3


def test_the_jaw_takes_an_arc(solved):
    person, _, targets = solved
    jaw = find_jaw(person, targets.delta("jawOpen"))
    teeth = person.template.part("teeth_lower").vertex_slice
    rest = person.vertices[teeth]
    for weight in (0.5, 1.0):
        pose = rest + targets.motion({"jawOpen": weight})[teeth]
        assert np.abs(pose - jaw.moved(rest, weight)).max() < 0.02
    assert 15 < np.degrees(np.linalg.norm(jaw.turn)) < 35
    assert abs(jaw.hinge @ [1, 0, 0]) < 3


def test_the_bone_sits_at_the_hinge(solved):
    person, _, targets = solved
    jaw = find_jaw(person, targets.delta("jawOpen"))
    rig = jaw.on_rig(rig_of(person, targets))
    assert np.allclose(rig.skeleton.positions[rig.skeleton.names.index("jaw")], jaw.hinge)
    assert np.allclose(np.radians(rig.info["jaw_open_turn_deg"]), jaw.turn)


def test_what_is_far_from_the_lips_is_left_alone(solved):
    person, raw, targets = solved
    changed = np.abs(targets.delta("mouthPucker") - raw.delta("mouthPucker")).max(axis=1) > 0
    seam = person.vertices[person.lines["lip_seam_upper"]]
    distance = np.linalg.norm(person.vertices[changed][:, None] - seam[None], axis=2).min(axis=1)
    assert changed.any() and distance.max() < 25
    other = person.template.skin.vertices[1]
    assert not changed[other:].any()


def test_left_is_the_mirror_of_right(hm08, hm08_person):
    face = part_lips(replace(hm08_person(0), vertices=hm08.vertices))
    targets = solve_mouth(face, only(face, hm08.deltas), MouthOptions(pairs=PAIRS[1:]))
    pairs = [("mouthPressLeft", "mouthPressRight"), ("mouthPressLeft+jawOpen", "mouthPressRight+jawOpen")]
    for left, right in [*pairs, ("mouthPucker", "mouthPucker"), ("jawOpen@0.5", "jawOpen@0.5")]:
        mirrored = targets.delta(right)[hm08.mirror] * [-1, 1, 1]
        assert np.abs(targets.delta(left) - mirrored).max() < 0.01, left


def test_rest_without_faults_stays(hm08, hm08_person):
    face = replace(hm08_person(0), vertices=hm08.vertices)
    assert np.abs(part_lips(face).vertices - hm08.vertices).max() < 0.05


def test_lips_that_touch_are_parted_a_little(hm08, hm08_person):
    upper, lower = hm08.lines["lip_seam_upper"], hm08.lines["lip_seam_lower"]
    touching = np.array(hm08.vertices)
    touching[upper] = touching[lower] = 0.5 * (hm08.vertices[upper] + hm08.vertices[lower])
    parted = part_lips(replace(hm08_person(0), vertices=touching)).vertices
    gap = np.linalg.norm(parted[upper] - parted[lower], axis=1)
    corner = np.linalg.norm(touching[upper][:, None] - touching[upper[[0, -1]]], axis=2).min(axis=1)
    assert np.abs(gap[corner > 2.0] - 0.1).max() < 0.03
    assert np.abs(parted - touching).max() < 0.1


def test_a_roll_stops_where_the_teeth_stop_it(solved):
    person, _, _ = solved
    mouth = _Mouth(person, MouthOptions())
    back = np.zeros_like(person.vertices)
    back[mouth.contact.lips, 2] = -10.0
    met = mouth.contact.meets_teeth(back, 1.0)
    assert 0.0 < met < 1.0
    assert np.isclose(mouth.contact.meets_teeth(0.8 * back, 1.0), met / 0.8, atol=0.05)
    rolls = Targets(("mouthRollLower",), back[None])
    assert np.allclose(mouth.with_room(rolls).deltas[0], min(1.0, mouth.contact.meets_teeth(back, 0.5) + 0.5) * back)
    assert np.array_equal(mouth.with_room(Targets(("mouthRollLower",), 0.1 * back[None])).deltas[0], 0.1 * back)


def test_a_jaw_that_goes_forward_keeps_lips_shut_and_off_each_other_on_the_way(hm08):
    """What shuts them at the end brings them into each other half way."""
    person = part_lips(fit_parts(unscanned_face(hm08, random_identity(hm08, 6))))
    raw = transfer_shapes(person)[[hm08.shape_names.index("jawForward")]]
    targets = solve_mouth(person, Targets(("jawForward",), raw))
    poses = {str(weight): {"jawForward": weight} for weight in (0.25, 0.5, 0.75, 1.0)}
    found = measure_mouth(rig_of(person, targets), poses)["poses"]
    assert max(figures["crossing_mm"][0] for figures in found.values()) < 0.3
    contact = _Mouth(person, MouthOptions()).contact
    pose = (person.vertices + targets.delta("jawForward"))[contact.used]
    assert max(gaps.max() for gaps in contact.slit.gaps(pose)) < 0.3


def test_a_mouth_is_ajar_where_its_lips_are_drawn_apart(solved):
    """It is asked at the weight at which a correction would act most."""
    person, _, _ = solved
    contact = _Mouth(person, MouthOptions()).contact
    still, lifted = np.zeros_like(person.vertices), np.zeros_like(person.vertices)
    lifted[contact.used[contact.sides[0]], 1] = 1.0
    assert not contact.ajar(lambda weight: still)
    assert contact.ajar(lambda weight: weight * lifted)
    assert not contact.ajar(lambda weight: 0.1 * weight * lifted)
    assert not contact.ajar(lambda weight: (weight > 0.5) * lifted, (0.5, 1.0), lambda weight: 1.0 - weight)


def test_two_rolls_stay_shut(solved):
    person, _, _ = solved
    names = "mouthRollUpper", "mouthRollLower"
    deltas = transfer_shapes(person)
    raw = Targets(names, deltas[[person.template.shape_names.index(name) for name in names]])
    targets = solve_mouth(person, raw, MouthOptions(pairs=(names,)))
    contact = _Mouth(person, MouthOptions()).contact
    pose = (person.vertices + targets.motion(dict.fromkeys(names, 1.0)))[contact.used]
    assert max(gaps.max() for gaps in contact.slit.gaps(pose)) < 0.3


def test_the_inside_of_a_lip_may_lie_in_teeth_on_the_way_but_not_in_the_end(solved):
    person, _, _ = solved
    contact = _Mouth(person, MouthOptions()).contact
    back, still = np.zeros((2, *person.vertices.shape))
    back[contact.lips[~person.regions["outer"][contact.lips]], 2] = -3.5

    def push(end, spared_mm):
        path = {0.5: back, 1.0: end}
        return np.abs(contact.apart(path.get, tuple(path), lambda weight: weight**2, spared_mm=spared_mm)).max()

    assert push(still, 0.0) > 1.0 and push(still, 5.0) == 0.0
    assert 0.0 < push(back, 5.0) < 0.5 * push(back, 0.0)


def test_what_has_always_lain_behind_the_other_lip_has_not_come_through_it(hm08_person):
    face = part_lips(fit_parts(hm08_person(4)))
    contact = _Mouth(face, MouthOptions()).contact
    skin = face.vertices[contact.used]
    normals = vertex_normals(skin, contact.faces)
    pushed = skin.copy()
    pushed[contact.sides[1]] += [0.0, 2.0, 0.0]

    def behind(known):
        """Number of vertices found in a pose whose lips were known clear of each other in another one."""
        watches = [Watch(known[mine], known[other]) for mine, other in zip(contact.sides, contact.sides[::-1])]
        return sum(len(contact._behind(pushed, normals, side, watch)[0]) for side, watch in enumerate(watches))

    assert behind(skin) > 50 and behind(pushed) < 0.1 * behind(skin)  # what is not deep may touch


def test_a_crossing_is_no_deeper_than_lips_have_moved(solved):
    person, _, targets = solved
    mouth = LipFigures(rig_of(person, targets))
    rest = mouth.skin.vertices
    assert mouth.crossing(rest) < 0.3
    lower = np.flatnonzero(mouth.sides[1])
    pushed = rest.copy()
    pushed[lower] += [0.0, 2.0, 0.0]
    assert 1.0 < mouth.crossing(pushed) < 2.3
    # What lay behind the other lip at rest, without being in it, is not in it where nothing moves.
    mouth.skin, mouth.entered = replace(mouth.skin, vertices=pushed), np.zeros(len(rest))
    assert mouth.crossing(pushed) < 0.3
