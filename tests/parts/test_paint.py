"""Painted textures: the same on every run, of the promised form, with what they are meant to show."""

import numpy as np
import pytest

from facewright.parts.paint import PAINTERS, plain_map

LOOKS = {"teeth": {"cells": (7, 4)}}


@pytest.mark.parametrize("name", sorted(PAINTERS))
def test_painting_is_deterministic(name):
    look = LOOKS.get(name, {})
    image = PAINTERS[name](look, 64)
    assert image.dtype == np.uint8 and image.shape[0] == 64 and image.ndim == 3
    np.testing.assert_array_equal(image, PAINTERS[name](look, 64))


def test_teeth_darken_towards_the_gum():
    image = PAINTERS["teeth"](LOOKS["teeth"], 448).astype(float).mean(axis=2)
    cell = image[:112, :64]
    assert cell[12, 32] < cell[60, 32]


def test_a_plain_map_has_the_colour_that_was_asked_for():
    image = plain_map((1.0, 0.214, 0.0), 8)
    assert image.shape == (8, 8, 3) and (image == [255, 127, 0]).all()


def test_lashes_get_shorter_towards_the_corners_and_stay_within_their_map():
    upper = PAINTERS["lashes"]({}, 256)[:128, :, 3]
    first, middle, last = (
        np.flatnonzero((part > 100).any(axis=1)).min() for part in np.split(upper, (16, 496), axis=1)
    )
    assert not upper[:, [0, -1]].any() and min(first, last) > middle + 40


def test_hairs_thin_out_and_strips_fade():
    lashes = PAINTERS["lashes"]({}, 256)[..., 3].astype(float)
    assert lashes[125].mean() > 2 * lashes[40].mean() and lashes[:3].max() < 60
    shadow = PAINTERS["occlusion"]({}, 64)[..., 3]
    assert shadow[0].mean() > shadow[-1].mean() > shadow[32].mean()
    assert (PAINTERS["blend"]({}, 64)[..., :3] == PAINTERS["blend"]({}, 64)[0, 0, :3]).all()
