"""Difference textures and weight maps together: the smallest reconstruction error that the stored form allows.

Minimises over D and w   sum over n of |X_n - sum_i D_i U(w_in)|^2 + ridge |D|^2 + smooth |grad w|^2,   U the bilinear
upsampling of the GPU. With w held, D is a K x K system a texel; with D held, all N weight maps share one 9-point
system of K x K blocks on the lattice of cells. One pass over the textures does the first exactly and gathers the
second. Constant PCA weights are the start, hence a solution is never worse than PCA(K). The last passes hold D rounded
as it will be stored, so that the weights make up for what rounding and clipping leave.

Tried on 20 unrelated faces at a quarter of their texels, float error over that of PCA(8) after 15 and 60 passes (this
start 0.401, 0.379): the components of every cell's own texels, turned to agree with their neighbours, 0.398, 0.379;
Anderson's acceleration in place of momentum: behind from the tenth pass on; eight sweeps for four: no change;
second-order steps in the basis of every cell beside each pass, without momentum: as far in 16 passes as momentum in 30,
at more than twice the work. The published start (masks, clusters, permutation) ends no lower: 3.09 against 3.06 at full
size.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from facewright.compress.threads import THREADS, in_threads
from facewright.compress.tiles import CELL, bilinear_basis

SWEEPS = 4
SMOOTH = 3e-4
RIDGE = 0.003
# Passes: so many, and more where they are cheap: PLENTY over tiles of 64 texels times textures (0.7 seconds of two
# cores), MOST at most, as long as one takes PAYS of the error's square. With finer cells a pass takes twice as long.
PASSES, MOST, PLENTY, PAYS = 15, 90, 9e5, 1e-3
FINE_PASSES, FINE_COST = 8, 2
# Passes that know how the textures will be stored.
SETTLING = 2


def gram_matrix(tiles):
    """(N, N) inner products of all differences."""

    def one(part):
        x = tiles.differences(part)
        return (x @ x.transpose(0, 2, 1)).sum(axis=0, dtype=np.float64)

    return sum(in_threads(one, tiles.covered_chunks()), np.zeros((tiles.count, tiles.count)))


def pca_weights(gram, k):
    """(N, k) weights of the k leading components without mean, mean square 1, from the (N, N) Gram matrix."""
    values, vectors = np.linalg.eigh(gram)
    order = np.argsort(values)[::-1][:k]
    weights = np.zeros((len(gram), k))
    weights[:, : len(order)] = vectors[:, order] * np.sqrt(len(gram))
    # Components without energy would leave the system singular.
    weights[:, : len(order)] *= values[order] > 1e-9 * max(values.max(), 1e-30)
    return weights


class Pass:
    """One pass over the tiles with weights held: D per texel, the objective, and the system of the weights."""

    def __init__(self, tiles, k, fixed=()):
        self.tiles, self.k, self.fixed = tiles, k, tuple(fixed)
        self.basis = bilinear_basis(tiles.grid.cell)
        self.products = np.einsum("ap,bp->abp", self.basis, self.basis).reshape(16, -1)
        self.corners, self.covered = tiles.grid.corner_cells(), tiles.covered_chunks()

    def solve_textures(self, weights, part, ridge, x=None, nearest=None):
        """D (tiles, K, C, P) for weights (cells, N, K), the objective of these tiles, and their differences.

        nearest  function (i, values of texture i) -> the nearest that can be stored
        """
        tiles, k = self.tiles, self.k
        x = tiles.differences(part) if x is None else x
        rows = self._corner_rows(weights, part)
        t = len(rows)
        projected = (rows @ x).reshape(t, 4, k, tiles.channels, -1)
        b = projected[:, 0] * self.basis[0]
        for c in range(1, 4):
            b += projected[:, c] * self.basis[c]
        a = self._normal(rows)
        held = {i: x[:, n].reshape(t, tiles.channels, -1) for i, n in enumerate(self.fixed)}
        d = _solve_texels(a, b, k, ridge, held, nearest)
        value = -np.vdot(b, d)
        for h in held:  # these are not what minimises
            left = sum(a[max(h, j), min(h, j)][:, None] * d[:, j] for j in range(k)) - b[:, h]
            value += np.vdot(d[:, h], left)
        return d, value, x

    def round_textures(self, weights, part, ridge, wanted, nearest):
        """D that can be stored (see solve_textures) and loses least against a wanted D (tiles, K, C, P)."""
        a, k = self._normal(self._corner_rows(weights, part)), self.k
        b = ridge * wanted
        for i in range(k):
            for j in range(k):
                b[:, i] += a[max(i, j), min(i, j)][:, None] * wanted[:, j]
        return _solve_texels(a, b, k, ridge, {}, nearest)

    def blended(self, weights, part, d):
        """(tiles, N, C, P) what D (tiles, K, C, P) and weights (cells, N, K) make of the differences."""
        corner = weights[self.corners[part]].transpose(0, 2, 1, 3).reshape(len(d), -1, 4 * self.k)
        e = (d[:, None] * self.basis[:, None, None]).reshape(len(d), 4 * self.k, -1)
        return (corner @ e).reshape(len(d), -1, *d.shape[2:])

    def _corner_rows(self, weights, part):
        """(tiles, 4 K, N) weights of the corners of tiles."""
        corner = weights[self.corners[part]]  # (t, 4, N, K)
        return np.ascontiguousarray(corner.transpose(0, 1, 3, 2)).reshape(len(corner), 4 * self.k, -1)

    def _normal(self, rows):
        """Entries i, j (i >= j) of the K x K matrix of every texel, (tiles, P) each."""
        t, k = len(rows), self.k
        gram = (rows @ rows.transpose(0, 2, 1)).reshape(t, 4, k, 4, k)
        return {
            (i, j): np.ascontiguousarray(gram[:, :, i, :, j]).reshape(t, 16) @ self.products
            for i in range(k)
            for j in range(i + 1)
        }

    def gather(self, weights, ridge, rounding=None):
        """Objective, stencil (rows, columns, 3, 3, K, K) and right-hand side (rows, columns, K, N).

        rounding  function part -> nearest of solve_textures()
        """
        tiles, k, n = self.tiles, self.k, self.tiles.count
        normal = np.zeros((len(tiles), 4 * k, 4 * k), np.float32)
        right = np.zeros((len(tiles), 4 * k, n), np.float32)

        def one(part):
            d, value, x = self.solve_textures(weights, part, ridge, nearest=rounding and rounding(part))
            e = (d[:, None] * self.basis[:, None, None, :]).reshape(len(d), 4 * k, -1)
            normal[part] = e @ e.transpose(0, 2, 1)
            right[part] = e @ x.transpose(0, 2, 1)
            return float(value)

        value = sum(in_threads(one, self.covered))
        return value, *_assemble(tiles.grid, k, normal, right)


def _solve_texels(a, b, k, ridge, held, nearest=None):
    """d (t, K, C, P) with (A + ridge) d = b at every texel, by Cholesky; textures in held keep their values.

    With nearest every value is rounded before the next is solved for, which then makes up for it (Babai 1986).
    """
    nearest = nearest or (lambda i, values: values)
    held = {i: nearest(i, value) for i, value in held.items()}
    d = np.empty_like(b)
    for i, value in held.items():
        d[:, i] = value
    free = [i for i in range(k) if i not in held]
    factor, y = {}, {}
    for m, i in enumerate(free):
        rest = b[:, i].copy()
        for h, value in held.items():
            rest -= a[max(i, h), min(i, h)][:, None] * value
        for q in range(m):
            j = free[q]
            entry = a[i, j] - sum(factor[i, free[s]] * factor[j, free[s]] for s in range(q))
            factor[i, j] = entry * factor[j, j]
            rest -= factor[i, j][:, None] * y[j]
        pivot = a[i, i] + ridge - sum(factor[i, free[s]] ** 2 for s in range(m))
        factor[i, i] = 1.0 / np.sqrt(np.maximum(pivot, 0.5 * ridge))
        y[i] = rest * factor[i, i][:, None]
    for m in reversed(range(len(free))):
        i = free[m]
        rest = y[i]
        for q in range(m + 1, len(free)):
            rest = rest - factor[free[q], i][:, None] * d[:, free[q]]
        d[:, i] = nearest(i, rest * factor[i, i][:, None])
    return d


def _assemble(grid, k, normal, right):
    """The tiles' systems summed over the cells they share: stencil (m, n, 3, 3, K, K) and right side (m, n, K, N)."""
    rows, columns = grid.tiles
    normal = normal.reshape(rows, columns, 2, 2, k, 2, 2, k)
    right = right.reshape(rows, columns, 2, 2, k, -1)
    # Beyond the border the weight is the border's own: what belongs to the missing cell is added to the real one.
    for index, away, kept in ((0, 0, 1), (-1, 1, 0)):
        normal[index, :, kept] += normal[index, :, away]
        normal[index, :, :, :, :, kept] += normal[index, :, :, :, :, away]
        right[index, :, kept] += right[index, :, away]
        normal[:, index, :, kept] += normal[:, index, :, away]
        normal[:, index, :, :, :, :, kept] += normal[:, index, :, :, :, :, away]
        right[:, index, :, kept] += right[:, index, :, away]
    m, n = rows - 1, columns - 1
    stencil = np.zeros((m, n, 3, 3, k, k), np.float32)
    total = np.zeros((m, n, k, right.shape[-1]), np.float32)

    def one(band):
        # Every cell (y, x) is corner (a, b) of tile (y + 1 - a, x + 1 - b).
        for a in range(2):
            for b in range(2):
                at = (slice(band.start + 1 - a, band.stop + 1 - a), slice(1 - b, 1 - b + n))
                total[band] += right[at][:, :, a, b]
                for p in range(2):
                    for q in range(2):
                        stencil[band, :, 1 + p - a, 1 + q - b] += normal[at][:, :, a, b, :, p, q]

    in_threads(one, _bands(m))
    stencil[0, :, 0] = stencil[-1, :, 2] = 0
    stencil[:, 0, :, 0] = stencil[:, -1, :, 2] = 0
    return stencil, total


def _bands(rows, count=4 * THREADS):
    """Slices of rows, a few for each thread."""
    edges = np.linspace(0, rows, min(count, rows) + 1).astype(int)
    return [slice(a, b) for a, b in pairwise(edges)]


def smooth_weights(stencil, right, weights, smooth, sweeps=SWEEPS):
    """Weights (rows, columns, K, N) after block Gauss-Seidel sweeps in four colours; stencil is changed."""
    rows, columns, k, n = weights.shape
    mean = float(np.mean(np.trace(stencil[:, :, 1, 1], axis1=-2, axis2=-1))) / k
    strength = np.float32(smooth * max(mean, 1e-12))
    eye = np.eye(k, dtype=np.float32) * strength
    for dy, dx, inner in (
        (0, 1, (slice(1, None), slice(None))),
        (2, 1, (slice(None, -1), slice(None))),
        (1, 0, (slice(None), slice(1, None))),
        (1, 2, (slice(None), slice(None, -1))),
    ):
        stencil[(*inner, dy, dx)] -= eye
        stencil[(*inner, 1, 1)] += eye
    stencil[:, :, 1, 1] += eye * np.float32(1e-3)
    padded = np.zeros((rows + 2, columns + 2, k, n), np.float32)
    padded[1:-1, 1:-1] = weights
    around = [(y, x) for y in range(3) for x in range(3) if (y, x) != (1, 1)]
    jobs = []  # one list for each colour; cells of a colour are no neighbours, hence bands may run side by side
    for y0, x0 in ((0, 0), (0, 1), (1, 0), (1, 1)):
        bands = _bands(len(range(y0, rows, 2)))
        # A map of one column has no cells of every colour.
        jobs.append([_Colour(y0 + 2 * band.start, y0 + 2 * band.stop, x0) for band in bands if x0 < columns])
    in_threads(lambda job: job.prepare(stencil, right, around), [job for colour in jobs for job in colour])
    for _ in range(sweeps):
        for colour in jobs:
            in_threads(lambda job: job.sweep(padded), colour)
    return padded[1:-1, 1:-1].copy()


class _Colour:
    """Cells (top, x0), (top, x0 + 2), ... of every second row down to bottom, and their part of the system."""

    def __init__(self, top, bottom, x0):
        self.top, self.bottom, self.x0 = top, bottom, x0

    def prepare(self, stencil, right, around):
        """Copy what the sweeps need into one piece of memory."""
        at = (slice(self.top, self.bottom, 2), slice(self.x0, None, 2))
        here, self.around = stencil[at], around
        self.inverse = np.linalg.inv(here[:, :, 1, 1])
        off = np.stack([here[:, :, y, x] for y, x in around], axis=3)  # (r, c, K, 8, K)
        # inverse @ (right - off @ near), the inverse multiplied in once
        self.off = self.inverse @ off.reshape(*off.shape[:3], -1)
        self.right = self.inverse @ right[at]

    def sweep(self, padded):
        """New weights of these cells from those around them, in place."""
        rows, columns = self.right.shape[:2]
        near = [
            padded[self.top + y : self.top + y + 2 * rows - 1 : 2, self.x0 + x : self.x0 + x + 2 * columns - 1 : 2]
            for y, x in self.around
        ]
        at = (slice(self.top + 1, self.top + 2 * rows, 2), slice(self.x0 + 1, self.x0 + 2 * columns, 2))
        padded[at] = self.right - self.off @ np.concatenate(near, axis=2)


def refine(tiles, start, *, energy, iterations=None, ridge=RIDGE, smooth=SMOOTH, keep=(), progress=None):
    """Weight maps (rows, columns, N, K) float32 that minimise the reconstruction error, and the objective per pass.

    start       (N, K) constant weights, mean square 1
    energy      sum of the squares of all differences; the objective is what falls below it
    iterations  passes; None: as many as pay, where they are cheap
    keep        indices of textures that difference textures 0, 1, ... hold exactly
    """
    rows, columns = tiles.grid.cells
    n, k = start.shape
    work = Pass(tiles, k, keep)
    most = passes_within(tiles) if iterations is None else iterations
    w = np.broadcast_to(start.T.astype(np.float32), (rows, columns, k, n)).copy()
    values, since, best = [], 0, np.inf
    extrapolated = w
    for step in range(most):
        value, stencil, right = work.gather(_flat(extrapolated), ridge * n)
        if value > best:  # momentum went too far: again from the last good place
            since, extrapolated, best = 0, w, np.inf
            continue
        gain, best = best - value, value
        values.append(value)
        previous, w = w, smooth_weights(stencil, right, extrapolated, smooth)
        _hold(w, keep)
        if iterations is None and step >= least_passes(tiles) - 1 and gain < PAYS * (energy + value):
            break
        since += 1
        # (j - 1) / (j + 1) is three passes in thirty ahead of Nesterov's own (t - 1) / t'.
        extrapolated = w + np.float32((since - 1) / (since + 1)) * (w - previous)
        if progress is not None:
            progress((step + 1) / most)
    if progress is not None:
        progress(1.0)
    return np.ascontiguousarray(w.transpose(0, 1, 3, 2)), values


def passes_within(tiles):
    """Passes for a set: more where its tiles and textures are few."""
    texels = sum(map(len, tiles.covered_chunks())) * tiles.grid.texels
    cost = texels / CELL**2 * tiles.count * (FINE_COST if tiles.grid.cell < CELL else 1)
    return int(min(MOST, least_passes(tiles) + PLENTY / max(cost, 1)))


def least_passes(tiles):
    """Passes that every set of such tiles takes."""
    return FINE_PASSES if tiles.grid.cell < CELL else PASSES


def settle(tiles, weights, rounding, ridge=RIDGE, smooth=SMOOTH, keep=()):
    """Weights (rows, columns, N, K) that suit difference textures rounded as they will be stored (as in gather)."""
    work = Pass(tiles, weights.shape[-1], keep)
    w = np.ascontiguousarray(weights.transpose(0, 1, 3, 2))
    for _ in range(SETTLING):
        _, stencil, right = work.gather(_flat(w), ridge * tiles.count, rounding)
        w = smooth_weights(stencil, right, w, smooth)
        _hold(w, keep)
    return np.ascontiguousarray(w.transpose(0, 1, 3, 2))


def _flat(weights):
    """(cells, N, K) of weights (rows, columns, K, N)."""
    k, n = weights.shape[2:]
    return np.ascontiguousarray(weights.transpose(0, 1, 3, 2)).reshape(-1, n, k)


def _hold(weights, keep):
    for i, n in enumerate(keep):
        weights[:, :, :, n] = 0
        weights[:, :, i, n] = 1
