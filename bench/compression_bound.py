"""A lower bound of the permutation cost that knows triples of masks: how far any search can come."""

from __future__ import annotations

from itertools import combinations

import numpy as np


def triple_bound(search, enough=np.inf, passes=600):
    """A cost that no state of a PermutationSearch can be below, raised until it is enough or for so many passes.

    A pair of masks costs by its relative permutation alone, and round three masks these must agree: the one from a to
    c is that from a to b, then from b to c. Each pair's cost is split among itself and the triples that hold it; the
    least of every pair and of every triple whose permutations agree sum to a bound, whatever the split. With nothing
    split that is PermutationSearch.bound(). A pass visits all triples: each takes its pairs' costs and shares what it
    then costs at least evenly among them, which never lowers the bound (block coordinate ascent of the dual, as in
    Sontag et al. 2008, "Tightening LP relaxations for MAP using message passing").
    """
    m, turns = search.m, len(search.permutations)
    own = search.table[:, :, :, 0].astype(np.float64)  # [a, b, q]: a as it is, b permuted by q
    triples = np.array(list(combinations(range(m), 3)))
    # Two triples of one batch have no pair in common: two masks and the sum, modulo m, tell the third.
    batches = [triples[triples.sum(axis=1) % m == rest] for rest in range(m)]
    parts = [np.zeros((len(batch), 3, turns)) for batch in batches]
    after = search.compose.T  # [q_ab, q_bc] -> q_ac = q_bc after q_ab
    order = np.argsort(after, axis=None, kind="stable")  # the turns ways to come to each q_ac, side by side
    bound = -np.inf
    for step in range(passes):
        for batch, part in zip(batches, parts):
            edges = [(batch[:, i], batch[:, j]) for i, j in ((0, 1), (1, 2), (0, 2))]
            costs = [own[edge] + part[:, i] for i, edge in enumerate(edges)]
            whole = _whole(costs, after)
            through = whole.reshape(len(batch), -1)[:, order].reshape(len(batch), turns, turns)
            least = whole.min(axis=2), whole.min(axis=1), through.min(axis=2)
            for i, edge in enumerate(edges):
                own[edge] = least[i] / 3
                part[:, i] = costs[i] - own[edge]
        if step % 20 == 19 or step == passes - 1:
            bound = own[np.triu_indices(m, 1)].min(axis=1).sum()
            bound += sum(_whole(part.transpose(1, 0, 2), after).min(axis=(1, 2)).sum() for part in parts)
            if bound >= enough:
                break
    return float(bound)


def _whole(costs, after):
    """(triples, q_ab, q_bc) cost of triples from that of their pairs ab, bc, ac, each (triples, q)."""
    return costs[0][:, :, None] + costs[1][:, None] + costs[2][:, after]
