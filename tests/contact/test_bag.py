"""Lining that a shape would leave outside is taken back; what is inside stays."""

import numpy as np
import pytest

from facewright.contact.bag import NOSTRILS, MouthBag


@pytest.fixture(scope="module")
def bag(hm08):
    skin = hm08.skin.vertex_slice
    V, F = hm08.vertices[skin], hm08.faces[hm08.skin.face_slice]
    seams = hm08.lines["lip_seam_upper"], hm08.lines["lip_seam_lower"]
    return V, MouthBag(V, F, seams, hm08.regions["mouth_interior"][skin], hm08.regions["outer"][skin])


def test_the_neutral_stays(bag):
    V, lining = bag
    assert not lining.tucked(V).any()


def test_what_comes_out_goes_back_and_outer_skin_stays(bag, hm08):
    V, lining = bag
    outer = hm08.regions["outer"][hm08.skin.vertex_slice]
    chin = outer & (np.abs(V[:, 0]) < 15) & (V[:, 1] < -80) & (V[:, 1] > -105) & (V[:, 2] > 0)
    pressed = V.copy()
    pressed[chin, 2] -= 7.0
    every = np.arange(len(lining.corners))
    skin = lining.before(pressed)
    push = lining.tucked(pressed)
    assert lining.heights(skin, pressed, every)[0].max() > 0.5
    assert lining.heights(skin, pressed + push, every)[0].max() < 0.1
    assert not push[outer].any() and np.abs(push).max() < 12.0


def test_nostrils_stay_in_the_nose(hm08):
    place = hm08.skin.vertex_slice
    V, F = hm08.vertices[place], hm08.faces[hm08.skin.face_slice]
    rims = [line for name, line in hm08.lines.items() if name.startswith("nostril")]
    inner, outer = hm08.regions["nostrils"][place], hm08.regions["outer"][place]
    nose = MouthBag(V, F, rims, inner, outer, NOSTRILS)
    assert not nose.tucked(V).any()
    drawn = V + 8.0 * inner[:, None] * [1.0, 0.0, 0.0]
    push, every = nose.tucked(drawn), np.arange(len(nose.corners))
    skin = nose.before(drawn)
    before, after = (nose.heights(skin, moved, every)[0] for moved in (drawn, drawn + push))
    assert before.max() > 0.5 and (after > 0.1).sum() < 0.1 * (before > 0.1).sum()
    assert not push[~inner].any()
