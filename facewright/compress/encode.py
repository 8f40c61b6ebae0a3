"""facezip(): a neutral texture and N aligned ones become K difference textures and N small weight maps."""

from __future__ import annotations

import hashlib
import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facewright.compress.masks import build_masks, covered_texels
from facewright.compress.packed import Packed, quantise
from facewright.compress.published import (
    PermutationSearch,
    centroid_matrix,
    cluster_fragments,
    coarse_grams,
    pair_costs,
    published_maps,
)
from facewright.compress.refine import Pass, gram_matrix, pca_weights, refine
from facewright.compress.tiles import TEXELS, Grid, TextureTiles
from facewright.errors import InputError

# Above this, tiles lie in a file instead of memory.
SCRATCH_BYTES = 3_000_000_000


@dataclass(frozen=True)
class FacezipOptions:
    """Options of facezip().

    method      "refined", or "paper" for the published one
    textures    number of difference textures, 1 to 8 (paper: 2 to 5)
    masks       number of masks of the published method
    iterations  passes of the refinement; 15 reach what 25 do within 3 %
    seed        of the samples and searches
    permute     False leaves the published permutation out (for comparison)
    """

    method: str = "refined"
    textures: int = 4
    masks: int = 53
    iterations: int = 15
    seed: int = 0
    permute: bool = True


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
    textures  N images like it: a list, or a function n -> image with names given (each is asked for twice)
    mesh      vertices (n, 3) mm, faces, uv (v up), uv_faces; tells which texels count; the paper's masks need it
    covered   (h, w) bool instead of what the mesh covers
    region    (h, w) bool: where the published method samples its masks
    priority  (h, w) >= 0: how much an error counts there; 1 is usual
    keep      names of textures that are stored exactly; one difference texture each
    returns   Packed
    raises    InputError where sizes or depths differ, or there are fewer textures than clusters (method paper)
    """
    options = options or FacezipOptions()
    started = time.perf_counter()
    neutral = _as_image(neutral, "neutral")
    fetch = textures if callable(textures) else (lambda n: textures[n])
    names = tuple(names) if names is not None else tuple(f"texture{n}" for n in range(len(textures)))
    if not names:
        raise InputError("compress: no textures; give at least one besides the neutral")
    layers, unique = _find_equal(neutral, fetch, names)
    k = options.textures
    _check(options, names, unique, keep)
    grid = Grid(*neutral.shape[:2])
    if covered is None:
        covered = (
            np.ones(neutral.shape[:2], bool)
            if mesh is None
            else covered_texels(mesh.uv, mesh.uv_faces, grid.height, grid.width)
        )
    if not covered.any():
        raise InputError("compress: no texel is covered by the mesh; check its UVs")
    scale = covered.astype(np.float32)
    if priority is not None:
        scale *= np.sqrt(np.maximum(priority, 1e-4)).astype(np.float32)
    with _scratch(neutral.nbytes * len(unique)) as path:
        tiles = TextureTiles(neutral, (_as_image(fetch(n), names[n]) for n in unique), len(unique), scale, path)
        held = tuple(unique.index(_first(layers, unique, names.index(name))) for name in keep)
        encoded = _encode(tiles, k, options, mesh, region, held, progress)
        report = {"method": options.method, "textures": k, **encoded.pop("report")}
        errors = measure_tiles(tiles, covered, encoded)
    report["rmse"] = {name: float(errors[layer]) for name, layer in zip(names, layers)}
    report["mean_rmse"] = float(np.mean(list(report["rmse"].values())))
    report["seconds"] = round(time.perf_counter() - started, 3)
    report["covered_texels"] = int(covered.sum())
    return Packed(neutral=neutral, names=names, layers=np.array(layers), report=report, **encoded)


def _as_image(image, name):
    image = np.asarray(image)
    image = image[:, :, None] if image.ndim == 2 else image
    if image.ndim != 3 or image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{name}: expected an image of 8 or 16 bits a channel, got {image.dtype} {image.shape}")
    return image


def _find_equal(neutral, fetch, names):
    """For every texture the layer of its weight map, and the first texture of every layer."""
    seen, layers, unique = {}, [], []
    for n, name in enumerate(names):
        image = _as_image(fetch(n), name)
        if image.shape != neutral.shape or image.dtype != neutral.dtype:
            (h, w, c), (nh, nw, nc) = image.shape, neutral.shape
            raise InputError(
                f"compress: {name} has {w} x {h} pixels, {c} channels, {image.dtype}, but the neutral {nw} x {nh}, "
                f"{nc} channels, {neutral.dtype}; export all textures alike"
            )
        key = hashlib.blake2b(np.ascontiguousarray(image)).digest()
        if key not in seen:
            seen[key] = len(unique)
            unique.append(n)
        layers.append(seen[key])
    return layers, unique


def _first(layers, unique, n):
    return unique[layers[n]]


def _check(options, names, unique, keep):
    if options.method not in ("refined", "paper"):
        raise ValueError(f"method {options.method!r}: refined or paper")
    if not 1 <= options.textures <= 8:
        raise InputError(f"compress: {options.textures} difference textures; 1 to 8 are possible")
    if options.method == "paper" and options.textures > 5:
        raise InputError("compress: --method paper searches among permutations of 5 textures at most; use refined")
    if options.method == "paper" and len(unique) < options.textures:
        raise InputError(
            f"compress: {len(unique)} different textures cannot form {options.textures} clusters; "
            "give more textures, a smaller --textures, or --method refined"
        )
    missing = [name for name in keep if name not in names]
    if missing:
        raise InputError(f"compress: --keep {missing[0]}: there is no such texture; there are {', '.join(names[:12])}")
    if len(set(keep)) > options.textures:
        raise InputError(f"compress: {len(keep)} textures to keep, but only {options.textures} difference textures")
    if keep and options.method == "paper":
        raise InputError("compress: --keep works with --method refined only")


class _scratch:
    """A scratch file for tiles of so many bytes, or None where they fit memory."""

    def __init__(self, size):
        self.folder = tempfile.TemporaryDirectory(prefix="facezip-") if size > SCRATCH_BYTES else None

    def __enter__(self):
        return None if self.folder is None else os.fspath(Path(self.folder.name) / "tiles")

    def __exit__(self, *_):
        if self.folder is not None:
            self.folder.cleanup()


def _encode(tiles, k, options, mesh, region, held, progress):
    if options.method == "paper":
        return _encode_published(tiles, k, options, mesh, region)
    gram = gram_matrix(tiles)
    exact = _exact_basis(tiles, gram, k, held)
    if exact is not None:
        return _store(tiles, exact, k, exact=True, report={"solution": "exact"})
    start = pca_weights(gram, k)
    if held:
        start[list(held)] = 0
        start[:, : len(held)] = 0
        start[list(held), range(len(held))] = 1
    weights, _ = refine(tiles, start, iterations=options.iterations, keep=held, progress=progress)
    result = _store(tiles, weights, k, held=held, report={"solution": "refined"})
    float_pca = gram.trace() - np.sort(np.linalg.eigvalsh(gram))[::-1][:k].sum()
    if not held and _squared(tiles, result) > float_pca:
        constant = np.broadcast_to(start, (*tiles.grid.cells, *start.shape))
        other = _store(tiles, constant, k, report={"solution": "pca"})
        if _squared(tiles, other) < _squared(tiles, result):
            return other
    return result


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


def _store(tiles, weights, k, *, held=(), exact=False, report):
    """Quantised weights, the difference textures that suit them best, and these quantised."""
    weights = np.ascontiguousarray(weights.transpose(2, 0, 1, 3))  # (N, rows, columns, K)
    codes, step, zero = _quantise_weights(weights)
    stored = ((codes.astype(np.float32) - zero[:, None, None]) * step[:, None, None]).astype(np.float32)
    # Few textures leave little noise to damp: a smaller ridge then costs no range.
    ridge = (1e-6 if exact else 1e-4 if tiles.count <= 4 else 0.01) * tiles.count
    d = Pass(tiles, k, held).textures(stored.transpose(1, 2, 0, 3), ridge)
    parts = _quantise_textures(tiles, d, held=range(k) if exact else range(len(held)))
    return _parts(parts, (codes, step, zero), report)


def _parts(textures, weights, report):
    keys = ("textures", "texture_step", "texture_zero", "weights", "weight_step", "weight_zero")
    return {**dict(zip(keys, (*textures, *weights))), "report": report}


def _quantise_weights(weights):
    low, high = weights.min(axis=(1, 2)), weights.max(axis=(1, 2))
    low, high = np.minimum(low, 0.0).astype(np.float64), np.maximum(high, 0.0).astype(np.float64)
    codes, step, zero = quantise(weights, low[:, None, None], high[:, None, None], 255)
    return codes, step[:, 0, 0], zero[:, 0, 0]


def _quantise_textures(tiles, d, held=()):
    """Codes (K, h, w, C) of D (h, w, K, C); all but held textures at their 99.99 percentile range."""
    height, width, k, channels = d.shape
    levels = np.iinfo(tiles.data.dtype).max
    sample = d[:: max(1, height // 1024), :: max(1, width // 1024)].reshape(-1, k, channels)
    sample = sample[(sample != 0).any(axis=(1, 2))]
    sample = sample if len(sample) else np.zeros((1, k, channels), np.float32)
    low, high = np.quantile(sample, 0.0001, axis=0), np.quantile(sample, 0.9999, axis=0)
    for i in held:
        low[i], high[i] = d[:, :, i].min(axis=(0, 1)), d[:, :, i].max(axis=(0, 1))
    out = np.empty((k, height, width, channels), tiles.data.dtype)
    steps, zeros = np.empty((k, channels)), np.empty((k, channels))
    for i in range(k):
        out[i], steps[i], zeros[i] = quantise(d[:, :, i], low[i], high[i], levels)
    return out, steps, zeros


def _encode_published(tiles, k, options, mesh, region):
    if mesh is None:
        raise InputError("compress: --method paper computes its masks on the mesh; give one with UVs")
    masks, about = build_masks(mesh, tiles.grid, options.masks, seed=options.seed, region=region)
    weights, shares, cost = published_solution(tiles, masks, k, options.seed, options.permute)
    n = tiles.count
    work = Pass(tiles, k)
    flat = np.ascontiguousarray(shares).reshape(-1, n, k)
    d = np.empty((len(tiles), k, tiles.channels, TEXELS), np.float32)
    for part in tiles.chunks():
        rows = flat[work.corners[part]].transpose(0, 1, 3, 2).reshape(-1, 4 * k, n)
        y = (rows @ tiles.differences(part)).reshape(-1, 4, k, tiles.channels, TEXELS)
        scale = tiles.scale[part, None]
        d[part] = (y * work.basis[:, None, None]).sum(axis=1) / np.where(scale > 0, scale, 1)
    image = tiles.grid.join(d.reshape(len(d), -1, TEXELS)).reshape(tiles.grid.height, tiles.grid.width, k, -1)
    stored = _quantise_weights(np.ascontiguousarray(weights.transpose(2, 0, 1, 3)))
    report = {**about, "permutation_cost": cost, "solution": "published"}
    return _parts(_quantise_textures(tiles, image), stored, report)


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


def _predicted(tiles, encoded, part, textures, weights, work):
    """(t, N, C, 64) 0-255 reconstruction of tiles from stored values, clipped."""
    k = weights.shape[-1]
    corner = weights[work.corners[part]].transpose(0, 2, 1, 3)  # (t, N, 4, K)
    e = (textures[part][:, None] * work.basis[:, None, None]).reshape(len(corner), 4 * k, -1)
    x = (corner.reshape(len(corner), -1, 4 * k) @ e).reshape(len(corner), -1, tiles.channels, TEXELS)
    x += tiles.neutral[part, None] * np.float32(tiles.unit)
    return np.clip(x, 0, 255, out=x)


def _stored_tiles(tiles, encoded):
    step, zero = encoded["texture_step"], encoded["texture_zero"]
    d = [
        tiles.grid.cut((image.astype(np.float32) - z.astype(np.float32)) * s.astype(np.float32))
        for image, s, z in zip(encoded["textures"], step, zero)
    ]
    w = (encoded["weights"].astype(np.float32) - encoded["weight_zero"][:, None, None]) * encoded["weight_step"][
        :, None, None
    ]
    n, k = w.shape[0], w.shape[-1]
    flat = np.ascontiguousarray(w.transpose(1, 2, 0, 3).astype(np.float32)).reshape(-1, n, k)
    return np.stack(d, axis=1), flat


def measure_tiles(tiles, covered, encoded):
    """(N,) RMSE of every texture on covered texels, 0-255, after storage, upsampling and clipping."""
    textures, weights = _stored_tiles(tiles, encoded)
    work = Pass(tiles, weights.shape[-1])
    cover = tiles.grid.cut(covered[:, :, None].astype(np.float32))
    total = np.zeros(tiles.count)
    for part in tiles.chunks():
        x = _predicted(tiles, encoded, part, textures, weights, work)
        x -= tiles.data[part].astype(np.float32) * np.float32(tiles.unit)
        x *= cover[part, None]
        total += np.einsum("tncp,tncp->n", x, x, dtype=np.float64)
    return np.sqrt(total / (covered.sum() * tiles.channels))


def _squared(tiles, encoded):
    covered = tiles.grid.join(tiles.scale)[:, :, 0] > 0
    return float((measure_tiles(tiles, covered, encoded) ** 2).sum() * covered.sum() * tiles.channels)
