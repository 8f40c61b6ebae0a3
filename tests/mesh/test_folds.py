"""A face turned over by its neighbours' measure is found, and laid flat again."""

import numpy as np

from facewright.mesh.folds import folded_by_shape, laid_flat, neighbour_mean


def test_turning_a_head_folds_no_shape(sheet, turn):
    vertices, faces = sheet()
    curved = vertices + np.stack([0 * vertices[:, 0], 0 * vertices[:, 0], 0.1 * vertices[:, 0] ** 2], axis=1)
    assert not len(folded_by_shape(curved, curved @ turn(170).T, faces))


def test_a_shape_that_turns_a_face_over_is_found(sheet):
    vertices, faces = sheet()
    moved = vertices.copy()
    moved[7 * 15 + 7] += [2.5, 0.0, 0.0]
    turned = np.cross(*np.moveaxis(np.diff(moved[faces], axis=1), 1, 0))[:, 2] < 0
    assert np.array_equal(folded_by_shape(vertices, moved, faces), np.flatnonzero(turned))


def test_folds_are_laid_flat_and_nothing_else_moves(sheet):
    vertices, faces = sheet()
    moved = vertices + [0.0, 0.0, 1.0]
    moved[7 * 15 + 7] += [2.5, 0.0, 0.0]
    keep = np.zeros(len(vertices), bool)
    flat = laid_flat(vertices, moved, faces, keep, neighbour_mean(faces, len(vertices)))
    assert not len(folded_by_shape(vertices, flat, faces))
    away = np.linalg.norm(vertices - vertices[7 * 15 + 7], axis=1) > 5
    assert np.array_equal(flat[away], moved[away])
    still = laid_flat(vertices, flat, faces, keep, neighbour_mean(faces, len(vertices)))
    assert still is flat


def test_a_line_has_only_itself_for_neighbours(sheet):
    _, faces = sheet()
    mean = neighbour_mean(faces, 225, [np.array([10, 25, 40])])
    assert np.allclose(mean.sum(axis=1), 1.0)
    assert sorted(mean[25].nonzero()[1]) == [10, 40] and len(mean[10].nonzero()[1]) > 2
