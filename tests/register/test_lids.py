import numpy as np
import pytest

from facewright.data import Scan
from facewright.mesh.raster import RayScene
from facewright.register.colors import surface_colors
from facewright.register.lids import STEP_MM, EyePicture, lid_borders, trace_borders

SKIN, WHITE, IRIS = (0.8, 0.6, 0.5), (0.85, 0.85, 0.84), (0.25, 0.3, 0.35)
HALF_WIDTH = 13.0


def lids(x, height, depth):
    """Heights of an eye's upper and lower border at x, a parabola each."""
    arch = np.maximum(1.0 - (x / HALF_WIDTH) ** 2, 0.0)
    return height * arch, -depth * arch


def painted(points, height=5.0, depth=4.0, seed=0):
    """(k, 3) colours of an eye about the origin of the plane, points (k, 2)."""
    x, y = points.T
    upper, lower = lids(x, height, depth)
    colors = np.tile(SKIN, (len(points), 1))
    colors[(y < upper) & (y > lower)] = WHITE
    colors[(y < upper) & (y > lower) & (x**2 + y**2 < 5.5**2)] = IRIS
    return np.clip(colors + np.random.default_rng(seed).normal(0, 0.02, colors.shape), 0, 1)


def picture(**eye):
    x, y = np.arange(-22, 22, STEP_MM), np.arange(-14, 14, STEP_MM)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return EyePicture(x, y, painted(points, **eye).reshape(len(y), len(x), 3))


def landmarks(height, depth, count=9):
    """Landmarks that see both lids at other heights than they are."""
    x = np.linspace(-HALF_WIDTH, HALF_WIDTH, count)
    return [np.stack([x, line], axis=1) for line in lids(x, height, depth)]


def worst(borders, height=5.0, depth=4.0):
    """How far off the borders are at most, mm."""
    upper, lower = borders
    above = upper[:, 1] - lids(upper[:, 0], height, depth)[0]
    below = lower[:, 1] - lids(lower[:, 0], height, depth)[1]
    return np.abs(np.concatenate([above, below])).max()


@pytest.mark.parametrize(("height", "depth"), [(5.0, 4.0), (3.2, 2.5), (6.5, 5.0), (3.5, 4.8)])
def test_borders_are_found_from_landmarks_up_to_two_millimetres_off(height, depth):
    assert worst(trace_borders(picture(), *landmarks(height, depth))) < 0.7


def test_landmarks_that_are_right_stay():
    assert worst(trace_borders(picture(), *landmarks(5.0, 4.0))) < 0.15


def test_a_mirrored_eye_has_mirrored_borders():
    seen = picture(seed=1)
    x = -seen.x[::-1]
    mirrored = EyePicture(x, seen.y, seen.colors[:, ::-1])
    for border, other in zip(trace_borders(seen, *landmarks(4, 3)), trace_borders(mirrored, *landmarks(4, 3))):
        assert np.abs(np.interp(border[:, 0], -other[::-1, 0], other[::-1, 1]) - border[:, 1]).max() < 0.25


def test_lashes_over_the_lid_do_not_move_its_border_far():
    seen = picture()
    x, y = np.meshgrid(seen.x, seen.y)
    upper = lids(x, 5.0, 4.0)[0]
    lash = (y > upper) & (y < upper + 2.0) & (np.abs(x) < 12) & (np.sin(4.0 * x) > 0.3)
    seen.colors[lash] = (0.1, 0.08, 0.07)
    assert worst(trace_borders(seen, *landmarks(5.0, 4.0))) < 0.7


def test_nothing_is_found_in_plain_skin_or_where_there_is_no_surface():
    assert trace_borders(picture(height=0.0, depth=0.0), *landmarks(5.0, 4.0)) is None
    seen = picture()
    assert trace_borders(EyePicture(seen.x, seen.y, np.full_like(seen.colors, np.nan)), *landmarks(5.0, 4.0)) is None


def test_borders_lie_on_a_scan_that_is_painted_by_vertices():
    x, y = np.meshgrid(np.arange(-40, 40, 0.4), np.arange(-30, 30, 0.4))
    z = 8.0 - (x**2 + y**2) / 150.0
    grid = np.arange(x.size).reshape(x.shape)
    a, b, c, d = grid[:-1, :-1].ravel(), grid[:-1, 1:].ravel(), grid[1:, 1:].ravel(), grid[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    flat = np.stack([x.ravel(), y.ravel()], axis=1)
    scan = Scan(np.column_stack([flat, z.ravel()]), faces, colors=painted(flat))
    upper, lower = [np.column_stack([line, np.full(len(line), 8.0)]) for line in landmarks(3.5, 2.5)]
    borders = lid_borders(RayScene(scan.vertices, scan.faces), surface_colors(scan), upper, lower)
    assert worst([border.points for border in borders]) < 0.8
    for border in borders:
        x, y, z = border.points.T
        assert np.abs(z - (8.0 - (x**2 + y**2) / 150.0)).max() < 0.05
        assert (np.diff(x) > 0).all() and np.allclose(border.forward, [0, 0, 1])
