"""Registration against known truth: ten made scans per template, ours beside MeshMonk 0.3.0.

    python bench/registration_truth.py [--templates hm08 ict] [--seeds 0 1 2] [--no-meshmonk]

Figures are scaled to 63 mm between the pupils. Landmarks are found on the scan as in the main job; the time is that of
the registration alone, for both.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from cases import SEEDS, find_benchmark_template, fitting_template, make_case
from common import Verdict, print_table
from meshmonk_runner import is_available, run_meshmonk
from PIL import Image
from threadpoolctl import threadpool_limits

from facewright.evaluate.distances import benchmark_scale, interpupillary_mm
from facewright.evaluate.quality import measure_quality
from facewright.evaluate.truth import surface_errors, vertex_errors
from facewright.mesh.raster import Camera
from facewright.mesh.render import render, srgb_to_linear
from facewright.register import register
from facewright.scan import clean_scan, find_landmarks
from facewright.scan.landmarks import STABLE
from facewright.solve.procrustes import best_similarity

BARS = {"face mean": 0.8, "face p95": 1.8, "lips mean": 0.8, "surface mean": 0.10, "folded": 0}
HEADER = ("scan", "face mean", "p95", "max", "lips mean", "p95", "surface", "folded", "crossing", "gap", "s")


def landmark_similarity(template, landmarks, scan):
    """(4, 4) the template onto the scan's stable landmarks (lips, eyes, nose): where our own fit begins."""
    place = {name: i for i, name in enumerate(template.landmarks.names) if template.landmarks.weights[i] > 0}
    stable = {f"mp{number}" for number in STABLE}
    both = [(place[n], i) for i, n in enumerate(landmarks.names) if n in place and n in stable]
    ours, theirs = np.array(both).T
    source = template.landmarks.positions(template.vertices, template.faces)[ours]
    target = landmarks.positions(scan.vertices, scan.faces)[theirs]
    R, scale, t = best_similarity(source, target, landmarks.weights[theirs])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = scale * R, t
    return T


def figures(template, fit, found, case, seconds):
    """Row of numbers of one fit (n, 3) in our frame."""
    T = found.scan.T_ours_to_scan
    in_file = fit @ T[:3, :3].T + T[:3, 3]
    scale = benchmark_scale(interpupillary_mm(case.truth, template))
    errors = vertex_errors(in_file, case.truth, template.regions, scale=scale)
    surface = surface_errors(in_file, template, case.surface, scale=scale)
    quality = measure_quality(found.scan, fit, template)
    return {
        "face mean": errors["face"]["mean"],
        "face p95": errors["face"]["p95"],
        "face max": errors["face"]["max"],
        "lips mean": errors["lips"]["mean"],
        "lips p95": errors["lips"]["p95"],
        "surface mean": surface["mean"],
        "folded": quality["folded"],
        "crossing": quality["self_intersections"],
        "gap": quality["lip_gap_mm"],
        "s": seconds,
    }


def write_picture(path, template, fit, found, case):
    """The scan, the fit in clay and the fit coloured by its error: blue 0, white 1, red 3 mm and more."""
    T = found.scan.T_ours_to_scan
    error = np.linalg.norm(fit @ T[:3, :3].T + T[:3, 3] - case.truth, axis=1)
    ramp = ([0.1, 0.8, 0.7], [0.2, 0.8, 0.1], [0.7, 0.8, 0.1])
    heat = np.stack([np.interp(error, [0, 1, 3], levels) for levels in ramp], axis=1)
    skin = template.faces[template.skin.face_slice]
    rows = []
    for yaw in (0.0, 50.0):
        camera = Camera.looking_at((0.0, -25.0, 0.0), yaw, 0.0, 120.0, (560, 480))
        looks = srgb_to_linear(found.scan.colors) if found.scan.colors is not None else None
        rows.append(
            np.hstack(
                [
                    render(found.scan.vertices, found.scan.faces, camera, colors=looks),
                    render(fit, template.faces, camera),
                    render(fit, skin, camera, colors=heat),
                ]
            )
        )
    Image.fromarray(np.vstack(rows)).save(path)


def run_template(name, seeds, with_meshmonk, verdict, pictures=None):
    """Print both tables of a template and add to the verdict."""
    template = find_benchmark_template(name)
    if template is None:
        print(f"template {name}: not here, left out")
        return
    fitted_with = fitting_template(template)
    ours, theirs = [], []
    for seed in seeds:
        case = make_case(template, seed)
        cleaned, _ = clean_scan(case.scan)
        found = find_landmarks(cleaned)
        began = time.perf_counter()
        with threadpool_limits(1, user_api="blas"):  # as in the job
            face = register(found.scan, found.landmarks, fitted_with)
        row = figures(template, face.fit, found, case, time.perf_counter() - began)
        ours.append(row)
        if pictures:
            write_picture(pictures / f"{case.name}.png", template, face.fit, found, case)
        for figure, bar in BARS.items():
            verdict.check(case.name, figure, row[figure], bar)
        if with_meshmonk:
            fit, seconds = run_meshmonk(
                template, landmark_similarity(template, found.landmarks, found.scan), found.scan
            )
            theirs.append(figures(template, fit, found, case, seconds))
            verdict.check(case.name, "face mean, MeshMonk's as bar", row["face mean"], theirs[-1]["face mean"])
        print(f"{case.name}: face {row['face mean']:.2f} mm, {row['s']:.1f} s", file=sys.stderr)
    for title, rows in (("Facewright", ours), ("MeshMonk 0.3.0, its defaults, from our similarity", theirs)):
        if rows:
            table = [(f"{name}-{seed}", *row.values()) for seed, row in zip(seeds, rows)]
            table.append(("mean", *np.mean([list(row.values()) for row in rows], axis=0)))
            print_table(f"{title}: template {name}, mm at 63 mm between the pupils", HEADER, table)
    if theirs:
        verdict.check(name, "seconds in all, MeshMonk's as bar", sum(r["s"] for r in ours), sum(r["s"] for r in theirs))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--templates", nargs="+", default=["hm08", "ict"])
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--no-meshmonk", action="store_true")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write a picture of each fit there")
    options = parser.parse_args()
    if options.pictures:
        options.pictures.mkdir(parents=True, exist_ok=True)
    with_meshmonk = not options.no_meshmonk and is_available()
    if not with_meshmonk:
        print("MeshMonk is left out (pip install meshmonk==0.3.0 to compare)")
    verdict = Verdict()
    for name in options.templates:
        run_template(name, options.seeds, with_meshmonk, verdict, options.pictures)
    verdict.print()


if __name__ == "__main__":
    main()
