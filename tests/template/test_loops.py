"""Loops and walks on tubes and sheets where the answer is known."""

import numpy as np
import pytest

from facewright.errors import StageError
from facewright.template.loops import (
    border_of,
    paired,
    separating_loop,
    shortest_path,
    split_loop,
    straightened,
)

ROUND, HIGH = 12, 9


def tube():
    """A tube of 12 x 9 vertices with its waist at ring 3; polygons ring by ring."""
    angle = np.arange(ROUND) / ROUND * 2 * np.pi
    radius = 5 + np.abs(np.arange(HIGH) - 3.0)
    V = np.stack(
        [
            radius[:, None] * np.cos(angle),
            radius[:, None] * np.sin(angle),
            np.repeat(np.arange(HIGH)[:, None] * 2.0, ROUND, axis=1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    polygons = np.array(
        [
            [r * ROUND + c, r * ROUND + (c + 1) % ROUND, (r + 1) * ROUND + (c + 1) % ROUND, (r + 1) * ROUND + c]
            for r in range(HIGH - 1)
            for c in range(ROUND)
        ]
    )
    return V, polygons


def seeds(polygons):
    ring = np.arange(len(polygons)) // ROUND
    return ring == 0, ring == HIGH - 2


def test_narrowest_loop_is_the_waist():
    V, polygons = tube()
    loop = separating_loop(V, polygons, *seeds(polygons))
    assert sorted(loop) == list(range(3 * ROUND, 4 * ROUND))
    # The inside (rings below) lies to the left of the walk: each step's reverse is an edge of an outside polygon.
    steps = set(zip(loop.tolist(), np.roll(loop, -1).tolist()))
    below = polygons[np.arange(len(polygons)) // ROUND == 2]
    assert (below[0, 2], below[0, 3]) in steps


def test_cheap_edges_win_over_short_ones():
    V, polygons = tube()
    loop = separating_loop(V, polygons, *seeds(polygons), edge_factor=lambda e: np.where(V[e, 2].mean(1) == 12, 0.1, 1))
    assert sorted(loop) == list(range(6 * ROUND, 7 * ROUND))


def test_straightened_gives_the_ring_of_a_wavering_loop():
    V, polygons = tube()
    ring = np.arange(5 * ROUND, 6 * ROUND)
    wavering = np.concatenate([ring[:4], [ring[3] + ROUND, ring[4] + ROUND], ring[4:]])
    assert sorted(straightened(V, polygons, wavering, edge_factor=lambda e: np.ones(len(e)))) == ring.tolist()


def test_no_loop_is_said():
    _, polygons = tube()
    with pytest.raises(StageError, match="no closed edge loop"):
        border_of(polygons, np.zeros(len(polygons), bool))


def test_split_loop_shares_its_ends():
    first, second = split_loop(np.array([4, 5, 6, 7, 8, 9]), 6, 9)
    assert first.tolist() == [6, 7, 8, 9] and second.tolist() == [6, 5, 4, 9]


def test_shortest_path_goes_through_its_stops_and_may_cross_quads():
    V, polygons = tube()
    path = shortest_path(V, polygons, [0, ROUND + 1, 2 * ROUND + 2])
    assert path.tolist() == [0, ROUND + 1, 2 * ROUND + 2]
    assert shortest_path(V, polygons, [5, 7]).tolist() == [5, 6, 7]


def line(*x):
    return np.stack([np.array(x, float), np.zeros(len(x)), np.zeros(len(x))], axis=1)


def test_equal_chains_pair_one_by_one():
    V = np.vstack([line(0, 1, 2, 3, 4), line(0, 1.1, 2.1, 3, 4)])
    first, second = paired(V, np.arange(5), np.arange(5, 10))
    assert first.tolist() == [0, 1, 2, 3, 4] and second.tolist() == [5, 6, 7, 8, 9]


def test_surplus_vertices_are_left_out_where_they_crowd():
    V = np.vstack([line(0, 2, 4, 6, 8), line(0, 0.2, 2, 4, 6, 7.8, 8)])
    first, second = paired(V, np.arange(5), np.arange(5, 12))
    assert len(first) == len(second) == 5
    assert np.allclose(V[first], V[second])
