"""facezip(): a neutral texture and N aligned ones become K difference textures and N small weight maps."""

from __future__ import annotations

import hashlib
import time
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from facewright.compress.masks import covered_texels
from facewright.compress.packed import Packed, textures_within
from facewright.compress.published import best_published
from facewright.compress.refine import PASSES, RIDGE, gram_matrix, pca_weights, refine, settle
from facewright.compress.store import SETTLING_TAIL, measure_tiles, root_mean, store_solution, texture_rounding
from facewright.compress.tiles import TextureTiles, scratch_file
from facewright.errors import InputError

# Above this, tiles lie in a file instead of memory.
SCRATCH_BYTES = 3_000_000_000
# What a map's error may grow by when it shares weights; its own would cost N/16 bytes a texel.
SHARED_MAY_LOSE = 0.1
# Of exact solutions and constant weights, which need no damping.
LEAST_RIDGE = 1e-6
# Where the refined error is below this share of that of PCA(K), every texture shall gain.
CLEAR_GAIN = 0.8
# A texture that does not is counted more, a few times, by this power of its error over a share of that in PCA(K). On
# five sets two turns did it (power 1: three to four; 1.5 costs more of the mean; going on from the last weights with
# few passes: five turns and not on all).
AIM, POWER, TURNS = 0.98, 1.25, 4


@dataclass(frozen=True)
class FacezipOptions:
    """Options of facezip().

    method      "refined", "paper" for the published one, or "pca" (constant weights, for comparison)
    textures    number of difference textures, 1 to 8 (paper: 2 to 5); with a budget the most that it may choose
    masks       number of masks of the published method
    iterations  passes of the refinement; None: 15, and more for small sets, as long as they pay
    seed        of the samples and searches
    permute     False leaves the published permutation out (for comparison)
    budget      bytes in memory, uncompressed: the number of difference textures that fits (and, of the published
                method, the best of some counts of masks)
    shapes      number of example-based shapes whose weight maps will be stored instead (with_examples), for the budget
    """

    method: str = "refined"
    textures: int = 4
    masks: int = 53
    iterations: int | None = None
    seed: int = 0
    permute: bool = True
    budget: int | None = None
    shapes: int | None = None


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
    fetch = textures if callable(textures) else (lambda n: textures[n])
    names = tuple(names) if names is not None else tuple(f"texture{n}" for n in range(len(textures)))
    if not callable(textures) and len(names) != len(textures):
        raise ValueError(f"{len(names)} names for {len(textures)} textures")
    rest = {"mesh": mesh, "covered": covered, "region": region, "priority": priority, "keep": keep}
    return _compress({"color": (neutral, fetch)}, names, options, progress, **rest)["color"]


def facezip_maps(maps, names, *, share=None, options=None, progress=None, **rest):
    """Compress several maps of the same expressions (albedo, specular, displacement ...), with one set of weights
    where that pays.

    maps    dict name -> (neutral, function n -> image) as facezip() takes them, all of one size; depths may differ
    names   of the N expressions
    share   True or False; None shares where no map's error grows by more than SHARED_MAY_LOSE
    rest    mesh, covered, region, priority, keep as in facezip()
    returns dict name -> Packed; maps that share have the same weights array
    """
    options = options or FacezipOptions()
    if len(maps) == 1 or share is False:
        if options.budget is not None and len(maps) > 1:
            images = [_as_image(neutral, name) for name, (neutral, _) in maps.items()]
            layers = options.shapes or len(names)
            k = textures_within(options.budget, images, layers, options.textures, len(maps))
            options = replace(options, textures=k)
        return {
            name: _compress({name: each}, tuple(names), options, progress, **rest)[name] for name, each in maps.items()
        }
    together = _compress(maps, tuple(names), options, progress, **rest)
    if share:
        return together
    alone = facezip_maps(maps, names, share=False, options=options, progress=progress, **rest)
    errors = {name: (together[name].report["mean_rmse"], alone[name].report["mean_rmse"]) for name in maps}
    pays = all(shared <= own * (1 + SHARED_MAY_LOSE) for shared, own in errors.values())
    for packed in (together, alone):
        for name in maps:
            packed[name].report["mean_rmse_shared"], packed[name].report["mean_rmse_alone"] = errors[name]
    return together if pays else alone


def _compress(maps, names, options, progress, *, mesh=None, covered=None, region=None, priority=None, keep=()):
    """dict name -> Packed of maps that share their weights."""
    options = options or FacezipOptions()
    progress = progress or (lambda stage, share: None)
    clock = _Clock()
    if not names:
        raise InputError("compress: no textures; give at least one besides the neutral")
    if len(set(names)) < len(names):
        raise ValueError("two textures have the same name")
    _check(options, names, keep)
    neutrals = {name: _as_image(neutral, f"neutral of {name}") for name, (neutral, _) in maps.items()}
    scale = _texel_scale(next(iter(neutrals.values())), mesh, covered, priority)
    stack = _stacked(list(neutrals.values()))
    levels = [np.iinfo(image.dtype).max for image in neutrals.values() for _ in range(image.shape[2])]
    with scratch_file(stack.nbytes * len(names), SCRATCH_BYTES) as scratch:
        tiles = TextureTiles(stack, len(names), scale, scratch, levels)
        layers = _read(tiles, maps, neutrals, names, clock, progress)
        if len(maps) > 1:
            with clock.stage("solving"):
                tiles.balance([image.shape[2] for image in neutrals.values()])
        k = options.textures
        if options.budget is not None:
            layers_kept = options.shapes or tiles.count
            k = textures_within(options.budget, list(neutrals.values()), layers_kept, options.textures)
        if options.method == "paper" and tiles.count < k:
            raise InputError(
                f"compress: {tiles.count} different textures cannot form {k} clusters; "
                "give more textures, a smaller --textures, or --method refined"
            )
        held = tuple(dict.fromkeys(layers[names.index(name)] for name in keep))
        plain = priority is None and len(maps) == 1
        with clock.stage("solving"):
            encoded, errors = _encode(tiles, k, options, mesh, region, held, plain, progress)
    report = {
        "method": options.method,
        "textures": len(encoded["textures"]),
        **encoded.pop("report"),
        "seconds": clock.seconds,
    }
    report["covered_texels"] = int((scale > 0).sum())
    return _split(encoded, errors, neutrals, names, np.array(layers), report)


def _stacked(images):
    """Images (h, w, C) side by side in their channels; 8 bits become 16 where depths differ."""
    if len(images) == 1:
        return images[0]
    if any(image.shape[:2] != images[0].shape[:2] for image in images):
        raise InputError("compress: the maps have different sizes; export all at one size")
    if any(image.dtype == np.uint16 for image in images):
        images = [image if image.dtype == np.uint16 else image.astype(np.uint16) * 257 for image in images]
    return np.concatenate(images, axis=2)


def _split(encoded, errors, neutrals, names, layers, report):
    """dict name -> Packed of the channels of each map."""
    result, first = {}, 0
    for name, neutral in neutrals.items():
        mine = slice(first, first + neutral.shape[2])
        rmse = root_mean(errors[:, mine])
        about = {**report, "rmse": {each: float(rmse[layer]) for each, layer in zip(names, layers)}}
        about["mean_rmse"] = float(np.mean(list(about["rmse"].values())))
        result[name] = Packed(
            neutral=neutral,
            textures=encoded["textures"][..., mine].astype(neutral.dtype, copy=False),
            texture_step=encoded["texture_step"][:, mine],
            texture_zero=encoded["texture_zero"][:, mine],
            weights=encoded["weights"],
            weight_step=encoded["weight_step"],
            weight_zero=encoded["weight_zero"],
            names=names,
            layers=layers,
            report=about,
        )
        first = mine.stop
    return result


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


def _read(tiles, maps, neutrals, names, clock, progress):
    """Cut all textures into tiles; equal ones once. Returns the layer of each."""
    seen, layers = {}, []
    for n, name in enumerate(names):
        with clock.stage("reading"):
            images = [_as_image(fetch(n), name) for _, fetch in maps.values()]
        for image, neutral in zip(images, neutrals.values()):
            if image.shape != neutral.shape or image.dtype != neutral.dtype:
                (h, w, c), (nh, nw, nc) = image.shape, neutral.shape
                raise InputError(
                    f"compress: {name} has {w} x {h} pixels, {c} channels, {image.dtype}, but the neutral {nw} x {nh}, "
                    f"{nc} channels, {neutral.dtype}; export all textures alike"
                )
        with clock.stage("tiling"):
            image = _stacked(images)
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
    if options.method not in ("refined", "paper", "pca"):
        raise ValueError(f"method {options.method!r}: refined, paper or pca")
    if not 1 <= options.textures <= 8:
        raise InputError(f"compress: {options.textures} difference textures; 1 to 8 are possible")
    if options.method == "paper" and options.textures > 5:
        raise InputError("compress: --method paper searches among permutations of 5 textures at most; use refined")
    missing = [name for name in keep if name not in names]
    if missing:
        raise InputError(f"compress: --keep {missing[0]}: there is no such texture; there are {', '.join(names[:12])}")
    if len(set(keep)) > options.textures:
        raise InputError(f"compress: {len(keep)} textures to keep, but only {options.textures} difference textures")
    if keep and options.method != "refined":
        raise InputError("compress: --keep works with --method refined only")


def _encode(tiles, k, options, mesh, region, held, plain, progress):
    """What is stored, and the RMSE of every texture and channel; PCA is no measure unless plain."""
    if options.method == "paper":
        return best_published(tiles, k, options, mesh, region, progress)
    gram = gram_matrix(tiles)
    if options.method == "pca":
        result = _store_pca(tiles, gram, k)
        return result, measure_tiles(tiles, result)
    exact = _exact_basis(tiles, gram, k, held)
    if exact is not None:
        result = store_solution(tiles, exact, LEAST_RIDGE, exact=True, report={"solution": "exact"})
        return result, measure_tiles(tiles, result)
    start = pca_weights(gram, k)
    if held:
        start[list(held)] = 0
        start[:, : len(held)] = 0
        start[list(held), range(len(held))] = 1
    ridge = ridge_for(gram, k)
    share = partial(progress, "refining")
    result, errors = _refined(tiles, start, ridge, options.iterations, share, float(gram.trace()), held)
    if plain and not held:
        return _no_worse_than_pca(tiles, gram, ridge, options, progress, result, errors)
    return result, errors


def _refined(tiles, start, ridge, passes, share, energy=0.0, held=()):
    """The refined solution as stored, and its errors; textures count as tiles.emphasis says."""
    emphasis = np.float32(1) if tiles.emphasis is None else tiles.emphasis
    weights, values = refine(
        tiles, start * emphasis, energy=energy, iterations=passes, ridge=ridge, keep=held, progress=share
    )
    if values:
        whole = range(len(held))
        rounding = texture_rounding(tiles, weights, ridge, held, whole, SETTLING_TAIL)
        weights = settle(tiles, weights, rounding.of_part, ridge=ridge, keep=held)
    weights /= emphasis
    # Few textures leave little noise to damp: a smaller ridge in the end then costs no range.
    last = min(ridge, 1e-4) if tiles.count <= 4 else ridge
    result = store_solution(tiles, weights, last, held=held, report={"solution": "refined", "passes": len(values)})
    return result, measure_tiles(tiles, result)


def _no_worse_than_pca(tiles, gram, ridge, options, progress, result, errors):
    """The refined solution, or one that makes no texture worse than PCA(K) does, or PCA(K) itself where it is better.

    A few strong textures govern constant weights, which then hold them almost exactly; the least sum of squares gives
    some of that up. Where refining gains much on the whole, these textures are made to count more until they gain too.
    """
    k = len(result["textures"])
    rmse, wanted = root_mean(errors), pca_rmse(tiles, gram, k)
    clear = rmse.mean() <= CLEAR_GAIN * wanted.mean()
    if (rmse <= wanted).all() if clear else rmse.mean() <= wanted.mean():
        return result, errors
    constant = _store_pca(tiles, gram, k)
    constant_errors = measure_tiles(tiles, constant)
    if not clear:
        better = root_mean(constant_errors).mean() < rmse.mean()
        return (constant, constant_errors) if better else (result, errors)
    # Half a code is rounding.
    wanted = np.maximum(root_mean(constant_errors), 0.5 * tiles.unit)
    ratio, emphasis, start = rmse / wanted, np.ones(tiles.count), pca_weights(gram, k)
    worst = ratio.max()
    passes = PASSES if options.iterations is None else options.iterations
    for turn in range(TURNS):
        if worst < 1:
            break
        emphasis = emphasis * np.maximum(ratio / AIM, 1) ** POWER
        tiles.emphasis = (emphasis / np.sqrt((emphasis**2).mean())).astype(np.float32)[:, None]
        # What is held almost exactly shows the damping: where two turns are not enough there is less of it.
        damping = ridge if turn < 2 else 0.5 * ridge
        share = partial(progress, f"evening out {turn + 1}")
        trial, trial_errors = _refined(tiles, start, damping, passes, share)
        tiles.emphasis = None
        ratio = root_mean(trial_errors) / wanted
        if ratio.max() < worst and root_mean(trial_errors).mean() <= CLEAR_GAIN * root_mean(constant_errors).mean():
            result, errors, worst = trial, trial_errors, ratio.max()
    return result, errors


def ridge_for(gram, k):
    """Ridge of the difference textures per texture: RIDGE, less where K components leave next to nothing of the energy
    (the damping would be most of the error) and for few textures, which leave little noise to damp."""
    values = np.maximum(np.linalg.eigvalsh(gram), 0)
    left = values[:-k].sum() / max(values.sum(), 1e-30)
    return float(np.clip(RIDGE * left / 0.05, LEAST_RIDGE, RIDGE))


def _store_pca(tiles, gram, k):
    start = pca_weights(gram, k)
    constant = np.broadcast_to(start, (*tiles.grid.cells, *start.shape))
    return store_solution(tiles, constant, LEAST_RIDGE, report={"solution": "pca"})


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
    weights = np.zeros((n, max(len(chosen), 1)))  # no more difference textures than it takes
    if chosen:
        weights[:] = np.linalg.lstsq(gram[np.ix_(chosen, chosen)], gram[chosen], rcond=1e-12)[0].T
        weights[chosen] = np.eye(len(chosen))
    return np.broadcast_to(weights, (*tiles.grid.cells, *weights.shape))
