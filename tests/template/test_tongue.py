"""A tongue over the floor of a mouth, both one surface as in a scanned one, comes out over a point."""

from itertools import pairwise

import numpy as np
import pytest

from facewright.template.skeleton import rotation_about_x
from facewright.template.tongue import tongue_out

FRONT, TOP, BENEATH, FLOOR = 10.0, -72.0, -80.0, -88.0
HINGE, OPEN = np.array([0.0, -40.0, -60.0]), np.radians(25.0)
OVER, TIP = [0.0, -68.0, 30.0], [0.0, -72.0, 55.0]


def test_the_tip_comes_to_lie_where_it_is_asked(mouth):
    out = brought_out(mouth)
    assert np.allclose(out[mouth["vertices"][:, 2] == FRONT].mean(axis=0), TIP, atol=0.5)
    assert out[:, 2].max() < TIP[2] + 4.0


def test_its_underside_lies_on_what_it_leads_over_and_its_front_droops(mouth):
    out = brought_out(mouth)
    over = (out[:, 2] > OVER[2] - 15.0) & (out[:, 2] < OVER[2])
    assert out[over, 1].min() == pytest.approx(OVER[1], abs=0.3)
    droops = out[:, 2] > 0.5 * (OVER[2] + TIP[2])
    assert out[droops, 1].min() < OVER[1] - 3.0 and out[droops, 1].max() < out[over, 1].max() - 0.5


def test_border_and_floor_go_with_the_jaw_alone(mouth):
    moved = brought_out(mouth, share=0.4) - mouth["vertices"]
    ahead = (mouth["vertices"][:, 1] == FLOOR) & (mouth["vertices"][:, 2] >= 0.0)
    for still in (mouth["border"], ahead):
        assert np.allclose(moved[still], 0.4 * mouth["jaw"][still])


def test_the_jaw_carries_a_tongue_that_is_out(mouth):
    shut, wide = brought_out(mouth), brought_out(mouth, share=1.0)
    body = (mouth["vertices"][:, 1] > FLOOR + 6.0) & (mouth["vertices"][:, 2] > -10.0)
    assert np.allclose(wide[body], rotation_about_x(shut, HINGE, OPEN)[body], atol=1e-6)


def test_it_grows_thinner_and_narrower_and_stays_even(mouth):
    thick, thin = brought_out(mouth), brought_out(mouth, thin=0.4)
    front = mouth["vertices"][:, 2] == FRONT
    assert np.ptp(thin[front, 0]) == pytest.approx(0.8 * np.ptp(thick[front, 0]))
    assert span(thin[front]) == pytest.approx(0.6 * span(thick[front]))
    columns = thin.reshape(-1, 9, 3)
    assert np.allclose(columns, columns[:, ::-1] * [-1, 1, 1], atol=1e-9)


def span(points):
    """Distance of the upper from the lower of points that lie in two rows."""
    middle = points[np.abs(points[:, 0]) < 1e-9]
    return np.linalg.norm(middle[0] - middle[1])


def brought_out(mouth, share=0.0, thin=0.0):
    return mouth["vertices"] + tongue_out(**mouth, over=OVER, tip=TIP, share=share, thin=thin)


@pytest.fixture(scope="module")
def mouth():
    """Root, back, tip, underside, the pit beneath, and the floor forward to the gums, whose sides are joined too."""
    ways = [(-40.0, TOP), (FRONT, TOP), (FRONT, BENEATH), (-16.0, BENEATH), (-16.0, FLOOR), (4.0, FLOOR)]
    steps = [(a, b, round(np.hypot(*np.subtract(a, b)) / 2.0)) for a, b in pairwise(ways)]
    profile = np.concatenate([*(np.linspace(a, b, k, endpoint=False) for a, b, k in steps), ways[-1:]])
    x = np.linspace(-10.0, 10.0, 9)
    V = np.concatenate([np.column_stack([x, np.full(9, y), np.full(9, z)]) for z, y in profile])
    at = np.arange(len(V)).reshape(-1, 9)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    F = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    floor = profile[:, 1] == FLOOR
    border = np.concatenate([at[0], at[-1], at[floor][:, 0], at[floor][:, -1]])
    return {"vertices": V, "faces": F, "border": np.unique(border), "jaw": rotation_about_x(V, HINGE, OPEN) - V}
