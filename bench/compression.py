"""FaceZip against its bars: quality on every set, search, seams, limits, BC7, time and memory, and the paper's own way.

    python bench/compression.py [PART ...] [--set FOLDER ...] [--sizes 512 1024] [--restarts 2]

PART  quality search seams priority examples time published large (default: all but large). Sets are the folders of
      ../shared/data/textures (neutral.png, mesh.obj, textures/) and generated ones. Time is of 20 generated textures,
      from decoded images to PNG and JSON; cpu is what all cores spent, quiet what two cores would need that do
      nothing else: the main thread's seconds and half of the others'.
large adds 2048 and 4096 with their memory, and 100 textures at 4096; each runs in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import ROOT, Verdict, print_table
from compression_bound import triple_bound
from compression_published import published_procedure
from compression_seams import seams

from facewright.compress import FacezipOptions, example_weights, facezip
from facewright.compress.evaluation import (
    METHODS,
    TextureSet,
    block_bound,
    decode_one,
    measure,
    rms_error,
    run_method,
    search_curves,
)
from facewright.compress.files import list_textures, read_texture, read_uv_mesh
from facewright.compress.folder import write_packed
from facewright.compress.ktx2 import block_compressed, encoder_missing
from facewright.compress.packed import with_examples
from facewright.compress.synthetic import ExpressionSource, expression_set

TEXTURES = ROOT.parent / "shared" / "data" / "textures"
FACES = "unrelated-faces-512"
PARTS = ("quality", "search", "seams", "priority", "examples", "time", "published")
# strength and noise of the generated sets; the last has as much noise as signal
GENERATED = ((14, 0), (14, 2), (8, 1), (30, 2), (14, 5))
SEARCH_BAR, BOUND_PASSES = 0.75, 200
SECONDS = {512: 3, 1024: 8, 2048: 30, 4096: 150}
PAPER_SECONDS = {512: 1102, 1024: 3794, 2048: 16216}


def read_set(folder):
    """TextureSet of a folder with neutral.png, mesh.obj and textures/."""
    paths = list_textures(folder / "textures", folder / "neutral.png")
    neutral, mesh = read_texture(folder / "neutral.png"), read_uv_mesh(folder / "mesh.obj")
    return TextureSet.of(neutral, [read_texture(path) for path in paths], [path.stem for path in paths], mesh)


def generated_sets():
    """(name, TextureSet, rms of the true differences / noise) of generated sets."""
    for strength, noise in GENERATED:
        made = expression_set(512, 20, strength=strength, noise=noise)
        textures = TextureSet(made.neutral, made.textures, made.names, made.mesh, made.covered, made.truth)
        yield f"generated {strength}/{noise}", textures, made.signal_rms / noise if noise else np.inf


def face_sets(name, textures, seed=0):
    """(name, TextureSet, inf): sets of 16 or more of the faces of a set, taken by chance; in two of them another face
    is the neutral one. All of them smaller too."""
    rng = np.random.default_rng(seed)
    faces = [textures.neutral, *textures.textures]
    for count, neutral in ((16, 0), (16, 0), (17, 0), (18, 0), (19, 0), (16, 7), (20, 13)):
        others = [n for n in range(len(faces)) if n != neutral]
        chosen = sorted(rng.choice(others, count, replace=False))
        some = replace(
            textures,
            neutral=faces[neutral],
            textures=[faces[n] for n in chosen],
            names=tuple(f"face{n}" for n in chosen),
        )
        yield f"{name}: {count} of them" + (f" against {neutral}" if neutral else ""), some, np.inf
    small = [halved(face) for face in faces]
    smaller = {
        "at half the size": small,
        "at a quarter": [halved(face) for face in small],
        "every second texel": [np.ascontiguousarray(face[::2, ::2]) for face in faces],
    }
    for how, (neutral, *others) in smaller.items():
        yield f"{name}: {how}", TextureSet.of(neutral, others, textures.names, textures.mesh), np.inf


def halved(image):
    """Means of 2 x 2 texels."""
    h, w, channels = image.shape
    return np.rint(image.reshape(h // 2, 2, w // 2, 2, channels).mean(axis=(1, 3))).astype(image.dtype)


def quality(sets, verdict):
    """RMSE of all methods on all sets against the bars."""
    rows = []
    for name, textures, signal in sets:
        outcomes = {method: run_method(textures, method, options) for method, options in METHODS.items()}
        bound = block_bound(textures).mean()
        mean = {method: outcome.rmse.mean() for method, outcome in outcomes.items()}
        ours = outcomes["refined"]
        rows.append([name, *mean.values(), ours.rmse.max(), bound, ours.psnr.mean(), ours.ssim.mean()])
        height, width = textures.neutral.shape[:2]
        limit = (15 + len(textures.names) / 16) * width * height
        verdict.check(name, "bytes of (15 + N/16) W H", ours.memory_bytes / limit, 1.0)
        if len(textures.names) >= 16:
            verdict.check(name, "refined, max(0.45 PCA(8), B4)", mean["refined"], max(0.45 * mean["PCA(8)"], bound))
            verdict.check(name, "refined, max(0.5 published, B4)", mean["refined"], max(0.5 * mean["published"], bound))
        verdict.check(name, "refined - PCA(4), mean", mean["refined"] - mean["PCA(4)"], 0.05)
        if bound <= 0.8 * mean["PCA(4)"]:
            verdict.check(name, "refined - PCA(4), any texture", (ours.rmse - outcomes["PCA(4)"].rmse).max(), 0.0)
        if name.startswith("unrelated"):
            for other in ("PCA(8)", "published"):
                verdict.check(name, f"refined / {other}", mean["refined"] / mean[other], 0.4)
        if name == FACES:
            verdict.check(name, "mean RMSE", mean["refined"], 3.1)
            verdict.check(name, "worst RMSE", ours.rmse.max(), 3.5)
            check_blocks(name, textures, ours, verdict)
        if textures.truth is not None and signal >= 2.5:
            for other in ("PCA(8)", "published"):
                share = ours.truth_rmse.mean() / outcomes[other].truth_rmse.mean()
                verdict.check(name, f"to the truth, refined / {other}", share, 0.5)
    header = ["mean RMSE", *METHODS, "worst", "B4", "PSNR", "SSIM"]
    print_table("Quality (refined in the last columns)", header, rows)


def check_blocks(name, textures, ours, verdict):
    """What BC7 adds."""
    if encoder_missing("bc7"):
        print(encoder_missing("bc7"))
        return
    coded = block_compressed(ours.packed, neutral=False)
    pairs = zip(coded.textures, ours.packed.textures)
    code = np.sqrt(np.mean([(a.astype(float) - b)[textures.covered] ** 2 for a, b in pairs]))
    print(f"{name}: BC7 moves the codes of difference textures by {code:.2f} of 255 (RMSE)")
    added = measure(textures, "BC7", coded).rmse.mean() - ours.rmse.mean()
    verdict.check(name, "RMSE added by BC7 of the differences", added, 0.5)


def small_sets():
    """(name, TextureSet, inf) of sets of few textures, whose clusters are few and unlike: hard for the search."""
    for size, count, noise, seed in ((256, 9, 2, 0), (200, 9, 0, 5), (200, 6, 2, 5), ((120, 96), 6, 0, 3)):
        made = expression_set(size, count, noise=noise, seed=seed)
        textures = TextureSet(made.neutral, made.textures, made.names, made.mesh, made.covered, made.truth)
        yield f"generated, {count} textures, seed {seed}", textures, np.inf


def search(sets, verdict):
    """The permutation search against 100 random restarts on identical masks, each of 10 sweeps as in the paper.

    The bar is a quarter below the best of them. Where the bound for any state (compression_bound.py) lies above that,
    no search can meet it: the best restart is near the optimum. The bar is then how near to the bound the search comes.
    """
    rows = []
    for name, textures, _ in sets:
        curves = search_curves(textures)
        best, found = curves["history"][-1].min(), curves["ours"].values()
        pairs, triples = curves["search"].bound() / best, None
        reached = max(found) / best
        if reached > SEARCH_BAR:
            triples = triple_bound(curves["search"], passes=BOUND_PASSES) / best
        if triples is None or triples <= SEARCH_BAR:
            verdict.check(name, "search / best of 100 restarts", reached, SEARCH_BAR)
        else:
            what = f"search / bound (no state is below {triples:.3f} of the best restart)"
            verdict.check(name, what, reached / triples, 1.08)
            verdict.check(name, "bound / search", triples * best / min(found), 1.0)
        verdict.check(name, "two seeds differ by", max(found) / min(found) - 1, 0.01)
        rows.append([name, curves["masks"], *(x / best for x in found), pairs, triples, SEARCH_BAR, curves["seconds"]])
    header = ["set", "masks", "seed 0", "seed 1", "bound by pairs", "bound by triples", "bar", "seconds"]
    print_table("Permutation cost / that of the best of 100 random restarts", header, rows)


def priority(sets, verdict):
    """What --priority changes in a tenth of the face, beside what any solution of this form could give it.

    alone: nothing but the region counts, ten times the passes. B4 is of the region alone.
    """
    rows = []
    for name, textures, _ in sets:
        if name not in (FACES, "generated 14/2"):
            continue
        region = tenth(textures.covered)
        weight = np.where(region, 10.0, 1.0)
        runs = {
            "plain": facezip(textures.neutral, textures.textures, covered=textures.covered),
            "priority": facezip(textures.neutral, textures.textures, covered=textures.covered, priority=weight),
            "alone": facezip(
                textures.neutral, textures.textures, covered=region, options=FacezipOptions(iterations=150)
            ),
        }
        inside = {run: part_rmse(packed, textures, region) for run, packed in runs.items()}
        outside = {run: part_rmse(runs[run], textures, textures.covered & ~region) for run in ("plain", "priority")}
        bound = block_bound(replace(textures, covered=region)).mean()
        rows.append([name, *inside.values(), bound, *outside.values()])
        verdict.check(name, "region, priority / plain", inside["priority"] / inside["plain"], 1.0)
        verdict.check(name, "rest, priority / plain", outside["priority"] / outside["plain"], 1.05)
    header = ["set", "region, plain", "priority", "alone", "B4", "rest, plain", "priority"]
    print_table("Priority of a tenth of the face (white: ten times)", header, rows)


def tenth(covered):
    """(h, w) bool: the tenth of the covered texels nearest to the eyes and the bridge of the nose."""
    y, x = np.mgrid[: covered.shape[0], : covered.shape[1]]
    away = np.hypot(x / covered.shape[1] - 0.5, 1.6 * (y / covered.shape[0] - 0.4))
    return covered & (away <= np.quantile(away[covered], 0.1))


def part_rmse(packed, textures, part):
    """Mean over textures of the RMSE in a part (h, w) bool."""
    d = packed.difference_textures()
    images = enumerate(textures.textures)
    return np.mean([rms_error(decode_one(packed, n, d), image.astype(np.float32), part) for n, image in images])


def examples(sets, verdict):
    """Eq. 10 before and after 8 bits, and Fig. 8: shapes against the naive blend of whole textures."""
    name, textures, _ = sets[0]
    packed = facezip(textures.neutral, textures.textures, mesh=textures.mesh, covered=textures.covered)
    B = np.random.default_rng(0).random((len(textures.names), 52)) * (np.random.default_rng(1).random((20, 52)) < 0.3)
    maps = packed.weight_maps()[packed.layers]
    before = np.abs(np.tensordot(B, example_weights(packed, B), 1) - maps).max()
    shapes = with_examples(packed, [f"shape{m}" for m in range(B.shape[1])], B)
    step = (np.abs(B) @ (0.5 * shapes.weight_step)).max(axis=0)
    after = np.abs(np.tensordot(B, shapes.weight_maps(), 1) - maps).max(axis=(0, 1, 2))
    verdict.check(name, "Eq. 10 before 8 bits", before, 1e-6)
    verdict.check(name, "Eq. 10 after, of the sum of half steps", (after / step).max(), 1.0)


def timing(sizes, verdict):
    """Seconds from decoded images to PNG and JSON, on the wall and of all cores; each size in its own process."""
    rows = []
    for size in sizes:
        figures = in_process(size, 20)
        row = [size, 20, *(figures[key] for key in ("wall", "cpu", "quiet", "mb", "rmse")), PAPER_SECONDS.get(size)]
        rows.append([*row, figures["ktx2"], figures["preview"]])
        verdict.check(f"{size}, 20 textures", "seconds", figures["wall"], SECONDS[size])
        if size == 4096:
            verdict.check("4096, 20 textures", "GB", figures["mb"] / 1000, 12)
    header = ["size", "textures", "wall s", "cpu s", "quiet s", "peak MB", "RMSE", "paper s", "ktx2 s", "preview s"]
    print_table("Time", header, rows)


def in_process(size, count):
    """Figures of one compression in a process of its own."""
    command = [sys.executable, __file__, "--one", str(size), str(count)]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()[-1])


def one(size, count):
    """Compress generated textures and print the figures as JSON."""
    drawn = min(size, 2048)  # time does not depend on what is in the images
    source = ExpressionSource(drawn)
    wide = size // drawn

    def grow(image):
        return image.repeat(wide, axis=0).repeat(wide, axis=1) if wide > 1 else image

    held = [source.draw(n)[0] for n in range(min(count, 20))]
    fetch = (
        (lambda n: grow(held[n])) if count <= 20 else (lambda n: grow(np.roll(held[n % 20], 16 * (n // 20), axis=1)))
    )
    neutral, covered = grow(source.neutral), grow(source.covered)
    if count <= 20:
        held = [grow(image) for image in held]
        fetch = held.__getitem__
    del source.patterns
    names = [f"t{n}" for n in range(count)]
    start, busy, alone = time.perf_counter(), time.process_time(), time.thread_time()
    packed = facezip(neutral, fetch, names=names, covered=covered)
    with tempfile.TemporaryDirectory() as folder:
        write_packed(packed, folder)
        wall, cpu = time.perf_counter() - start, time.process_time() - busy
        serial, peak = time.thread_time() - alone, own_peak_mb()
        seconds = packed.report["seconds"]
        quiet = serial + (cpu - serial) / 2
        figures = {"wall": wall, "cpu": cpu, "quiet": quiet, "mb": peak, "rmse": packed.report["mean_rmse"], **seconds}
        figures["ktx2"] = figures["preview"] = None
        if count <= 20 and size <= 2048:
            from facewright.compress.preview import preview_page

            start = time.perf_counter()
            if not encoder_missing("bc7"):
                write_packed(packed, folder, "bc7")
                figures["ktx2"] = time.perf_counter() - start
            start = time.perf_counter()
            preview_page(packed, fetch, count)
            figures["preview"] = time.perf_counter() - start
    print(json.dumps(figures))


def own_peak_mb():
    """Peak resident memory of this process alone, MB; getrusage counts the parent's before exec too."""
    status = Path("/proc/self/status")
    if not status.is_file():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return next(int(line.split()[1]) for line in status.read_text().splitlines() if line.startswith("VmHWM")) / 1e3


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join([*PARTS, "large"]))
    parser.add_argument("--set", type=Path, nargs="*", help="folders with neutral.png, mesh.obj and textures/")
    parser.add_argument("--sizes", type=int, nargs="*", default=[512, 1024])
    parser.add_argument("--restarts", type=int, default=1, help="of the published procedure; extrapolated to 100")
    parser.add_argument("--one", type=int, nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(*options.one)
        return
    parts = options.parts or PARTS
    unknown = set(parts) - {*PARTS, "large"}
    if unknown:
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    folders = options.set if options.set is not None else sorted(TEXTURES.glob("*/")) if TEXTURES.is_dir() else []
    verdict = Verdict()
    sets = [(folder.name, read_set(folder), np.inf) for folder in folders] + list(generated_sets())
    more = [each for name, textures, _ in sets if name == FACES for each in face_sets(name, textures)]
    run = {"priority": priority, "examples": examples}
    if "quality" in parts:
        quality(sets + more, verdict)
    if "seams" in parts:
        seams(sets + more, verdict)
    if "search" in parts:
        search(sets + list(small_sets()), verdict)
    for part in parts:
        if part in run:
            run[part](sets, verdict)
    if "published" in parts:
        published_procedure(sets[0][1], options.restarts, verdict)
    if "time" in parts:
        timing(options.sizes, verdict)
    if "large" in parts:
        timing([2048, 4096], verdict)
        figures = in_process(4096, 100)
        print_table("100 textures at 4096", list(figures), [list(figures.values())])
        verdict.check("4096, 100 textures", "GB", figures["mb"] / 1000, 16)
    verdict.print()


if __name__ == "__main__":
    main()
