"""Faces that look away from a scan are found, and nothing else."""

import numpy as np

from facewright.mesh.closest import Surface
from facewright.mesh.facing import folded_faces


def test_a_sheet_that_lies_on_its_scan_has_no_fold(sheet):
    vertices, faces = sheet()
    assert not len(folded_faces(Surface(vertices, faces), vertices + [0.2, 0.1, 0.1], faces, np.ones(len(faces), bool)))


def test_a_vertex_pushed_past_its_neighbours_folds_faces(sheet):
    vertices, faces = sheet()
    moved = vertices.copy()
    moved[7 * 15 + 7] += [2.5, 0.0, 0.05]
    folded = folded_faces(Surface(vertices, faces), moved, faces, np.ones(len(faces), bool))
    expected = np.flatnonzero(np.cross(*np.moveaxis(np.diff(moved[faces], axis=1), 1, 0))[:, 2] < 0)
    assert len(expected)
    assert np.array_equal(folded, expected)


def test_where_the_scan_has_no_surface_nothing_is_called_folded(sheet):
    vertices, faces = sheet()
    far = vertices + [0, 0, 9.0]
    assert not len(folded_faces(Surface(vertices, faces), far, faces[:, ::-1], np.ones(len(faces), bool)))


def test_the_far_wall_of_a_narrow_crease_is_no_fold(sheet):
    vertices, faces = sheet()
    back = vertices + [0, 0, 0.3]  # two walls of a crease, 0.3 mm apart, facing each other
    scan = Surface(np.vstack([vertices, back]), np.vstack([faces, faces[:, ::-1] + len(vertices)]))
    fit = vertices + [0, 0, 0.2]  # looks like the near wall, lies nearer to the far one
    assert not len(folded_faces(scan, fit, faces, np.ones(len(faces), bool)))
