"""Shapes, eyes and contact on many heads: every bar of the finished rig, the worst head of each.

    python bench/shapes.py [--template hm08 ict] [--heads 20] [--blends 1000] [--only NAME ...] [--fresh] [--json FILE]

Heads: the template itself, the embedded sample and the real scans beside the project (registered once, then kept under
bench/cache until the code of registration changes; --fresh registers again), and --heads random people of the
template's identity modes, which are faces without a registration. Figures are those of `facewright evaluate rig`; the
random people share the blends.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
from cases import find_benchmark_template, fingerprint
from common import CACHE, SCANS, peak_memory_mb, print_table
from threadpoolctl import threadpool_limits

import facewright
from facewright.cli.evaluate import print_rows
from facewright.evaluate.bars import rig_rows
from facewright.evaluate.rows import Row, worst_rows
from facewright.evaluate.shapes import MIRROR_BAR_MM, crossings, mirror_mm
from facewright.evaluate.synthetic import random_identity
from facewright.packing import pack_face, unpack_face
from facewright.read import read_scan
from facewright.register import register
from facewright.rigging import assembled, in_place, shapes_of, template_rig, unscanned_face
from facewright.sample import sample_path
from facewright.scan import clean_scan, find_landmarks
from facewright.transfer import transfer_shapes

TRANSFER_BAR_S, CONTACT_BAR_S = 1.5, 10.0
REAL = {"lee-perry-smith": "lee-perry-smith/head.obj", "menpo-james": "menpo-james/james.obj"}


def registered(template, path, fresh):
    """The Face of a scan, from the cache if it is there."""
    digest = fingerprint(template, path.name, *_registering_code())
    cached = CACHE / f"face-{template.info['name']}-{path.parent.name}-{digest}.npz"
    info = cached.with_suffix(".json")
    if fresh or not (cached.is_file() and info.is_file()):
        scan, _ = clean_scan(read_scan(path))
        found = find_landmarks(scan)
        arrays, told = pack_face(register(found.scan, found.landmarks, template))
        CACHE.mkdir(exist_ok=True)
        np.savez(cached, **arrays)
        info.write_text(json.dumps(told, default=float))
    with np.load(cached) as arrays:
        return unpack_face(dict(arrays), json.loads(info.read_text()), template)


def _registering_code():
    """The sources that a registered face depends on."""
    folders = (Path(facewright.__file__).parent / name for name in ("read", "scan", "register", "mesh", "solve"))
    return [path.read_text() for folder in folders for path in sorted(folder.rglob("*.py"))]


def rigged(face, seconds):
    """The Rig of a Face, as the main job makes it; adds core seconds (the clock's, when nothing else runs)."""
    face = in_place(face)
    with threadpool_limits(1, user_api="blas"):  # as in the job
        start = time.process_time()
        transfer_shapes(face)
        seconds["transfer"], start = time.process_time() - start, time.process_time()
        targets = shapes_of(face)
        seconds["contact"] = time.process_time() - start - seconds["transfer"]
        return assembled(face, targets)


def heads(template, count, only, fresh):
    """(name, Face without its parts in place) of all heads of a template."""
    scans = {"sample": sample_path()} | {name: SCANS / file for name, file in REAL.items()}
    wanted = ["template", *scans, *(f"random-{seed:02d}" for seed in range(count))]
    for name in wanted:
        if only and name not in only:
            continue
        if name == "template":
            yield name, unscanned_face(template, template.vertices)
        elif name not in scans:
            yield name, unscanned_face(template, random_identity(template, int(name[-2:])))
        elif scans[name].is_file():
            yield name, registered(template, scans[name], fresh)


def measure(template, name, face, blends, own):
    """Rows of one head, its time rows included; own: crossings of the template's own head."""
    seconds = {}
    rig = rigged(face, seconds)
    rows = [
        Row("time", "all shapes", "transfer, core s", seconds["transfer"], bar=(None, TRANSFER_BAR_S)),
        Row("time", "all shapes", "contact, core s", seconds["contact"], bar=(None, CONTACT_BAR_S)),
    ]
    if name == "template":
        found = mirror_mm(rig, template.mirror[template.skin.vertex_slice])
        rows += [
            Row("shapes", shape, "differs from its mirror image mm", value, bar=(None, MIRROR_BAR_MM))
            for shape, value in found.items()
        ]
    return rows + rig_rows(rig, blends, own)


def print_summary(title, tables):
    """The worst pose and head of each kind of figure, then every figure that some head misses."""
    worst = worst_rows(tables)
    kinds = {}
    for entry in worst:
        if entry[0].has_bar or entry[0].group == "blends":
            kinds.setdefault((entry[0].group, entry[0].figure), []).append(entry)
    rows = []
    for (group, figure), entries in kinds.items():
        row, head = entries[0][:2]
        for other, there, *_ in entries[1:]:
            if row.worse(other) is other:
                row, head = other, there
        judged = sum(count for entry, _, _, count in entries if entry.has_bar)
        met = f"{sum(met for entry, _, met, _ in entries if entry.has_bar)}/{judged}" if judged else "-"
        rows.append((group, figure, row.full, row.plain, row.pose, head, met))
    print_table(title, ("group", "figure", "worst", "plain 52", "pose", "head", "met"), rows)
    missed = [(r.group, r.pose, r.figure, r.full, r.plain, head, f"{met}/{n}") for r, head, met, n in worst if met < n]
    print_table(f"{title}: missed", ("group", "pose", "figure", "worst", "plain 52", "head", "met"), missed)
    judged = [row for found in tables.values() for row in found if row.has_bar]
    print(f"{title}: {sum(row.met for row in judged)} of {len(judged)} bars met on {len(tables)} heads")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--template", nargs="*", default=["hm08", "ict"])
    parser.add_argument("--heads", type=int, default=20)
    parser.add_argument("--blends", type=int, default=1000)
    parser.add_argument("--only", nargs="*", default=())
    parser.add_argument("--fresh", action="store_true")
    parser.add_argument("--all", action="store_true", help="print the rows of every head too")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    written = {}
    for template_name in options.template:
        template = find_benchmark_template(template_name)
        if template is None:
            print(f"template {template_name} is not here: left out")
            continue
        tables, own = {}, crossings(template_rig(template))
        for name, face in heads(template, options.heads, options.only, options.fresh):
            blends = -(-options.blends // options.heads) if name.startswith("random") else options.blends
            tables[name] = measure(template, name, face, blends, own)
            judged = [row for row in tables[name] if row.has_bar]
            print(f"{template_name} {name}: {sum(row.met for row in judged)} of {len(judged)} bars met", flush=True)
            if options.all:
                print_rows(tables[name])
        print_summary(template_name, tables)
        written[template_name] = {name: [asdict(row) for row in rows] for name, rows in tables.items()}
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(written, file, indent=1, default=float)
    print(f"peak memory {peak_memory_mb():.0f} MB")


if __name__ == "__main__":
    main()
