import numpy as np

from facewright.mesh.polyline import arc_lengths


def test_lengths_rise_along_the_line_by_its_edges():
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 2.0]])
    np.testing.assert_array_equal(arc_lengths(points), [0.0, 5.0, 7.0])
    np.testing.assert_array_equal(arc_lengths(points[:, :2]), [0.0, 5.0, 5.0])
    np.testing.assert_array_equal(arc_lengths(points[:1]), [0.0])
