"""The published method: masks, permutation search against brute force, and what its parts promise."""

from itertools import product

import numpy as np
import pytest

from facewright.compress import FacezipOptions, facezip
from facewright.compress.masks import build_masks
from facewright.compress.published import PermutationSearch, best_published, cluster_fragments, published_search
from facewright.compress.synthetic import bowl, expression_set
from facewright.compress.tiles import TextureTiles
from facewright.errors import InputError


@pytest.fixture(scope="module")
def made():
    return expression_set(96, 10)


def test_masks_sum_to_one_and_are_not_negative(made):
    tiles = TextureTiles.of(made.neutral, made.textures, made.covered)
    masks, about = build_masks(made.mesh, tiles.grid, 20)
    assert masks.min() >= 0 and np.abs(masks.sum(axis=2) - 1).max() < 1e-5
    assert about["masks"] == 20 and about["radius_mm"] > 5 and about["lowest_before_clip"] < 0


def test_the_search_finds_the_best_of_all_states():
    rng = np.random.default_rng(0)
    costs = rng.random((4, 4, 3, 3))
    costs = costs + costs.transpose(1, 0, 3, 2)
    costs[range(4), range(4)] = 0
    search = PermutationSearch(costs)
    every = np.array(list(product(range(6), repeat=4)))
    assert search.cost(search.solve(0)[None])[0] == pytest.approx(search.cost(every).min(), rel=1e-5)


@pytest.mark.parametrize("count", [9, 20])
def test_the_search_beats_random_restarts_and_seeds_agree(count):
    made = expression_set((120, 96), count, seed=3)
    tiles = TextureTiles.of(made.neutral, made.textures, made.covered)
    search = published_search(tiles, build_masks(made.mesh, tiles.grid, 53)[0], 4)[0]
    best = search.restarts(100)[0].min()
    found = [search.cost(search.solve(seed)[None])[0] for seed in range(3)]
    assert search.bound() <= min(found) and max(found) <= best and max(found) <= 1.01 * min(found)


def test_clusters_of_separate_groups_are_these_groups():
    rng = np.random.default_rng(0)
    x = np.repeat(10 * rng.normal(size=(4, 30)), 5, axis=0) + 0.1 * rng.normal(size=(20, 30))
    labels = cluster_fragments((x @ x.T)[None], 4)[0].reshape(4, 5)
    assert (labels == labels[:, :1]).all() and len(set(labels[:, 0])) == 4


def test_permutation_helps_and_a_budget_chooses_masks(made):
    rmse = {
        permute: facezip(
            made.neutral, made.textures, mesh=made.mesh, options=FacezipOptions("paper", masks=20, permute=permute)
        ).report["mean_rmse"]
        for permute in (True, False)
    }
    assert rmse[True] < rmse[False]
    tiles = TextureTiles.of(made.neutral, made.textures, made.covered)
    options = FacezipOptions("paper", budget=10**9)
    result, _ = best_published(tiles, 4, options, made.mesh, None, lambda stage, share: None)
    assert result["report"]["masks"] in (13, 33, 53, 83)


def test_more_masks_than_the_search_can_hold_are_refused():
    made = expression_set(64, 6)
    dense = bowl(rings=40, spokes=40)
    with pytest.raises(InputError, match=r"1500 masks are too many .* 589 are possible"):
        facezip(made.neutral, made.textures, mesh=dense, options=FacezipOptions("paper", masks=1500))
