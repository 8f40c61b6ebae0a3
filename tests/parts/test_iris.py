"""Irises: the patterns keep the colour that was asked for; those of a scan are found where they were painted."""

import numpy as np
import pytest

from facewright.data import Scan
from facewright.evaluate.iris import color_difference
from facewright.mesh.render import linear_to_srgb
from facewright.parts.assemble import _as_seen
from facewright.parts.iris import PATTERNS, WHITE, EyeLook, eye_colors
from facewright.parts.iris_scan import LUMINANCE, Iris, _circle, _colors, _opening

COLOR = (0.06, 0.10, 0.15)


def directions(k=160, most=40.0):
    """(k * k, 3) unit vectors in a cone about +Z and their angles."""
    x, y = np.meshgrid(np.linspace(-1, 1, k), np.linspace(-1, 1, k))
    angle = np.radians(most) * np.hypot(x, y).ravel()
    turn = np.arctan2(y, x).ravel()
    return np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)], 1), np.degrees(angle)


def test_there_are_at_least_six_patterns_and_others_are_refused():
    assert len(PATTERNS) >= 6
    with pytest.raises(ValueError, match="fibres"):
        EyeLook(pattern="plaid")


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_keeps_the_mean_colour_and_is_no_plain_disc(pattern):
    look = EyeLook(pattern=pattern, iris_color=COLOR)
    points, angle = directions()
    ring = (angle > 14) & (angle < 23)
    colors = eye_colors(points, look=look)[ring]
    assert color_difference(colors.mean(axis=0), COLOR) < 4.0
    assert colors.std(axis=0).max() > 0.005


def test_patterns_differ():
    points, _ = directions(60)
    images = [eye_colors(points, look=EyeLook(pattern=pattern)) for pattern in PATTERNS]
    for i, one in enumerate(images):
        assert all(np.abs(one - other).mean() > 1e-3 for other in images[:i])


def test_the_iris_of_a_painted_plane_is_found():
    """A flat scan with a dark disc off the middle between two lids."""
    x, y = np.meshgrid(np.linspace(-20, 20, 161), np.linspace(-12, 12, 97))
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    at = np.arange(x.size).reshape(x.shape)
    corners = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    faces = np.concatenate([np.stack([corners[i] for i in pick], axis=1) for pick in ((0, 1, 2), (0, 2, 3))])
    middle = np.array([1.3, 0.4])
    distance = np.linalg.norm(vertices[:, :2] - middle, axis=1)
    dark, white = linear_to_srgb(np.array(COLOR)), np.array([0.85, 0.85, 0.85])
    colors = np.where(distance[:, None] < 5.8, dark, white)
    colors = np.where(distance[:, None] < 2.0, 0.02, colors)
    scan = Scan(vertices, faces, colors=colors)
    s = np.linspace(-1, 1, 25)
    lids = [np.stack([14 * s, sign * 6.5 * (1 - s**2), 0 * s], axis=1) for sign in (1, -1)]
    points, room = _opening(*lids)
    found, met = _colors(scan, points)
    assert met.all()
    light = found @ [0.2126, 0.7152, 0.0722]
    center, radius, contrast = _circle(points[room > 1], light[room > 1], np.zeros(2))
    np.testing.assert_allclose(center, middle, atol=0.3)
    assert 5.3 < radius < 6.4 and contrast > 0.5


def seen(color, white):
    return Iris(np.zeros(2), 6.0, np.array(color), 0.5, np.array(white))


def test_an_eye_in_the_light_keeps_its_color():
    iris = seen((0.10, 0.12, 0.14), WHITE)
    assert iris.light == 1.0 and np.array_equal(iris.lit_color, iris.color)


@pytest.mark.parametrize("cast", [(0.05, 0.05, 0.05), (0.08, 0.06, 0.03)])
def test_the_white_tells_what_light_the_iris_lacks(cast):
    true, shade = np.array([0.10, 0.12, 0.14]), np.array(cast)
    iris = seen(shade * true, shade * WHITE)
    assert iris.light < 0.2
    assert np.allclose(iris.lit_color / iris.lit_color.sum(), true / true.sum())


@pytest.mark.parametrize("share", [1.0, 0.57, 0.05])
def test_whites_are_dimmed_towards_those_of_the_scan(share):
    iris = seen((0.10, 0.12, 0.14), share * np.array(WHITE))
    told = {"iris_color": iris.lit_color, "eye_light": iris.light, "eye_white": iris.whiteness}
    look = _as_seen(EyeLook(), told)
    white = LUMINANCE @ look.sclera_color / (LUMINANCE @ WHITE)
    assert max(share, 0.6) <= white + 1e-9 and white <= max(np.sqrt(share), 0.6) + 1e-9
    if iris.light == 1.0:
        np.testing.assert_allclose(look.iris_color, iris.color)
