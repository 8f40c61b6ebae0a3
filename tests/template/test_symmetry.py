"""Mirror maps of meshes whose symmetry is known."""

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.template.symmetry import mirror_map, mirrored_field, symmetrized


def grid(noise=0.0):
    """A sheet of 5 x 4 vertices, symmetric about x = 0, and its mirror map."""
    x, y = np.meshgrid(np.arange(-2.0, 3.0) * 3, np.arange(4.0) * 2)
    V = np.stack([x, y, np.abs(x) / 7], axis=-1).reshape(-1, 3)
    V += noise * np.random.default_rng(0).normal(size=V.shape)
    polygons = np.array([[r * 5 + c, r * 5 + c + 1, r * 5 + c + 6, r * 5 + c + 5] for r in range(3) for c in range(4)])
    twin = np.array([r * 5 + 4 - c for r in range(4) for c in range(5)])
    return V, polygons, twin


def test_mirror_of_a_noisy_sheet():
    V, polygons, twin = grid(noise=0.05)
    assert np.array_equal(mirror_map(V, polygons), twin)


def test_strips_back_to_back_are_told_apart_by_their_neighbours():
    V, polygons, twin = grid()
    n = len(V)
    behind = V.copy()
    behind[:10, 2] += 0.5  # the upper half of the second sheet lies on the first
    both = np.vstack([V, behind])
    mirror = mirror_map(both, np.vstack([polygons, polygons + n]))
    assert np.array_equal(mirror, np.concatenate([twin, twin + n]))


def test_groups_keep_parts_apart():
    V, polygons, twin = grid()
    n = len(V)
    group = np.repeat([0, 1], n)
    mirror = mirror_map(np.vstack([V, V]), np.vstack([polygons, polygons + n]), groups=group, twin_groups=1 - group)
    assert np.array_equal(mirror, np.concatenate([twin + n, twin]))


def test_a_lone_vertex_is_refused():
    V, polygons, _ = grid()
    V[0, 1] += 5
    with pytest.raises(InputError, match="mirrored twin"):
        mirror_map(V, polygons)


def test_symmetrized_is_exact_and_leaves_symmetric_alone():
    V, _, twin = grid(noise=0.05)
    even = symmetrized(V, twin)
    assert np.array_equal(even[twin] * [-1, 1, 1], even)
    assert np.array_equal(symmetrized(even, twin), even)


def test_mirrored_field_is_an_involution():
    _, _, twin = grid()
    field = np.random.default_rng(1).normal(size=(3, len(twin), 3))
    assert np.array_equal(mirrored_field(mirrored_field(field, twin), twin), field)
