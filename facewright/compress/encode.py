"""facezip(): a neutral texture and N aligned ones become K difference textures and N small weight maps."""

from __future__ import annotations

import hashlib
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

import numpy as np

from facewright.compress.masks import covered_texels
from facewright.compress.packed import Packed, memory_bytes, textures_within
from facewright.compress.published import best_published
from facewright.compress.solve import FINE_TEXTURES, solve_pca, solve_refined
from facewright.compress.store import root_mean
from facewright.compress.tiles import FINE_CELL, TextureTiles, scratch_file
from facewright.errors import InputError

# Above this, tiles lie in a file instead of memory.
SCRATCH_BYTES = 3_000_000_000
# What a map's error may grow by when it shares weights; its own would cost N/16 bytes a texel.
SHARED_MAY_LOSE = 0.1
# Difference textures as published.
TEXTURES = 4
# Above so many bytes of textures (24 of RGB at 2048) weight maps stay at an eighth: finer ones take longer, and in
# large images a weight texel covers little of the face anyway.
FINE_BYTES = 24 * 3 * 2048**2


@dataclass(frozen=True)
class FacezipOptions:
    """Options of facezip().

    method      "refined", "paper" for the published one, or "pca" (constant weights, for comparison)
    textures    number of difference textures, 1 to 8 (paper: 2 to 5), with weight maps at an eighth; with a budget the
                most that it may choose. None: four, or three with weight maps at a quarter, where that takes no more
                memory and leaves less (24 textures or fewer, of 2048 x 2048 or less)
    masks       number of masks of the published method
    iterations  passes of the refinement; None: 15 (8 with finer weight maps), and more for small sets, as long
                as they pay
    seed        of the samples and searches
    permute     False leaves the published permutation out (for comparison)
    budget      bytes in memory, uncompressed: the number of difference textures that fits (and, of the published
                method, the best of some counts of masks)
    shapes      number of example-based shapes whose weight maps will be stored instead (with_examples), for the budget
    """

    method: str = "refined"
    textures: int | None = None
    masks: int = 53
    iterations: int | None = None
    seed: int = 0
    permute: bool = True
    budget: int | None = None
    shapes: int | None = None

    @property
    def most_textures(self):
        """Difference textures at most."""
        return TEXTURES if self.textures is None else self.textures


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
            k = textures_within(options.budget, images, layers, options.most_textures, len(maps))
            if k != options.most_textures:
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
    fine = _may_be_fine(options, names, keep, list(neutrals.values()))
    with ExitStack() as files:

        def scratch():
            return files.enter_context(scratch_file(stack.nbytes * len(names), SCRATCH_BYTES))

        tiles = TextureTiles(stack, len(names), scale, scratch(), levels)
        layers = _read(tiles, maps, neutrals, names, clock, progress)
        if len(maps) > 1:
            with clock.stage("solving"):
                tiles.balance([image.shape[2] for image in neutrals.values()])
        k = options.most_textures
        if options.budget is not None:
            layers_kept = options.shapes or tiles.count
            k = textures_within(options.budget, list(neutrals.values()), layers_kept, k)
        if options.method == "paper" and tiles.count < k:
            raise InputError(
                f"compress: {tiles.count} different textures cannot form {k} clusters; "
                "give more textures, a smaller --textures, or --method refined"
            )
        held = tuple(dict.fromkeys(layers[names.index(name)] for name in keep))
        plain = priority is None and len(maps) == 1
        with clock.stage("solving"):
            if options.method == "paper":
                encoded, errors = best_published(tiles, k, options, mesh, region, progress)
            elif options.method == "pca":
                encoded, errors = solve_pca(tiles, k)
            else:
                finer = (lambda: tiles.recut(FINE_CELL, scratch())) if fine else None
                encoded, errors = solve_refined(tiles, k, options.iterations, held, plain, finer, progress)
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
            cell=encoded["cell"],
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


def _may_be_fine(options, names, keep, neutrals):
    """Whether three difference textures with finer weight maps are open, and take no more memory than four."""
    free = options.method == "refined" and options.textures is None and not keep and len(names) > TEXTURES
    if not free or sum(image.nbytes for image in neutrals) * len(names) > FINE_BYTES:
        return False
    layers = options.shapes or len(names)
    try:
        fine = memory_bytes(neutrals, FINE_TEXTURES, layers, cell=FINE_CELL)
    except InputError:  # an atlas larger than images may be
        return False
    usual = memory_bytes(neutrals, TEXTURES, layers)
    return fine <= usual and (options.budget is None or fine <= options.budget)


def _check(options, names, keep):
    textures = options.most_textures
    if options.method not in ("refined", "paper", "pca"):
        raise ValueError(f"method {options.method!r}: refined, paper or pca")
    if not 1 <= textures <= 8:
        raise InputError(f"compress: {textures} difference textures; 1 to 8 are possible")
    if options.method == "paper" and textures > 5:
        raise InputError("compress: --method paper searches among permutations of 5 textures at most; use refined")
    missing = [name for name in keep if name not in names]
    if missing:
        raise InputError(f"compress: --keep {missing[0]}: there is no such texture; there are {', '.join(names[:12])}")
    if len(set(keep)) > textures:
        raise InputError(f"compress: {len(keep)} textures to keep, but only {textures} difference textures")
    if keep and options.method != "refined":
        raise InputError("compress: --keep works with --method refined only")
