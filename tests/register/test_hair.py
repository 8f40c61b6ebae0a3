"""Hair is told by how dark it is, light from one side is not taken for it."""

import igl
import numpy as np
import pytest

from facewright.data import Scan
from facewright.register.hair import hair_by_color

SKIN_POINTS = 50.0 * np.array(
    [[0.5, 0.2, 0.84], [-0.5, 0.2, 0.84], [0.6, -0.4, 0.69], [-0.6, -0.4, 0.69], [0, 0.3, 0.95]]
)


@pytest.fixture(scope="module")
def ball():
    vertices, faces = igl.icosahedron()
    for _ in range(4):
        vertices, faces = igl.loop(vertices, faces)
    return 50.0 * vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def colored(ball, brightness):
    colors = np.clip(brightness, 0, 1)[:, None] * [1.0, 0.8, 0.7]
    return Scan(ball[0], ball[1], colors=colors, unit_mm=1.0, name="ball")


def test_dark_hair_is_told_from_skin(ball):
    hairy = ball[0][:, 1] > 25.0
    hair = hair_by_color(colored(ball, np.where(hairy, 0.15, 0.7)), SKIN_POINTS)
    assert (hair[ball[0][:, 1] > 30.0] == 1.0).all()
    assert (hair[ball[0][:, 1] < 20.0] == 0.0).all()


def test_light_from_one_side_is_no_hair(ball):
    shade = 0.45 + 0.25 * ball[0][:, 0] / 50.0
    assert not np.any(hair_by_color(colored(ball, shade), SKIN_POINTS))


@pytest.mark.parametrize("scale", [0.3, 0.6, 1.0])
def test_exposure_does_not_matter(ball, scale):
    brightness = np.where(ball[0][:, 1] > 25.0, 0.2, 0.9)
    assert np.allclose(
        hair_by_color(colored(ball, scale * brightness), SKIN_POINTS),
        hair_by_color(colored(ball, brightness), SKIN_POINTS),
    )


def test_a_scan_in_clay_tells_nothing(ball):
    assert not np.any(hair_by_color(Scan(*ball, unit_mm=1.0, name="ball"), SKIN_POINTS))
