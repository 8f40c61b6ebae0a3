"""Halves add up to their sum, are mirror images, and leave the other side alone."""

import numpy as np
import pytest

from facewright.transfer.halves import left_share, split_in_halves

MIRROR_X = np.array([-1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def puff(hm08):
    targets = {"cheekPuff": hm08.shape("cheekPuff"), "cheekPuff@0.5": 0.6 * hm08.shape("cheekPuff")}
    halves = {"cheekPuff": ("cheekPuffLeft", "cheekPuffRight")}
    return split_in_halves(hm08, targets, halves, {"cheekPuff": {0.5: "cheekPuff@0.5"}})


def test_halves_add_up(hm08, puff):
    made, passed = puff
    assert np.abs(made["cheekPuffLeft"] + made["cheekPuffRight"] - hm08.shape("cheekPuff")).max() < 1e-12
    assert passed == {"cheekPuffLeft": {0.5: "cheekPuffLeft@0.5"}, "cheekPuffRight": {0.5: "cheekPuffRight@0.5"}}
    total = made["cheekPuffLeft@0.5"] + made["cheekPuffRight@0.5"]
    assert np.abs(total - 0.6 * hm08.shape("cheekPuff")).max() < 1e-12


def test_halves_are_mirror_images(hm08, puff):
    made, _ = puff
    assert np.abs(made["cheekPuffLeft"] - made["cheekPuffRight"][hm08.mirror] * MIRROR_X).max() < 0.01


def test_the_window_is_as_wide_as_the_lips(hm08):
    share, x = left_share(hm08), hm08.vertices[:, 0]
    corner = hm08.vertices[hm08.lines["lip_seam_upper"], 0].max()
    assert (share[x > corner] == 1).all() and (share[x < -corner] == 0).all()
    assert share.min() >= 0 and share.max() <= 1 and np.allclose(share[np.abs(x) < 1e-9], 0.5)
