"""The border of a head stays where it is."""

import numpy as np

from facewright.contact import hold_neck


def test_the_ring_rests_and_the_face_moves_on(hm08, hm08_person):
    person = hm08_person(3)
    deltas = np.ones((2, *person.vertices.shape))
    held = hold_neck(person, deltas)
    assert not held[:, person.lines["neck_ring"]].any()
    assert (held[:, person.regions["lips"]] == 1).all() and (deltas == 1).all()
    steps = np.abs(held[0][hm08.faces[:, 0]] - held[0][hm08.faces[:, 1]]).max()
    assert steps < 0.8


def test_a_quiet_ring_costs_nothing(hm08, hm08_person):
    deltas = np.zeros((1, *hm08.vertices.shape))
    assert hold_neck(hm08_person(3), deltas) is deltas
