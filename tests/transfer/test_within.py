"""Shapes rest outside their regions and are themselves inside."""

import numpy as np
from scipy.spatial import cKDTree

from facewright.data import Face
from facewright.transfer import keep_within_amplitudes, keep_within_regions
from facewright.working_set import read_working_set, region_depth


def test_a_shape_that_strays_comes_home(hm08):
    V, seen = hm08.vertices, np.ones(len(hm08.vertices), bool)
    face = Face(hm08, V, V, hm08.regions, hm08.lines, seen, {}, {"left": False, "right": False}, {})
    names = list(hm08.shape_names)
    stray = np.tile([0.0, 0.5, 0.0], (len(names), len(hm08.vertices), 1))
    kept = keep_within_regions(face, stray)
    skin, outer = hm08.skin.vertex_slice, hm08.regions["outer"][hm08.skin.vertex_slice]
    words = read_working_set()
    for name in ("browInnerUp", "cheekSquintLeft", "jawOpen"):
        word = words.words[name]
        depth = region_depth(hm08.vertices[skin], hm08.lines, words.regions[word.region], word.side, 1.0)
        moved = np.linalg.norm(kept[names.index(name), skin], axis=1)
        assert moved[outer & (depth < -1.0)].max() == 0.0
        assert np.allclose(moved[outer & (depth > 8.0)], 0.5)
    assert np.array_equal(kept[:, hm08.skin.vertices[1] :], stray[:, hm08.skin.vertices[1] :])


def test_left_is_the_mirror_of_right(hm08):
    words = read_working_set()
    skin = hm08.vertices[hm08.skin.vertex_slice]
    mirror = hm08.mirror[hm08.skin.vertex_slice]
    region = words.regions["cheek"]
    left = region_depth(skin, hm08.lines, region, "left", 1.0)
    right = region_depth(skin, hm08.lines, region, "right", 1.0)
    assert np.allclose(left[mirror], right, atol=1e-6)
    near = cKDTree(skin[hm08.lines["lid_lower_left"]]).query(skin)[0] < 5.0
    assert left[near].min() > 0.0


def test_what_is_too_weak_or_too_strong_is_scaled_and_the_rest_is_not(hm08):
    V, seen = hm08.vertices, np.ones(len(hm08.vertices), bool)
    face = Face(hm08, V, V, hm08.regions, hm08.lines, seen, {}, {"left": False, "right": False}, {})
    names = list(hm08.shape_names)
    deltas = np.array(hm08.deltas)
    weak, strong, jaw = (names.index(name) for name in ("mouthSmileLeft", "browInnerUp", "jawOpen"))
    deltas[weak] *= 0.5
    deltas[strong] *= 3.0
    deltas[jaw] *= 0.1
    kept = keep_within_amplitudes(face, deltas)
    words, scale = read_working_set().words, 63.0 / 62.5
    corner = hm08.lines["lip_seam_upper"][-1]
    assert np.linalg.norm(kept[weak, corner]) * scale > words["mouthSmileLeft"].amplitude[0]
    outer = hm08.regions["outer"]
    assert np.linalg.norm(kept[strong, outer], axis=1).max() * scale < words["browInnerUp"].amplitude[1]
    assert np.array_equal(kept[jaw], deltas[jaw])
    assert np.allclose(kept[names.index("mouthFrownLeft")], hm08.deltas[names.index("mouthFrownLeft")])
