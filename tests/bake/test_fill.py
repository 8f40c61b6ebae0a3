import numpy as np
import pytest

from facewright.bake.fill import BAND_MM, FORGET_MM, feather, hair_stains, solve_fill, surface_distance
from facewright.mesh.adjacency import dilate, unique_edges


@pytest.fixture(scope="module")
def ball(ball_face):
    template = ball_face.template
    return template.vertices, template.faces, template.mirror, template.regions


def shading(V):
    """Colours that are the same left and right, but for a wash of light from one side."""
    front = np.column_stack([100 + V[:, 1], 120 + 0.5 * V[:, 2], 90 + 0.3 * np.abs(V[:, 0])])
    return front + 0.1 * V[:, :1]


def test_distance_along_the_surface(ball):
    V, F, _, _ = ball
    pole = V[:, 2].argmax()
    distance = surface_distance(V, F, np.arange(len(V)) == pole, 300.0)
    arc = 80 * np.arccos(np.clip(V @ V[pole] / 6400, -1, 1))
    assert (distance >= 0.99 * arc).all(), "chords are a little shorter than arcs"
    assert (distance < 1.45 * arc + 1e-9).all(), "edges go round corners"
    straight = np.abs(V[:, 1]) < 1e-9  # a row of edges from pole to pole
    np.testing.assert_allclose(distance[straight], arc[straight], rtol=0.01)
    assert (surface_distance(V, F, np.zeros(len(V), bool), 7.0) == 7.0).all()


def test_feather_is_zero_at_holes_and_one_away_from_them_and_at_rims(ball):
    V, F, mirror, regions = ball
    share = np.where(V[:, 0] > 40, 0.0, 1.0)
    weight = feather(V, F, regions["outer"], share, mirror)
    assert (weight[V[:, 0] > 40] == 0).all()
    assert (weight[(V[:, 0] < 30) & regions["outer"]] == 1).all(), "the mouth's rim is not a hole"
    assert (weight[regions["mouth_interior"]] == 0).all()


def test_what_is_known_stays_and_a_missing_side_repeats_the_other(ball):
    V, F, mirror, _ = ball
    outer = np.ones(len(V), bool)
    colors = shading(V)
    missing = np.linalg.norm(V - [45, 20, 60], axis=1) < 25
    fill = solve_fill(V, F, {}, mirror, outer, colors, np.where(missing, 0.0, 1.0), (1, 2, 3))
    far = np.linalg.norm(V - [45, 20, 60], axis=1) > 32
    np.testing.assert_allclose(fill.color[far], colors[far], atol=1e-9)
    # The mirrored side knows |x| and all else; the wash of light is continued from the border.
    assert np.abs(fill.color - colors)[missing].max() < 1.0
    plain = solve_fill(V, F, {}, np.arange(len(V)), outer, colors, np.where(missing, 0.0, 1.0), (1, 2, 3))
    assert np.abs(plain.color - colors)[missing].max() > 2.0, "without a mirror only the border is known"


def test_nothing_known_gives_the_default_and_dark_insides(ball):
    V, F, mirror, regions = ball
    share = np.zeros(len(V))
    fill = solve_fill(V, F, regions, mirror, regions["outer"], np.zeros((len(V), 3)), share, (200, 150, 120))
    far = regions["outer"]
    assert np.abs(fill.color[far] - [200, 150, 120]).max() < 1e-6, "the mouth tints nothing"
    deepest = np.linalg.norm(V[:, :2] - [0, -35], axis=1) + np.where(V[:, 2] > 0, 0, 1e3)
    assert (fill.color[deepest.argmin()] < 0.5 * np.array([200, 150, 120])).all()
    assert (fill.weight == 0).all()


def test_vertices_without_texels_are_no_holes(ball):
    V, F, mirror, _ = ball
    outer = np.ones(len(V), bool)
    share = np.ones(len(V))
    share[::7] = np.nan
    fill = solve_fill(V, F, {}, mirror, outer, shading(V), share, (1, 2, 3))
    assert (fill.weight == 1).all()
    assert np.abs(fill.color - shading(V)).max() < 6


def test_a_lock_at_the_hairline_is_hair_and_a_brow_is_not(ball):
    V, F, _, _ = ball
    hidden = V[:, 1] > 40
    lock = (np.abs(V[:, 0]) < 12) & (V[:, 1] > 25) & ~hidden
    brow = (np.abs(V[:, 0] - 30) < 12) & (np.abs(V[:, 1] - 20) < 6) & (V[:, 2] > 0)
    means = np.where((hidden | lock | brow)[:, None], 30.0, 150.0) * np.ones(3)
    stains = hair_stains(V, F, means, np.where(hidden, 0.0, 1.0), hidden, means[hidden], np.ones(len(V), bool))
    assert lock.any() and brow.any()
    assert (stains & ~hidden)[lock].all() and not (stains & brow).any()
    assert not (stains & ~dilate(lock, F)).any(), "and its edge, no more"
    none = np.zeros(len(V), bool)
    assert not hair_stains(V, F, means, np.ones(len(V)), none, means[none], ~none).any(), "no hair, no stains"


def test_the_shadow_of_a_hairline_goes_and_the_shade_of_a_head_stays(ball):
    V, F, _, _ = ball
    hidden = V[:, 1] > 40
    light = 150.0 * (0.7 + 0.3 * V[:, 0] / 80.0)
    shadow = (V[:, 1] > 30) & (V[:, 2] > 30) & ~hidden
    means = np.where(hidden, 30.0, np.where(shadow, 0.8, 1.0) * light)[:, None] * np.ones(3)
    bare = V[:, 2] > 0
    stains = hair_stains(V, F, means, np.where(hidden, 0.0, 1.0), hidden, means[hidden], bare)
    assert stains[shadow].all() and not (stains & ~dilate(shadow | hidden, F)).any()


def test_hair_as_bright_as_the_shaded_skin_is_told_by_its_hue(ball):
    V, F, _, _ = ball
    hidden = V[:, 1] > 40
    lock = (np.abs(V[:, 0]) < 12) & (V[:, 1] > 25) & ~hidden
    light = (0.75 + 0.25 * V[:, :1] / 80.0) * np.ones(3)
    skin, hair = light * [190.0, 140.0, 120.0], 0.9 * light * [140.0, 110.0, 50.0]
    means = np.where((hidden | lock)[:, None], hair, skin)
    stains = hair_stains(V, F, means, np.where(hidden, 0.0, 1.0), hidden, hair[hidden], np.ones(len(V), bool))
    assert stains[lock].mean() > 0.95
    assert not (stains & ~dilate(lock, F)).any()


def test_far_from_the_rim_the_fill_is_the_usual_skin(ball):
    V, F, _, _ = ball
    outer, height = np.ones(len(V), bool), V[:, 2]
    shown = height > -1.0
    dark = shown & (height < 20)
    colors = np.where(dark[:, None], 60.0, 160.0) * np.ones(3)
    fill = solve_fill(V, F, {}, np.arange(len(V)), outer, colors, shown.astype(float), (1, 2, 3))
    arc = 80 * np.arcsin(np.clip(-height / 80, 0, 1))
    rim, far = ~shown & (arc < 0.3 * FORGET_MM), arc > 2.5 * FORGET_MM
    assert fill.color[rim].mean() < 110, "no step at the rim"
    assert np.abs(fill.color[far] - 160).max() < 15


def test_what_the_other_side_shows_beside_the_unknown_is_not_repeated(ball):
    """Hair hides both sides beyond a line, one side a little more: the skin between it and the hair of the other side,
    which is lit there, is no model."""
    V, F, mirror, _ = ball
    outer, side = np.ones(len(V), bool), np.where(V[:, 0] > 0, 1.0, -1.0)
    missing = V[:, 1] > np.where(side > 0, 12.0, 16.0)
    lit = (V[:, 0] < -30) & (V[:, 1] > 12.0)
    colors = np.where(lit, 240.0, 120.0)[:, None] * np.ones(3)
    fill = solve_fill(V, F, {}, mirror, outer, colors, np.where(missing, 0.0, 1.0), (1, 2, 3))
    strip = missing & lit[mirror] & ~missing[mirror]
    assert strip.sum() > 10
    assert fill.color[strip].max() < 150
    assert (fill.detail[strip] == 0).all()


def test_the_end_of_what_both_sides_show_is_eased_over_a_wide_band(ball):
    """A dark border (a beard) of what is shown fades into the skin, detail fades out; farther in nothing changes."""
    V, F, mirror, _ = ball
    outer, height = np.ones(len(V), bool), V[:, 2]
    arc = 80 * np.arcsin(np.clip(height / 80, -1, 1))
    shown = arc > 0
    colors = np.where((shown & (arc < 7))[:, None], 60.0, 160.0) * np.ones(3)
    fill = solve_fill(V, F, {}, mirror, outer, colors, shown.astype(float), (1, 2, 3))
    inside, band = arc > BAND_MM + 8, shown & (arc < 0.7 * BAND_MM)
    np.testing.assert_array_equal(fill.weight[inside], 1.0)
    np.testing.assert_allclose(fill.color[inside], colors[inside], atol=1e-6)
    assert (fill.weight[band] < 1).all()
    np.testing.assert_array_equal(fill.own[shown], colors[shown])
    edges = unique_edges(F)
    across = np.abs(np.diff(colors[edges, 0])[:, 0]) > 0
    assert np.abs(np.diff(fill.color[edges, 0])[across]).mean() < 0.5 * 100
    assert fill.color[shown & (arc < 7), 0].mean() > 75
    one_sided = shown | (V[:, 0] > 0)
    narrow = solve_fill(V, F, {}, mirror, outer, colors, one_sided.astype(float), (1, 2, 3))
    assert (narrow.weight[arc > 8] == 1).all(), "the other side shows what lies beyond"
