"""Knots of crossing faces come loose: by smoothing, or by taking the shape of a reference."""

import numpy as np

from facewright.mesh.intersect import self_intersections
from facewright.mesh.untangle import reshaped, untangled


def knotted(sheet):
    """A sheet with a knot in its middle, its faces, and (n,) bool what may move."""
    vertices, faces = sheet()
    knot = vertices.copy()
    knot[7 * 15 + 7] += [2.2, 1.7, -0.4]
    knot[7 * 15 + 8] += [-1.6, 0.3, 0.5]
    free = np.linalg.norm(vertices[:, :2] - 7.0, axis=1) < 4.0
    assert len(self_intersections(knot, faces))
    return vertices, knot, faces, free


def test_a_knot_is_smoothed_and_the_rest_stays(sheet):
    _, knot, faces, free = knotted(sheet)
    loose = untangled(knot, faces, ~free)
    assert not len(self_intersections(loose, faces))
    np.testing.assert_array_equal(loose[~free], knot[~free])


def test_what_is_reshaped_is_the_reference_laid_there(sheet, turn):
    """Turned, scaled and moved as a whole, the rest unharmed: the reference comes back exactly."""
    vertices, knot, faces, free = knotted(sheet)
    curved = vertices + np.stack([0 * vertices[:, 0], 0 * vertices[:, 0], 0.05 * vertices[:, 0] ** 2], axis=1)
    there = 1.3 * curved @ turn(35).T + [4.0, -2.0, 9.0]
    np.testing.assert_allclose(reshaped(there, curved, faces, free), there, atol=1e-9)
    harmed = np.where(free[:, None], there + 1.3 * (knot - vertices) @ turn(35).T, there)
    mended = reshaped(harmed, curved, faces, free)
    assert not len(self_intersections(mended, faces))
    np.testing.assert_array_equal(mended[~free], harmed[~free])
    assert np.abs(mended - there).max() < 0.6
