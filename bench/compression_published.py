"""The published procedure of FaceZip as its paper tells it, on pixels; bench/compression.py compares times with it."""

from __future__ import annotations

import time
from itertools import permutations

import numpy as np
from common import print_table

from facewright.compress import FacezipOptions, facezip
from facewright.compress.masks import build_masks
from facewright.compress.published import best_published
from facewright.compress.tiles import TextureTiles

SUPPORT = 0.05


def published_procedure(textures, restarts, verdict):
    """The paper's own way: k-means on the pixels of fragments, permutations tried on pixels, random restarts.

    Quicker than the paper tells it: fragments are cut to where their mask is above SUPPORT, which leaves each a few
    neighbours, and the pairs of a permutation are summed once for all 24.
    """
    k = 4
    tiles = TextureTiles.of(textures.neutral, textures.textures, textures.covered)
    masks, _ = build_masks(textures.mesh, tiles.grid, 53)
    full = tiles.grid.upsample(masks)
    x = np.stack([(t.astype(np.float32) - textures.neutral) * textures.covered[:, :, None] for t in textures.textures])
    started = time.perf_counter(), time.process_time()
    places, centroids = [], []
    for m in range(full.shape[2]):
        rows, columns = (np.flatnonzero((full[:, :, m] > SUPPORT).any(axis=axis)) for axis in (1, 0))
        box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        fragments = (x[:, box[0], box[1]] * full[box[0], box[1], m, None]).reshape(len(x), -1)
        labels = pixel_kmeans(fragments, k, restarts=10, seed=m)
        means = [fragments[labels == i].mean(axis=0) if (labels == i).any() else 0 * fragments[0] for i in range(k)]
        centroids.append([mean.reshape(len(rows_of(box[0])), -1, 3) for mean in means])
        places.append(box)
    clustered = time.perf_counter() - started[0], time.process_time() - started[1]
    started = time.perf_counter(), time.process_time()
    for seed in range(restarts):
        pixel_permutations(places, centroids, full, seed, sweeps=10)
    searched = time.perf_counter() - started[0], time.process_time() - started[1]
    start, busy = time.perf_counter(), time.process_time()
    best_published(tiles, k, FacezipOptions("paper"), textures.mesh, None, lambda stage, share: None)
    fast = time.perf_counter() - start, time.process_time() - busy
    start, busy = time.perf_counter(), time.process_time()
    facezip(textures.neutral, textures.textures, mesh=textures.mesh)
    refined = time.perf_counter() - start, time.process_time() - busy
    whole = [c + s / restarts * 100 for c, s in zip(clustered, searched)]
    rows = [
        ["k-means on pixels", *clustered],
        [f"permutation on pixels, {restarts} restarts", *searched],
        ["both, 100 restarts (extrapolated)", *whole],
        ["the same steps on Gram matrices, masks and images too", *fast],
        ["refined, all of it", *refined],
    ]
    print_table("The published procedure", ["step", "wall s", "cpu s"], rows)
    print(
        f"refined is {whole[1] / refined[1]:.0f} times faster (cpu), the published steps {whole[1] / fast[1]:.0f} times"
    )
    verdict.check("published procedure", "refined / published procedure, cpu", refined[1] / whole[1], 0.01)


def rows_of(part):
    return range(part.start, part.stop)


def pixel_kmeans(points, k, restarts, seed, iterations=300):
    """Lloyd's k-means on (n, pixels), k-means++ starts, the best of some: what a library does with fragments."""
    rng = np.random.default_rng(seed)
    best, least = None, np.inf
    lengths = (points**2).sum(axis=1)[:, None]
    for _ in range(restarts):
        centres = points[rng.choice(len(points), 1)]
        while len(centres) < k:
            near = np.maximum(_distances(points, lengths, centres).min(axis=1), 0) + 1e-3
            centres = np.concatenate([centres, points[rng.choice(len(points), 1, p=near / near.sum())]])
        labels = None
        for _ in range(iterations):
            distance = _distances(points, lengths, centres)
            following = distance.argmin(axis=1)
            if labels is not None and (following == labels).all():
                break
            labels = following
            for i in range(k):
                if (labels == i).any():
                    centres[i] = points[labels == i].mean(axis=0)
        if best is None or (len(set(labels)) == k and distance.min(axis=1).sum() < least):
            best, least = labels, distance.min(axis=1).sum()
    return best


def _distances(points, lengths, centres):
    return lengths - 2 * points @ centres.T + (centres**2).sum(axis=1)


def pixel_permutations(places, centroids, masks, seed, sweeps):
    """Eq. 3-4 on pixels: sweeps over masks, every permutation of each tried against the others, from a random one."""
    rng = np.random.default_rng(seed)
    choices = list(permutations(range(4)))
    state = [choices[i] for i in rng.integers(24, size=len(places))]
    for _ in range(sweeps):
        for m, box in enumerate(places):
            costs = np.zeros(24)
            for other, beside in enumerate(places):
                rows = max(box[0].start, beside[0].start), min(box[0].stop, beside[0].stop)
                columns = max(box[1].start, beside[1].start), min(box[1].stop, beside[1].stop)
                if other == m or rows[0] >= rows[1] or columns[0] >= columns[1]:
                    continue
                both = slice(*rows), slice(*columns)
                mine, theirs = (_crop(centroids[i], places[i], both) for i in (m, other))
                # fragments carry their own mask: each times the other's is the difference under both
                mine = mine * masks[both][:, :, other, None]
                theirs = theirs * masks[both][:, :, m, None]
                table = np.array([[((a - b) ** 2).sum() for b in theirs] for a in mine])
                costs += [sum(table[p[i], state[other][i]] for i in range(4)) for p in choices]
            state[m] = choices[int(costs.argmin())]
    return state


def _crop(images, place, part):
    rows = slice(part[0].start - place[0].start, part[0].stop - place[0].start)
    columns = slice(part[1].start - place[1].start, part[1].stop - place[1].start)
    return np.stack([image[rows, columns] for image in images])
