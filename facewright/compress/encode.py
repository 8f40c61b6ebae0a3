"""facezip(): a neutral texture and N aligned ones become K difference textures and N small weight maps."""

from __future__ import annotations

import hashlib
import time
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from facewright.compress.masks import build_masks, covered_texels
from facewright.compress.packed import Packed, textures_within
from facewright.compress.published import (
    PermutationSearch,
    centroid_matrix,
    cluster_fragments,
    coarse_grams,
    pair_costs,
    published_maps,
)
from facewright.compress.refine import Pass, gram_matrix, pca_weights, refine
from facewright.compress.store import (
    measure_tiles,
    quantise_textures,
    quantise_weights,
    store_solution,
    stored_parts,
)
from facewright.compress.threads import in_threads
from facewright.compress.tiles import TEXELS, TextureTiles, scratch_file
from facewright.errors import InputError

# Above this, tiles lie in a file instead of memory.
SCRATCH_BYTES = 3_000_000_000
MASK_CHOICES = (13, 33, 53, 83)


@dataclass(frozen=True)
class FacezipOptions:
    """Options of facezip().

    method      "refined", or "paper" for the published one
    textures    number of difference textures, 1 to 8 (paper: 2 to 5); with a budget the most that it may choose
    masks       number of masks of the published method
    iterations  passes of the refinement; 15 reach what 25 do within 3 %
    seed        of the samples and searches
    permute     False leaves the published permutation out (for comparison)
    budget      bytes in memory, uncompressed: the number of difference textures that fits (and, of the published
                method, the best of MASK_CHOICES)
    """

    method: str = "refined"
    textures: int = 4
    masks: int = 53
    iterations: int = 15
    seed: int = 0
    permute: bool = True
    budget: int | None = None


def facezip(
    neutral,
    textures,
    *,
    names=None,
    mesh=None,
    covered=None,
    region=None,
    priority=None,
    keep=(),
    options=None,
    progress=None,
):
    """Compress aligned expression textures (FaceZip, Eq. 1-6, and beyond it a joint refinement).

    neutral   (h, w), (h, w, 1), (h, w, 3) or (h, w, 4), uint8 or uint16; sRGB or linear, blended as stored
    textures  N images like it: a list, or a function n -> image with names given (each is asked for once, in order)
    mesh      vertices (n, 3) mm, faces, uv (v up), uv_faces; tells which texels count; the paper's masks need it
    covered   (h, w) bool instead of what the mesh covers
    region    (h, w) bool: where the published method samples its masks
    priority  (h, w) >= 0: how much an error counts there; 1 is usual
    keep      names of textures that are stored exactly; one difference texture each
    progress  function (stage, share done)
    returns   Packed; its report holds RMSE, seconds and the stages' times
    raises    InputError where sizes or depths differ, there are fewer textures than clusters (method paper), or a
              budget is too small
    """
    options = options or FacezipOptions()
    progress = progress or (lambda stage, share: None)
    clock = _Clock()
    neutral = _as_image(neutral, "neutral")
    fetch = textures if callable(textures) else (lambda n: textures[n])
    names = tuple(names) if names is not None else tuple(f"texture{n}" for n in range(len(textures)))
    if not names:
        raise InputError("compress: no textures; give at least one besides the neutral")
    _check(options, names, keep)
    scale = _texel_scale(neutral, mesh, covered, priority)
    with scratch_file(neutral.nbytes * len(names), SCRATCH_BYTES) as path:
        tiles = TextureTiles(neutral, len(names), scale, path)
        layers = _read(tiles, fetch, names, clock, progress)
        k = options.textures
        if options.budget is not None:
            k = textures_within(options.budget, neutral, tiles.count, options.textures)
        if options.method == "paper" and tiles.count < k:
            raise InputError(
                f"compress: {tiles.count} different textures cannot form {k} clusters; "
                "give more textures, a smaller --textures, or --method refined"
            )
        held = tuple(layers[names.index(name)] for name in keep)
        with clock.stage("solving"):
            encoded, errors = _encode(tiles, k, options, mesh, region, held, priority is None, progress)
    report = {"method": options.method, "textures": k, **encoded.pop("report")}
    report["rmse"] = {name: float(errors[layer]) for name, layer in zip(names, layers)}
    report["mean_rmse"] = float(np.mean(list(report["rmse"].values())))
    report["seconds"] = clock.seconds
    report["covered_texels"] = int((scale > 0).sum())
    return Packed(neutral=neutral, names=names, layers=np.array(layers), report=report, **encoded)


class _Clock:
    """Seconds of every stage."""

    def __init__(self):
        self.seconds = {}

    @contextmanager
    def stage(self, name):
        started = time.perf_counter()
        yield
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - started, 4)


def _texel_scale(neutral, mesh, covered, priority):
    """(h, w) float32: 0 where no triangle covers the texel, else the square root of its priority."""
    if covered is None:
        shape = neutral.shape[:2]
        covered = np.ones(shape, bool) if mesh is None else covered_texels(mesh.uv, mesh.uv_faces, *shape)
    if not covered.any():
        raise InputError("compress: no texel is covered by the mesh; check its UVs")
    scale = covered.astype(np.float32)
    if priority is not None:
        scale *= np.sqrt(np.maximum(priority, 1e-4)).astype(np.float32)
    return scale


def _read(tiles, fetch, names, clock, progress):
    """Cut all textures into tiles; equal ones once. Returns the layer of each."""
    seen, layers = {}, []
    for n, name in enumerate(names):
        with clock.stage("reading"):
            image = _as_image(fetch(n), name)
        if image.shape != tiles.shape or image.dtype != tiles.data.dtype:
            (h, w, c), (nh, nw, nc) = image.shape, tiles.shape
            raise InputError(
                f"compress: {name} has {w} x {h} pixels, {c} channels, {image.dtype}, but the neutral {nw} x {nh}, "
                f"{nc} channels, {tiles.data.dtype}; export all textures alike"
            )
        with clock.stage("tiling"):
            key = hashlib.blake2b(np.ascontiguousarray(image)).digest()
            if key not in seen:
                seen[key] = len(seen)
                tiles.put(seen[key], image)
        layers.append(seen[key])
        progress("reading", (n + 1) / len(names))
    tiles.keep(len(seen))
    return layers


def _as_image(image, name):
    image = np.asarray(image)
    image = image[:, :, None] if image.ndim == 2 else image
    if image.ndim != 3 or image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{name}: expected an image of 8 or 16 bits a channel, got {image.dtype} {image.shape}")
    return image


def _check(options, names, keep):
    if options.method not in ("refined", "paper"):
        raise ValueError(f"method {options.method!r}: refined or paper")
    if not 1 <= options.textures <= 8:
        raise InputError(f"compress: {options.textures} difference textures; 1 to 8 are possible")
    if options.method == "paper" and options.textures > 5:
        raise InputError("compress: --method paper searches among permutations of 5 textures at most; use refined")
    missing = [name for name in keep if name not in names]
    if missing:
        raise InputError(f"compress: --keep {missing[0]}: there is no such texture; there are {', '.join(names[:12])}")
    if len(set(keep)) > options.textures:
        raise InputError(f"compress: {len(keep)} textures to keep, but only {options.textures} difference textures")
    if keep and options.method == "paper":
        raise InputError("compress: --keep works with --method refined only")


def _encode(tiles, k, options, mesh, region, held, plain, progress):
    """What is stored, and the RMSE of every texture; plain is False where priorities make PCA no measure."""
    if options.method == "paper":
        return _best_published(tiles, k, options, mesh, region, progress)
    gram = gram_matrix(tiles)
    exact = _exact_basis(tiles, gram, k, held)
    if exact is not None:
        result = store_solution(tiles, exact, k, exact=True, report={"solution": "exact"})
        return result, measure_tiles(tiles, result)
    start = pca_weights(gram, k)
    if held:
        start[list(held)] = 0
        start[:, : len(held)] = 0
        start[list(held), range(len(held))] = 1
    share = partial(progress, "refining")
    weights, _ = refine(tiles, start, iterations=options.iterations, keep=held, progress=share)
    result = store_solution(tiles, weights, k, held=held, report={"solution": "refined"})
    del weights
    errors = measure_tiles(tiles, result)
    if plain and not held and errors.mean() > pca_rmse(tiles, gram, k).mean():
        constant = np.broadcast_to(start, (*tiles.grid.cells, *start.shape))
        other = store_solution(tiles, constant, k, report={"solution": "pca"})
        other_errors = measure_tiles(tiles, other)
        if other_errors.mean() < errors.mean():
            return other, other_errors
    return result, errors


def pca_rmse(tiles, gram, k):
    """(N,) RMSE of every texture when the k leading components are kept in float, from the (N, N) Gram matrix."""
    values, vectors = np.linalg.eigh(gram)
    left = np.diag(gram) - (vectors[:, -k:] ** 2 * values[-k:]).sum(axis=1)
    return np.sqrt(np.maximum(left, 0) / (max((tiles.scale > 0).sum(), 1) * tiles.channels))


def _exact_basis(tiles, gram, k, held):
    """Constant weights where K of the textures span all (or there are no more than K), else None."""
    n = len(gram)
    rest, chosen = gram.copy(), []
    limit = 1e-9 * max(gram.trace(), 1e-30)
    for step in range(min(k, n)):
        pivot = held[step] if step < len(held) else int(np.argmax(np.diag(rest)))
        if rest[pivot, pivot] <= limit and step >= len(held):
            break
        chosen.append(pivot)
        rest = rest - np.outer(rest[:, pivot], rest[pivot]) / max(rest[pivot, pivot], 1e-30)
    texels = max(float((tiles.scale > 0).sum()) * tiles.channels, 1.0)
    if n > k and np.sqrt(max(np.diag(rest).max(), 0) / texels) > 0.6 * tiles.unit:
        return None
    weights = np.zeros((n, k))
    if chosen:
        solved = np.linalg.lstsq(gram[np.ix_(chosen, chosen)], gram[chosen], rcond=1e-12)[0].T
        solved[chosen] = np.eye(len(chosen))
        weights[:, : len(chosen)] = solved
    return np.broadcast_to(weights, (*tiles.grid.cells, n, k))


def _best_published(tiles, k, options, mesh, region, progress):
    if mesh is None:
        raise InputError("compress: --method paper computes its masks on the mesh; give one with UVs")
    counts = (options.masks,) if options.budget is None else MASK_CHOICES
    best = None
    for step, count in enumerate(counts):
        result = _encode_published(tiles, k, replace(options, masks=count), mesh, region)
        errors = measure_tiles(tiles, result)
        if best is None or errors.mean() < best[1].mean():
            best = result, errors
        progress("searching", (step + 1) / len(counts))
    return best


def _encode_published(tiles, k, options, mesh, region):
    masks, about = build_masks(mesh, tiles.grid, options.masks, seed=options.seed, region=region)
    weights, shares, cost = published_solution(tiles, masks, k, options.seed, options.permute)
    n = tiles.count
    work = Pass(tiles, k)
    flat = np.ascontiguousarray(shares).reshape(-1, n, k)
    d = np.empty((len(tiles), k, tiles.channels, TEXELS), np.float32)

    def one(part):
        rows = flat[work.corners[part]].transpose(0, 1, 3, 2).reshape(-1, 4 * k, n)
        y = (rows @ tiles.differences(part)).reshape(-1, 4, k, tiles.channels, TEXELS)
        scale = tiles.scale[part, None]
        d[part] = (y * work.basis[:, None, None]).sum(axis=1) / np.where(scale > 0, scale, 1)

    in_threads(one, tiles.chunks())
    image = tiles.grid.join(d.reshape(len(d), -1, TEXELS)).reshape(tiles.grid.height, tiles.grid.width, k, -1)
    stored = quantise_weights(np.ascontiguousarray(weights.transpose(2, 0, 1, 3)))
    report = {**about, "permutation_cost": cost, "solution": "published"}
    return stored_parts(quantise_textures(tiles, image), stored, report)


def published_search(tiles, masks, k, seed=0):
    """PermutationSearch of a set under masks (rows, columns, m), the labels and the centroids."""
    _, grams = gram_matrix(tiles, blocks=True)
    blocks, values = coarse_grams(tiles, grams, masks)
    per_mask = np.tensordot(values.T**2, blocks, 1)
    labels = cluster_fragments(per_mask, k, seed=seed)
    centroids = centroid_matrix(labels, k)
    return PermutationSearch(pair_costs(blocks, values, centroids)), labels, centroids


def published_solution(tiles, masks, k, seed=0, permute=True):
    """Weight maps, the shares that make the difference textures, and the permutation cost."""
    search, labels, centroids = published_search(tiles, masks, k, seed)
    state = search.solve(seed) if permute else np.zeros(len(labels), int)
    chosen = search.permutations[state]
    weights, shares = published_maps(masks, labels, centroids, chosen)
    return weights, shares, float(search.cost(state[None])[0])
