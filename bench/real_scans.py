"""Registration of two real scans, both templates, against every bar.

    python bench/real_scans.py [--scans lee-perry-smith menpo-james] [--templates hm08 ict] [--pictures FOLDER]

The scans lie beside the project (see bench/common.py). Figures are those of the fit, before lids are opened and the
expression is taken out, scaled to 63 mm between the pupils. Features, lip line and skin mask were drawn by hand before
any fit was seen (bench/data, made with bench/pick_features.py).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from cases import find_benchmark_template
from common import SCANS, Verdict, file_vertices, painted_mask, print_table, read_json
from features import LJSON_TO_IBUG, feature_points, ibug_positions, off_by_mm, polyline_distance
from PIL import Image

from facewright.evaluate.distances import benchmark_scale, interpupillary_mm, measure_distances
from facewright.evaluate.quality import measure_quality, region_faces
from facewright.evaluate.seam import measure_seam
from facewright.mesh.closest import Surface
from facewright.mesh.facing import folded_faces
from facewright.mesh.raster import Camera
from facewright.mesh.render import render
from facewright.parts import fit_parts
from facewright.read import read_scan
from facewright.register import register
from facewright.scan import clean_scan, find_landmarks

FILES = {"lee-perry-smith": ("head.obj", "albedo.jpg"), "menpo-james": ("james.obj", "james.jpg")}
FROM_FRONT = np.array([1.0, 1.0, 0.0])
COLUMNS = ("mean", "rms", "p95", "max", "left_out")


def fit_scan(name, template):
    """FoundFace, Face (fit and neutral with parts) and the seconds of the registration."""
    mesh, albedo = FILES[name]
    scan, _ = clean_scan(read_scan(SCANS / name / mesh, albedo=SCANS / name / albedo))
    found = find_landmarks(scan)
    began = time.perf_counter()
    face = register(found.scan, found.landmarks, template)
    seconds = time.perf_counter() - began
    return found, fit_parts(face), seconds


def shared_figures(found, face, scale, subset=None):
    """Distances, soundness and seam of a fit."""
    template = face.template
    figures = measure_distances(found.scan, face.fit, template, face.regions, subset=subset, scale=scale)
    figures |= measure_quality(found.scan, face.fit, template, face.regions, face.lines)
    return figures | measure_seam(found.scan, face.fit, face.lines, scale=scale)


def print_distances(title, figures):
    """The distance table of one fit."""
    rows = [("face: scan to face", figures["scan_to_face_mm"]), ("face: face to scan", figures["face_to_scan_mm"])]
    for region in ("lips", "nostrils"):
        rows += [(f"{region}: {way[:-3].replace('_', ' ')}", values) for way, values in figures[region].items()]
    print_table(title, ("mm at 63 mm", *COLUMNS), [(name, *(values[c] for c in COLUMNS)) for name, values in rows])


def neutral_change(face, scale):
    """Mean move of the neutral off the fit outside eyes and lips, and the largest move with its region."""
    moved = np.linalg.norm(face.vertices - face.fit, axis=1) * scale
    regions = face.regions
    outside = regions["face"] & ~regions["eyes"] & ~regions["lips"]
    worst = np.flatnonzero(regions["outer"])[moved[regions["outer"]].argmax()]
    names = [name for name in ("eyes", "lips", "face", "scalp", "neck") if regions[name][worst]]
    return float(moved[outside].mean()), float(moved[worst]), names[0] if names else "outer"


def check_lee_perry_smith(where, template, verdict, pictures):
    """All bars of the first scan."""
    found, face, seconds = fit_scan("lee-perry-smith", template)
    scale = benchmark_scale(interpupillary_mm(face.vertices, template))
    figures = shared_figures(found, face, scale)
    print_distances(f"{where}: {seconds:.1f} s, scale {scale:.3f}", figures)
    check = verdict.check
    for figure, bar in (("mean", 0.10), ("p95", 0.28)):
        check(where, f"scan to face {figure}", figures["scan_to_face_mm"][figure], bar)
    for figure, bar in (("mean", 0.15), ("p95", 0.50)):
        check(where, f"face to scan {figure}", figures["face_to_scan_mm"][figure], bar)
    for figure, bar in (("mean", 0.12), ("p95", 0.32)):
        check(where, f"lips, scan to face {figure}", figures["lips"]["scan_to_face_mm"][figure], bar)
    check(where, "seam p95", figures["lip_seam_mm"], 0.3)
    check(where, "normals, degrees mean", figures["normal_deg_mean"], 3.0)
    check_soundness(where, figures, verdict)
    check_features(where, found, face, scale, verdict)
    moved, largest, region = neutral_change(face, scale)
    check(where, "neutral off the fit, mean", moved, 0.1)
    print(f"largest removal {largest:.2f} mm, in region {region}; eyes closed {face.eyes_closed}")
    write_pictures(pictures, where, found, face)


def check_soundness(where, figures, verdict):
    """Folds, crossings and the mouth."""
    verdict.check(where, "folded faces", figures["folded"], 0)
    verdict.check(where, "new self-intersections", figures["self_intersections"], 0)
    verdict.check(where, "lip gap", figures["lip_gap_mm"], 0.3)
    verdict.check(where, "visible inner mouth, mm2", figures["visible_mouth_mm2"], 0.0)


def check_features(where, found, face, scale, verdict):
    """Hand-picked features and lip line of the scan against the same places on the fit."""
    picked = read_json("lee-perry-smith.features.json")
    to_ours = np.linalg.inv(found.scan.T_ours_to_scan)

    def ours(points):
        return np.atleast_2d(points) @ to_ours[:3, :3].T + to_ours[:3, 3]

    fitted = feature_points(face.template, face.fit)
    first, second = ({n: ours(p)[0] for n, p in picking["points"].items()} for picking in picked["pickings"])
    rows = []
    for name in first:
        noise = np.linalg.norm(first[name] - second[name]) * scale
        middle = (first[name] + second[name]) / 2
        rows.append((name, off_by_mm(name, fitted[name], middle) * scale, noise))
    rows.append(("mean", *np.mean([row[1:] for row in rows], axis=0)))
    print_table(f"{where}: hand-picked features", ("feature", "off by mm", "noise of the picking"), rows)
    verdict.check(where, "features mean", rows[-1][1], 2.0)
    verdict.check(where, "features worst", max(row[1] for row in rows[:-1]), 4.0)
    for curve, lines in (("lip_seam", ("lip_seam_upper",)), ("lip_outer_upper",) * 2, ("lip_outer_lower",) * 2):
        lines = (lines,) if isinstance(lines, str) else lines
        on_fit = face.fit[np.concatenate([face.lines[line] for line in lines])]
        drawn = [ours(picking["curves"][curve]) for picking in picked["pickings"]]
        in_space = np.mean([polyline_distance(on_fit, line) for line in drawn], axis=0) * scale
        # Drawn on a picture from in front: its depth is that of the skin before the crease.
        off = np.mean([polyline_distance(on_fit * FROM_FRONT, line * FROM_FRONT) for line in drawn], axis=0) * scale
        noise = polyline_distance(drawn[0] * FROM_FRONT, drawn[1] * FROM_FRONT) * scale
        print(
            f"{curve}: mean {off.mean():.2f}, max {off.max():.2f} mm off the drawn line as drawn, from in front "
            f"(noise {noise.mean():.2f}); in space {in_space.mean():.2f}, {in_space.max():.2f}"
        )
        if curve == "lip_seam":
            verdict.check(where, "seam off the drawn line, max", off.max(), 1.5)


def check_james(where, template, verdict, pictures):
    """All bars of the second scan: on a painted skin mask, with published landmarks."""
    found, face, seconds = fit_scan("menpo-james", template)
    scale = benchmark_scale(interpupillary_mm(face.vertices, template))
    mask = painted_mask(file_vertices(found.scan), found.scan.faces, read_json("menpo-james.skin.json"))
    figures = shared_figures(found, face, scale, mask)
    print_distances(f"{where}: {seconds:.1f} s, scale {scale:.3f}, painted skin", figures)
    check = verdict.check
    check(where, "painted skin left out", figures["scan_to_face_mm"]["left_out"], 0.02)
    check(where, "scan to face mean", figures["scan_to_face_mm"]["mean"], 0.15)
    check(where, "scan to face p95", figures["scan_to_face_mm"]["p95"], 0.45)
    check(where, "lips, scan to face mean", figures["lips"]["scan_to_face_mm"]["mean"], 0.25)
    check(where, "seam p95", figures["lip_seam_mm"], 0.7)
    check_soundness(where, figures, verdict)
    check(where, "published points, mean", published_points(where, found, face, scale), 3.0)
    skin = region_faces(face.regions["outer"], template.faces)
    folded = folded_faces(Surface(found.scan.vertices, found.scan.faces), face.fit, template.faces, skin)
    print(f"folded faces anywhere outside, hair and ears with them: {len(folded)}")
    write_pictures(pictures, where, found, face)


def published_points(where, found, face, scale):
    """Mean distance to the mouth, eye and nose points of james.ljson."""
    document = json.loads((SCANS / "menpo-james" / "james.ljson").read_text())
    points = np.array(document["groups"]["LJSON"]["landmarks"]["points"], float)
    T = found.scan.T_ours_to_scan
    on_fit = ibug_positions(face.template, face.fit)
    rows = {"mouth": [], "eyes": [], "nose": []}
    for point, number in zip(points, LJSON_TO_IBUG):
        group = "nose" if 28 <= number <= 36 else "eyes" if 37 <= number <= 48 else "mouth" if number >= 49 else None
        if group and f"p{number}" in on_fit:
            there = T[:3, :3] @ on_fit[f"p{number}"] + T[:3, 3]
            rows[group].append(np.linalg.norm(there - point) * scale / np.cbrt(np.linalg.det(T[:3, :3])))
    table = [(name, np.mean(values), np.max(values), len(values)) for name, values in rows.items() if values]
    print_table(f"{where}: published points", ("points", "mean mm", "max", "count"), table)
    everything = [value for values in rows.values() for value in values]
    return float(np.mean(everything)) if everything else float("nan")


def write_pictures(folder, where, found, face):
    """The scan, the fit and the neutral side by side, three views and the mouth."""
    if not folder:
        return
    rows = []
    for center, yaw, half in (
        ((0, -25, 0), 0, 125),
        ((0, -25, -20), 50, 125),
        ((0, -25, -40), 90, 125),
        ((0, -68, 10), 0, 32),
    ):
        camera = Camera.looking_at(center, yaw, 0, half, (520, 480))
        pictures = [render(found.scan.vertices, found.scan.faces, camera)]
        pictures += [render(vertices, face.template.faces, camera) for vertices in (face.fit, face.vertices)]
        rows.append(np.hstack(pictures))
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.vstack(rows)).save(folder / f"{where.replace(' on ', '-')}.png")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", nargs="+", default=list(FILES), choices=list(FILES))
    parser.add_argument("--templates", nargs="+", default=["hm08", "ict"])
    parser.add_argument("--pictures", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    if not SCANS.is_dir():
        raise SystemExit(f"the real scans are not here ({SCANS})")
    verdict = Verdict()
    checks = {"lee-perry-smith": check_lee_perry_smith, "menpo-james": check_james}
    for name in options.templates:
        template = find_benchmark_template(name)
        if template is None:
            print(f"template {name}: not here, left out")
            continue
        for scan in options.scans:
            checks[scan](f"{scan} on {name}", template, verdict, options.pictures)
    verdict.print()


if __name__ == "__main__":
    main()
