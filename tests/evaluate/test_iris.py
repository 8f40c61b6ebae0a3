"""CIEDE2000 against the published pairs; a rig's irises are where its eyes look and of the colour they were given."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.evaluate.iris import _lab, color_difference, measure_irises
from facewright.parts import AssemblyOptions, EyeLook, build_rig

# Sharma, Wu and Dalal 2005, table 1: pairs 1, 7, 13, 19, 25.
PAIRS = (
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
    ((50.0, -0.0010, 2.4900), (50.0, 0.0011, -2.4900), 4.7461),
    ((50.0, 2.5, 0.0), (56.0, -27.0, -3.0), 31.9030),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
)


@pytest.mark.parametrize(("one", "other", "expected"), PAIRS)
def test_published_pairs(monkeypatch, one, other, expected):
    monkeypatch.setattr("facewright.evaluate.iris._lab", lambda value: value)
    assert color_difference(one, other) == pytest.approx(expected, abs=1e-4)


def test_lab_of_white_and_grey():
    np.testing.assert_allclose(_lab((1.0, 1.0, 1.0)), (100.0, 0.0, 0.0), atol=0.01)
    assert color_difference((0.2, 0.2, 0.2), (0.2, 0.2, 0.2)) == 0.0


def test_irises_of_a_rig(hm08, hm08_person):
    color = (0.05, 0.09, 0.14)
    face = replace(hm08_person(1), vertices=hm08.vertices, stats={"parts": {"iris_color": color}})
    rig = build_rig(face, hm08.deltas, options=AssemblyOptions(eyes=EyeLook(size=256)))
    for side, sign in (("left", 1), ("right", -1)):
        found = measure_irises(rig)[side]
        np.testing.assert_allclose(found["center_mm"], [sign * 31.25, 0.0], atol=0.2)
        assert color_difference(found["color"], color) < 3.0
