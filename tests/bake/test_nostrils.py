from types import SimpleNamespace

import numpy as np
import pytest

from facewright.bake.fill import surface_distance
from facewright.bake.nostrils import DEEP_MM, LEAST, around_nostrils, darkened, hole_rims, nostril_light
from facewright.bake.texels import at_points, build_texels


@pytest.fixture(scope="module")
def nose(hm08):
    n = hm08.skin.vertices[1]
    F = hm08.faces[hm08.skin.face_slice]
    return SimpleNamespace(
        V=hm08.vertices[:n],
        F=F,
        nostrils=hm08.regions["nostrils"][:n],
        outer=hm08.regions["outer"][:n],
        mirror=hm08.mirror,
    )


def test_light_falls_from_the_rim_into_the_depth(nose):
    light = nostril_light(nose.V, nose.F, nose.nostrils)
    depth = surface_distance(nose.V, nose.F, ~nose.nostrils, 30.0)
    assert (light[~around_nostrils(nose.V, nose.F, nose.nostrils)] == 1).all()
    rim = nose.outer & (surface_distance(nose.V, nose.F, nose.nostrils, 3.0) < 3.0)
    assert np.median(light[rim]) > 0.9
    np.testing.assert_allclose(light[depth >= DEEP_MM], LEAST)
    between = nose.nostrils & (depth < DEEP_MM)
    assert light[between].min() >= LEAST and light[between].mean() < 0.6
    assert np.abs(light - light[nose.mirror[: len(light)]]).max() < 0.2
    assert (nostril_light(nose.V, nose.F, nose.nostrils & False) == 1).all()


def test_full_light_changes_nothing_and_less_is_darker_and_redder():
    colors = np.array([[200.0, 150.0, 120.0], [90.0, 60.0, 50.0]])
    np.testing.assert_allclose(darkened(colors, np.ones(2)), colors, atol=1e-6)
    dark = darkened(colors, np.full(2, 0.2))
    assert (dark < colors).all()
    assert (dark[:, 0] / dark[:, 1] > colors[:, 0] / colors[:, 1]).all()


def test_a_dark_rim_is_not_read_and_a_birthmark_farther_away_is(ball_face):
    template = ball_face.template
    V, F, nostrils = template.vertices, template.faces, template.regions["mouth_interior"]
    skin = SimpleNamespace(V=V, F=F, outer=~nostrils)
    texels = build_texels(template.uv, template.uv_faces, 256)
    points = at_points(V, F, texels.face, texels.barycentric)
    middle = np.linalg.norm(points[:, :2] - [0, -35], axis=1) + np.where(points[:, 2] > 0, 0, 1e3)
    hole, mark = (middle < 18) & (points[:, 0] > 0), np.linalg.norm(points - [0, 0, 80], axis=1) < 10
    near = around_nostrils(V, F, nostrils)
    for dark in (hole, hole & False):
        colors = np.where((dark | mark)[:, None], 40.0, 180.0).astype(np.float32) * np.ones(3, np.float32)
        means, share = np.full((len(V), 3), 180.0), np.ones(len(V))
        seen = np.ones(len(texels), bool)
        rims = hole_rims(skin, texels, colors, seen, means, share, nostrils, np.ones(len(V)))
        assert not rims[~near | nostrils].any()
        at_hole = near & skin.outer & (np.linalg.norm(V[:, :2] - [0, -35], axis=1) < 17)
        assert (rims[at_hole & (V[:, 0] > 4)] == dark.any()).all()
        assert not rims[V[:, 0] < -4].any()
    light = np.where(V[:, 0] < 0, 0.5, 1.0)
    rims = hole_rims(skin, texels, colors, seen, means, share, nostrils, light)
    np.testing.assert_array_equal(rims, near & skin.outer & (V[:, 0] < 0))
