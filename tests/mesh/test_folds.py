"""A face turned over by its neighbours' measure is found, and laid flat again."""

import numpy as np
import pytest

from facewright.mesh.folds import folded_by_shape, laid_flat, least_turn


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
    ease = np.ones(len(vertices))
    flat = laid_flat(vertices, moved, faces, ease)
    assert not len(folded_by_shape(vertices, flat, faces))
    away = np.linalg.norm(vertices - vertices[7 * 15 + 7], axis=1) > 5
    assert np.array_equal(flat[away], moved[away])
    assert laid_flat(vertices, flat, faces, ease) is flat


def test_what_may_not_give_way_stays(sheet):
    vertices, faces = sheet()
    moved = vertices.copy()
    pushed = 7 * 15 + 7
    moved[pushed] += [1.3, 0.0, 0.0]
    ease = np.ones(len(vertices))
    ease[pushed] = 0.0
    flat = laid_flat(vertices, moved, faces, ease)
    assert np.array_equal(flat[pushed], moved[pushed]) and not len(folded_by_shape(vertices, flat, faces))
    assert np.linalg.norm(flat - moved, axis=1).max() < 1.5


def test_the_least_turn_is_that_of_a_singular_value_decomposition():
    rng = np.random.default_rng(1)
    covariance, vectors = rng.normal(size=(300, 3, 3)), rng.normal(size=(300, 3))
    covariance[:100, 2] *= 1e-6  # nearly flat
    U, _, Vt = np.linalg.svd(covariance)
    U[np.linalg.det(U @ Vt) < 0, :, 2] *= -1
    assert least_turn(covariance, vectors) == pytest.approx(np.einsum("mji,mj->mi", U @ Vt, vectors), abs=1e-7)


def test_a_turn_that_nothing_tells_is_a_turn_still(turn):
    vectors = np.eye(3)
    covariance = np.stack([np.zeros((3, 3)), np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), turn(40).T])
    turned = least_turn(covariance, vectors)
    assert np.linalg.norm(turned, axis=1) == pytest.approx(1.0)
    assert turned[2] == pytest.approx(turn(40) @ vectors[2])
