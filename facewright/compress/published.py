"""The published method: fragments under smooth masks, four clusters in each, and the permutation that joins them.

Neither clustering nor permutation looks at a pixel: k-means needs the N x N inner products of a mask's fragments, the
permutation cost (Eq. 3-4) those of the centroids under two masks, and both are sums of the Gram matrices of blocks.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import permutations
from math import factorial, isqrt

import numpy as np

from facewright.compress.masks import build_masks
from facewright.compress.refine import Pass
from facewright.compress.store import measure_tiles, quantise_textures, quantise_weights, root_mean, stored_parts
from facewright.compress.threads import in_threads
from facewright.errors import InputError

MOST_BLOCKS = 64
MASK_CHOICES = (13, 33, 53, 83)
# Entries of the table of the search, which needs 24 bytes for each while it is made: 589 masks of 4 textures, 117 of 5.
MOST_ENTRIES = 200_000_000


def coarse_grams(tiles, masks):
    """Grams and mask values on at most 64 x 64 blocks of tiles: (b, N, N) float32 and (b, k)."""
    rows, columns = tiles.grid.tiles
    corner = masks.reshape(-1, masks.shape[2])[tiles.grid.corner_cells()].mean(axis=1)
    corner = corner.reshape(rows, columns, -1)
    step = max(1, -(-max(rows, columns) // MOST_BLOCKS))
    starts = np.arange(0, columns, step)

    def one(top):
        """The blocks of some rows of tiles: no two calls add to the same block, so the sums come out the same."""
        below = min(top + step, rows)
        grams = np.zeros((len(starts), tiles.count, tiles.count), np.float32)
        for row in range(top, below):
            x = tiles.differences(slice(row * columns, (row + 1) * columns))
            grams += np.add.reduceat(x @ x.transpose(0, 2, 1), starts, axis=0)
        values = np.add.reduceat(corner[top:below].sum(axis=0), starts, axis=0)
        counts = (below - top) * np.diff(np.append(starts, columns))
        return grams, (values / counts[:, None]).astype(np.float32)

    grams, values = zip(*in_threads(one, range(0, rows, step)))
    return np.concatenate(grams), np.concatenate(values)


def cluster_fragments(grams, k, *, restarts=20, iterations=30, seed=0, progress=None):
    """(masks, N) cluster of every fragment: k-means (best of some restarts) on the masks' Gram matrices (m, N, N)."""
    m, n, _ = grams.shape
    rng = np.random.default_rng(seed)
    best, best_cost = np.zeros((m, n), int), np.full(m, np.inf)
    diagonal = np.einsum("mnn->mn", grams)
    for restart in range(restarts):
        # k-means++: each next centre with a probability like its squared distance to the nearest one.
        centres = rng.integers(n, size=(m, 1))
        near = _from_points(grams, diagonal, centres[:, 0])
        for _ in range(k - 1):
            share = np.cumsum(near + 1e-12, axis=1)
            pick = (share < rng.random((m, 1)) * share[:, -1:]).sum(axis=1).clip(max=n - 1)
            centres = np.concatenate([centres, pick[:, None]], axis=1)
            near = np.minimum(near, _from_points(grams, diagonal, pick))
        distance = np.stack([_from_points(grams, diagonal, centres[:, i]) for i in range(k)], axis=2)
        labels = distance.argmin(axis=2)
        for _ in range(iterations):
            one_hot = (labels[:, :, None] == np.arange(k)).astype(grams.dtype)
            size = one_hot.sum(axis=1)
            mean = one_hot / np.maximum(size, 1)[:, None]
            cross = grams @ mean
            own = np.einsum("mnk,mnk->mk", mean, cross)
            distance = np.where(size[:, None] > 0, diagonal[:, :, None] - 2 * cross + own[:, None], np.inf)
            following = distance.argmin(axis=2)
            if (following == labels).all():
                break
            labels = following
        cost = np.take_along_axis(distance, labels[:, :, None], axis=2)[:, :, 0].sum(axis=1)
        better = cost < best_cost * (1 - 1e-9)
        best[better], best_cost[better] = labels[better], cost[better]
        if progress is not None:
            progress((restart + 1) / restarts)
    return best


def _from_points(grams, diagonal, index):
    m = np.arange(len(grams))
    return np.maximum(diagonal + diagonal[m, index][:, None] - 2 * grams[m, index], 0)


def centroid_matrix(labels, k):
    """(m, k, N): row i of mask m averages the fragments of cluster i; an empty cluster is zero."""
    one_hot = (labels[:, None, :] == np.arange(k)[None, :, None]).astype(np.float32)
    return one_hot / np.maximum(one_hot.sum(axis=2, keepdims=True), 1)


def pair_costs(block_grams, block_masks, centroids):
    """(m, m, k, k) squared difference of centroid a of mask 1 and b of mask 2 under both masks (Eq. 3-4)."""
    m, k, n = centroids.shape
    flat = block_grams.reshape(len(block_grams), -1)
    squares = block_masks**2
    costs = np.zeros((m, m, k, k))
    for one in range(m):
        others = np.arange(one + 1, m)
        if not len(others):
            continue
        weight = squares[:, one]
        near = weight > 1e-8
        gram = ((squares[near][:, others] * weight[near, None]).T @ flat[near]).reshape(-1, n, n)
        u = np.broadcast_to(centroids[one], (len(others), k, n))
        v = centroids[others]
        uu = np.einsum("pkn,pkn->pk", u @ gram, u)
        vv = np.einsum("pkn,pkn->pk", v @ gram, v)
        uv = u @ gram @ v.transpose(0, 2, 1)
        cost = np.maximum(uu[:, :, None] + vv[:, None] - 2 * uv, 0)
        costs[one, others] = cost
        costs[others, one] = cost.transpose(0, 2, 1)
    return costs


class PermutationSearch:
    """Cost of every pair of permutations of every pair of masks in one table: a sweep only looks numbers up.

    costs (m, m, k, k) from pair_costs; a state is (chains, m), the number of a permutation for each mask
    """

    def __init__(self, costs):
        self.m, k = len(costs), costs.shape[2]
        self.permutations = np.array(list(permutations(range(k))))
        p = self.permutations
        table = sum(costs[:, :, p[:, None, i], p[None, :, i]] for i in range(k))
        self.table = np.ascontiguousarray(table.transpose(0, 1, 3, 2)).astype(np.float32)  # [mask, other, its p, p]
        self.moves = self.table.transpose(1, 2, 0, 3)  # [other, its p, mask, p]
        number = {tuple(row): i for i, row in enumerate(p)}
        self.compose = np.array([[number[tuple(a[b])] for b in p] for a in p])
        self.coupled = np.argsort(-costs.sum(axis=(2, 3)), axis=1)

    def cost(self, states):
        """(chains,) cost of Eq. 3 over unordered pairs."""
        m = np.arange(self.m)
        pairs = self.table[m[:, None], m[None], states[:, None, :], states[:, :, None]]
        return pairs.sum(axis=(1, 2), dtype=np.float64) / 2

    def bound(self):
        """A cost that no state can be below: every pair of masks at its best, whatever the others want."""
        return float(self.table.min(axis=(2, 3)).sum(dtype=np.float64) / 2)

    def sweep(self, states):
        """One sweep of the published search: each mask in turn takes its best permutation; in place."""
        m = np.arange(self.m)
        for k in range(self.m):
            states[:, k] = self.table[k][m, states].sum(axis=1).argmin(axis=1)

    def restarts(self, count, seed=0, sweeps=10):
        """(count,) costs of the published search (random starts, 10 sweeps), the best state, and costs per sweep."""
        rng = np.random.default_rng(seed)
        states = rng.integers(len(self.permutations), size=(count, self.m))
        history = [self.cost(states)]
        for _ in range(sweeps):
            self.sweep(states)
            history.append(self.cost(states))
        return history[-1], states[history[-1].argmin()], np.array(history)

    def solve(self, seed=0, chains=32, rounds=200, progress=None):
        """The best state found: half the chains start from growing, half by chance, then descent with kicks.

        A kick takes a mask and those coupled to it most, and either permutes them alike or takes them out and grows
        them again from another permutation of the first. On 41 sets of 5 to 20 textures four seeds differed by 0.6 % at
        most, with 100 rounds six by 6.9 %. Of other things tried, chance starts alone and acceptance of worse states
        (annealing) left seeds further apart; states crossed with one another gained nothing.
        """
        rng = np.random.default_rng(seed)
        turns, most = len(self.permutations), max(1, 3 * self.m // 4)
        if turns == 1:
            return np.zeros(self.m, int)
        grown = self._grown_starts()
        states = rng.integers(turns, size=(chains, self.m))
        states[: chains // 2] = grown[self.cost(grown).argsort(kind="stable")][np.arange(chains // 2) % self.m]
        fields = self._fields(states)
        self._descend(states, fields)
        cost = self._cost_of(states, fields)
        for round_number in range(rounds):
            trial, around = states.copy(), fields.copy()
            first, size = rng.integers(self.m, size=chains), rng.integers(1, most + 1, size=chains)
            turn = rng.integers(1, turns, size=chains)
            alike = np.arange(chains) % 2 == round_number % 2
            placed = np.ones((chains, self.m), bool)
            for step in range(size.max()):
                chain = np.flatnonzero(alike & (size > step))
                mask = self.coupled[first[chain], step]
                self._move(trial, around, chain, mask, self.compose[trial[chain, mask], turn[chain]])
                chain = np.flatnonzero(~alike & (size > step))
                mask = self.coupled[first[chain], step]
                around[chain] -= self.moves[mask, trial[chain, mask]]
                placed[chain, mask] = False
            chain = np.flatnonzero(~alike)
            mask = first[chain]
            self._place(trial, around, placed, chain, mask, self.compose[trial[chain, mask], turn[chain]])
            self._grow(trial, around, placed)
            self._descend(trial, around)
            found = self._cost_of(trial, around)
            better = found < cost
            states[better], fields[better], cost[better] = trial[better], around[better], found[better]
            if round_number % 20 == 19:  # the worse half goes on from the better half
                good, bad = np.split(cost.argsort()[: chains // 2 * 2], 2)
                states[bad], fields[bad], cost[bad] = states[good], fields[good], cost[good]
            if progress is not None:
                progress((round_number + 1) / rounds)
        return states[cost.argmin()]

    def _grown_starts(self):
        """(m, m) states grown from each mask in turn, after descent."""
        masks = np.arange(self.m)
        states, placed = np.zeros((self.m, self.m), int), np.zeros((self.m, self.m), bool)
        fields = np.zeros((self.m, self.m, len(self.permutations)), np.float32)
        self._place(states, fields, placed, masks, masks, np.zeros(self.m, int))
        self._grow(states, fields, placed)
        self._descend(states, fields)
        return states

    def _grow(self, states, fields, placed):
        """Place what is missing, in each chain first the mask that would lose most by its second best; in place."""
        while len(chain := np.flatnonzero(~placed.all(axis=1))):
            open_fields = fields[chain]
            best = np.partition(open_fields, 1, axis=2)
            mask = np.where(placed[chain], -np.inf, best[:, :, 1] - best[:, :, 0]).argmax(axis=1)
            self._place(states, fields, placed, chain, mask, open_fields[np.arange(len(chain)), mask].argmin(axis=1))

    def _place(self, states, fields, placed, chain, mask, to):
        """Count a missing mask of some chains with a permutation; in place."""
        states[chain, mask], placed[chain, mask] = to, True
        fields[chain] += self.moves[mask, to]

    def _cost_of(self, states, fields):
        """(chains,) what cost() says, from the fields."""
        return np.take_along_axis(fields, states[:, :, None], axis=2).sum(axis=(1, 2), dtype=np.float64) / 2

    def _fields(self, states):
        """(chains, m, p): what each permutation of each mask would cost, the other masks as they are."""
        return sum(self.moves[j, states[:, j]] for j in range(self.m))

    def _move(self, states, fields, chain, mask, to):
        """Give one mask of each of some chains another permutation, in place."""
        fields[chain] += self.moves[mask, to] - self.moves[mask, states[chain, mask]]
        states[chain, mask] = to

    def _descend(self, states, fields):
        """In every chain the mask that gains most takes its best permutation, until none gains; in place."""
        chain = np.arange(len(states))
        least = 1e-6 * float(np.abs(fields).max())
        while len(chain):
            now = np.take_along_axis(fields[chain], states[chain][:, :, None], axis=2)[:, :, 0]
            gain = now - fields[chain].min(axis=2)
            mask = gain.argmax(axis=1)
            going = gain[np.arange(len(chain)), mask] > least
            chain, mask = chain[going], mask[going]
            self._move(states, fields, chain, mask, fields[chain, mask].argmin(axis=1))


def published_maps(masks, labels, centroids, chosen):
    """Weight maps (rows, columns, N, K) of Eq. 6, and the shares (rows, columns, N, K) that make D of Eq. 5.

    chosen  (m, K): cluster of each mask that goes into each difference texture
    """
    m = np.arange(len(labels))
    slot = np.argsort(chosen, axis=1)  # cluster -> texture
    alpha = (slot[m[:, None], labels][:, :, None] == np.arange(chosen.shape[1])).astype(np.float32)
    picked = centroids[m[:, None], chosen].transpose(0, 2, 1)  # (m, N, K)
    return np.tensordot(masks, alpha, 1), np.tensordot(masks, picked, 1)


def best_published(tiles, k, options, mesh, region, progress):
    """What is stored of the published method, and its errors (store.measure_tiles); with a budget the best of
    MASK_CHOICES."""
    if mesh is None:
        raise InputError("compress: --method paper computes its masks on the mesh; give one with UVs")
    counts = (options.masks,) if options.budget is None else MASK_CHOICES
    best = None
    for count in counts:
        result = _encode_published(tiles, k, replace(options, masks=count), mesh, region, progress)
        errors = measure_tiles(tiles, result)
        if best is None or root_mean(errors).mean() < root_mean(best[1]).mean():
            best = result, errors
    return best


def _encode_published(tiles, k, options, mesh, region, progress):
    most = isqrt(MOST_ENTRIES) // factorial(max(k, 4))
    if min(options.masks, len(mesh.vertices)) > most:
        raise InputError(
            f"compress: {options.masks} masks are too many to search with {k} difference textures; {most} are possible"
        )
    masks, about = build_masks(mesh, tiles.grid, options.masks, seed=options.seed, region=region)
    weights, shares, cost = published_solution(tiles, masks, k, options.seed, options.permute, progress)
    n = tiles.count
    work = Pass(tiles, k)
    flat = np.ascontiguousarray(shares).reshape(-1, n, k)
    d = np.empty((len(tiles), k, tiles.channels, tiles.grid.texels), np.float32)

    def one(part):
        rows = flat[work.corners[part]].transpose(0, 1, 3, 2).reshape(-1, 4 * k, n)
        y = (rows @ tiles.differences(part, whole=True)).reshape(-1, 4, k, tiles.channels, tiles.grid.texels)
        d[part] = (y * work.basis[:, None, None]).sum(axis=1)

    in_threads(one, tiles.chunks())
    image = tiles.grid.join(d.reshape(len(d), -1, tiles.grid.texels)).reshape(
        tiles.grid.height, tiles.grid.width, k, -1
    )
    stored = quantise_weights(np.ascontiguousarray(weights.transpose(2, 0, 1, 3)))
    report = {**about, "permutation_cost": cost, "solution": "published"}
    return stored_parts(tiles, quantise_textures(tiles, image), stored, report)


def published_search(tiles, masks, k, seed=0, progress=None):
    """PermutationSearch of a set under masks (rows, columns, m), the labels and the centroids."""
    blocks, values = coarse_grams(tiles, masks)
    per_mask = np.tensordot(values.T**2, blocks, 1)
    labels = cluster_fragments(per_mask, k, seed=seed, progress=progress and partial(progress, "clustering"))
    centroids = centroid_matrix(labels, k)
    return PermutationSearch(pair_costs(blocks, values, centroids)), labels, centroids


def published_solution(tiles, masks, k, seed=0, permute=True, progress=None):
    """Weight maps, the shares that make the difference textures, and the permutation cost."""
    search, labels, centroids = published_search(tiles, masks, k, seed, progress)
    told = progress and partial(progress, "searching")
    state = search.solve(seed, progress=told) if permute else np.zeros(len(labels), int)
    chosen = search.permutations[state]
    weights, shares = published_maps(masks, labels, centroids, chosen)
    return weights, shares, float(search.cost(state[None])[0])
