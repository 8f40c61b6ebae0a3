"""What should not matter: format, pose, unit, density, order and texture of the same scan.

    python bench/invariance.py [--scan FILE --mm-per-unit N] [--template hm08] [--only NAME ...]

Every variant is written to a file, read back and registered; its result is brought into the original's frame and
compared vertex by vertex with the original's. Default: the embedded sample, and the first real scan if it is there.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from cases import find_benchmark_template
from common import SCANS, Verdict, print_table
from variants import Variant, all_variants, write_variant

from facewright.evaluate.distances import benchmark_scale, interpupillary_mm
from facewright.parts import fit_parts
from facewright.read import read_scan
from facewright.register import register
from facewright.sample import sample_path
from facewright.scan import clean_scan, find_landmarks

BARS = {"format": None, "mesh": None, "pose": 0.7, "grey": 3.0}
"""p95 in mm; the mean's bar is 0.5 mm for all."""


def fitted(path, template):
    """(n, 3) neutral in the file's own units, and whether the texture was seen."""
    scan, _ = clean_scan(read_scan(path))
    found = find_landmarks(scan)
    face = fit_parts(register(found.scan, found.landmarks, template))
    T = found.scan.T_ours_to_scan
    return face.vertices @ T[:3, :3].T + T[:3, 3]


def compare(path, mm_per_unit, template, only, verdict):
    """Print the table of one scan."""
    scan = replace(read_scan(path), unit_mm=mm_per_unit)
    face, outer = template.regions["face"], template.regions["outer"]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        original = Variant("OBJ", "format", scan, np.eye(4))
        clean = fitted(write_variant(original, Path(folder) / "original"), template)
        scale = mm_per_unit * benchmark_scale(interpupillary_mm(clean * mm_per_unit, template))
        for number, variant in enumerate(all_variants(scan)):
            if only and variant.name not in only:
                continue
            began = time.perf_counter()
            there = fitted(write_variant(variant, Path(folder) / str(number)), template)
            back = np.linalg.inv(variant.T)
            error = np.linalg.norm(there @ back[:3, :3].T + back[:3, 3] - clean, axis=1) * scale
            p95 = np.percentile(error[face], 95)
            row = (variant.name, error[face].mean(), p95, error[face].max(), error[outer].mean())
            rows.append((*row, time.perf_counter() - began))
            verdict.check(variant.name, f"{scan.name}: mean", error[face].mean(), 0.5)
            if BARS[variant.kind] is not None:
                verdict.check(variant.name, f"{scan.name}: p95", p95, BARS[variant.kind])
    header = ("variant", "face mean", "p95", "max", "all outside", "s")
    print_table(f"{path.name} on {template.info['name']}: against the original, mm at 63 mm", header, rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scan", type=Path)
    parser.add_argument("--mm-per-unit", type=float, default=1.0)
    parser.add_argument("--template", default="hm08")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help='such as "grey" or "decimated"')
    options = parser.parse_args()
    scans = [(options.scan, options.mm_per_unit)] if options.scan else [(sample_path(), 10.0)]
    real = SCANS / "lee-perry-smith" / "head.obj"
    if not options.scan and real.is_file():
        scans.append((real, 50.4))
    verdict = Verdict()
    for path, mm_per_unit in scans:
        compare(path, mm_per_unit, find_benchmark_template(options.template), options.only, verdict)
    verdict.print()


if __name__ == "__main__":
    main()
