"""A table of radii says how far a surface is, whichever way it is asked."""

import numpy as np

from facewright.mesh.radial import radial_table


def ellipsoid(axes, rings=60, columns=80):
    angle = np.linspace(0.0, np.pi, rings)[:, None]
    turn = 2 * np.pi * np.arange(columns) / columns
    unit = np.stack(np.broadcast_arrays(np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)), 2)
    at = np.arange(rings * columns).reshape(rings, columns)
    a, b, c, d = at[:-1], at[1:], np.roll(at, -1, axis=1)[1:], np.roll(at, -1, axis=1)[:-1]
    faces = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    return unit.reshape(-1, 3) * axes, faces


def test_an_ellipsoid_is_known_in_every_direction():
    axes = np.array([11.0, 12.0, 13.0])
    table = radial_table(*ellipsoid(axes), otherwise=0.0)
    directions = np.random.default_rng(0).normal(size=(500, 3))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    truth = 1.0 / np.linalg.norm(unit / axes, axis=1)
    assert np.abs(table(directions) - truth).max() < 0.03
    np.testing.assert_allclose(table.mirrored()(directions * [-1, 1, 1]), table(directions), atol=1e-9)
    np.testing.assert_allclose(table.scaled(2.0)(directions), 2.0 * table(directions))


def test_where_there_is_no_surface_it_says_so():
    vertices, faces = ellipsoid(np.array([10.0, 10.0, 10.0]))
    front = faces[(vertices[faces][:, :, 2] > 0).all(axis=1)]
    table = radial_table(vertices, front, otherwise=7.0)
    np.testing.assert_allclose(table(np.array([[0, 0.1, 1.0], [0, 0.1, -1.0]])), [10.0, 7.0], atol=0.02)
