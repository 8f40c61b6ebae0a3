"""Folds, tears and crossings that were put in on purpose are found, and nothing else."""

import numpy as np
import pytest

from facewright.evaluate import quality


def test_torn_edges_need_both_length_and_factor(sheet):
    vertices, faces = sheet()
    moved = vertices.copy()
    moved[0] -= [6.0, 0, 0]
    torn = quality.torn_edges(vertices, moved, faces)
    assert len(torn)
    assert (torn == 0).any(axis=1).all()
    assert not len(quality.torn_edges(vertices, vertices * 1.5, faces))
    assert not len(quality.torn_edges(vertices, moved, faces, mask=np.arange(len(vertices)) > 0))


def test_two_sheets_that_cross_are_counted_once_per_pair(sheet, turn):
    vertices, faces = sheet(n=5, size=4.0)
    other = (vertices - [2, 2, 0]) @ turn(90).T + [2.03, 2.07, 0.01]
    both, both_faces = np.vstack([vertices, other]), np.vstack([faces, faces + len(vertices)])
    pairs = quality.self_intersections(both, both_faces)
    assert len(pairs)
    assert (pairs[:, 0] < len(faces)).all() and (pairs[:, 1] >= len(faces)).all()
    assert not len(quality.self_intersections(vertices, faces))
    assert len(quality.self_intersections(both, both_faces, np.arange(len(both_faces)) < len(faces))) == 0


def test_crossings_of_the_reference_are_not_new(sheet, turn):
    vertices, faces = sheet(n=5, size=4.0)
    other = (vertices - [2, 2, 0]) @ turn(90).T + [2.03, 2.07, 0.01]
    both, both_faces = np.vstack([vertices, other]), np.vstack([faces, faces + len(vertices)])
    apart = np.vstack([vertices, other + [9.0, 0, 0]])
    everything = np.ones(len(both_faces), bool)
    assert not len(quality.new_self_intersections(both, both, both_faces, everything, everything))
    assert len(quality.new_self_intersections(both, apart, both_faces, everything, everything))


def test_an_opening_shows_its_area(sheet):
    front, faces = sheet(n=41, size=40.0)
    centers = front[faces].mean(axis=1)
    hole = (np.abs(centers - [20, 20, 0]) < [5, 2, 1]).all(axis=1)
    back = front - [0, 0, 10.0]
    vertices = np.vstack([front, back])
    all_faces = np.vstack([faces[~hole], faces + len(front)])
    interior = np.arange(len(all_faces)) >= (~hole).sum()
    seen = quality.visible_interior_mm2(
        vertices, all_faces, interior, [20, 20, 0.0], width_mm=30.0, views=((0.0, 0.0),)
    )
    assert seen == pytest.approx(hole.sum() * 0.5, rel=0.02)


def test_lip_gaps_are_measured_pair_by_pair():
    vertices = np.array([[0.0, 0, 0], [1, 0.2, 0], [2, 0, 0], [1, -0.3, 0]])
    lines = {"lip_seam_upper": np.array([0, 1, 2]), "lip_seam_lower": np.array([0, 3, 2])}
    assert np.allclose(quality.lip_gaps_mm(vertices, lines), [0, 0.5, 0])
