"""Steps without an edge."""

import numpy as np

from facewright.mesh.fade import smooth_step


def test_a_step_goes_either_way_round():
    assert smooth_step([-1, 0.5, 2]).tolist() == [0, 0.5, 1]
    assert smooth_step([-1, 1, 4], 0, 2).tolist() == [0, 0.5, 1]
    assert smooth_step([-1, 0.5, 2], 1, 0).tolist() == [1, 0.5, 0]


def test_a_step_has_no_edge():
    slope = np.gradient(smooth_step(np.linspace(-0.5, 1.5, 401)), 0.005)
    assert slope.min() >= 0 and np.abs(np.diff(slope)).max() < 0.04
