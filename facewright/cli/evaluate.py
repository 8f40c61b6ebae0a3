"""Print the figures of a finished job: how well the fit met the scan, and whether the shapes are sound.

  facewright evaluate result/
  facewright evaluate result/ --scan head.obj     # measure the rig's neutral against the scan again
  facewright evaluate rig result/                 # bars of the finished rig: eyes, lips, teeth, jaw
  facewright evaluate result/ --shapes            # every shape: size, folded faces, torn edges, new crossings
  facewright evaluate compression TEXTURES/ --neutral neutral.png --mesh neutral.obj --out figures/   # FaceZip

Distances are in millimetres; docs/evaluate.md defines every figure.
"""

from __future__ import annotations

import json
from pathlib import Path

from facewright.errors import InputError

HELP = "print the figures of a finished job"
COLUMNS = ("mean", "rms", "p95", "max", "left_out")


def add_arguments(parser):
    """Arguments of `facewright evaluate`."""
    parser.add_argument(
        "result",
        nargs="+",
        metavar="[rig|compression] FOLDER",
        help="a folder that `facewright rig` wrote, or textures",
    )
    parser.add_argument("--scan", metavar="FILE", help="the scan that the rig was made from")
    parser.add_argument("--shapes", action="store_true", help="measure every shape too")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--neutral", metavar="IMAGE", help="compression: the neutral texture")
    parser.add_argument("--mesh", metavar="OBJ", help="compression: the mesh with UVs that the textures belong to")
    parser.add_argument("--out", metavar="FOLDER", help="compression: folder for tables, CSV and plots")


def run(options):
    """Collect the figures and print them."""
    *what, folder = options.result
    if what == ["compression"]:
        from facewright.cli.evaluate_compression import evaluate

        evaluate(folder, options)
        return
    if what == ["rig"]:
        print_rig(Path(folder), options.json)
        return
    if what:
        raise InputError(f"evaluate: one folder at a time, got {len(options.result)}; or: evaluate rig FOLDER")
    figures = collect(Path(folder), options.scan, options.shapes)
    if options.json:
        print(json.dumps(figures, indent=1))
        return
    print_distances("the fit, as report.json has it (mm)", report_rows(figures["report"]["registration"]))
    print_values(figures["report"]["registration"])
    if "rig_to_scan" in figures:
        rows = [
            (f"{region} {way}", values)
            for region, ways in figures["rig_to_scan"].items()
            for way, values in ways.items()
        ]
        print_distances("the rig's neutral against the scan (mm)", rows)
    for name, values in figures.get("shapes", {}).items():
        print("  ".join([name.ljust(22), *(f"{key} {value:.4g}" for key, value in values.items())]))


def print_rig(folder, as_json):
    """The bars of lids, eyeballs, lips, teeth and jaw: with in-betweens and correctives, and the plain 52 beside."""
    from facewright.evaluate import eyes, mouth
    from facewright.evaluate.rig import measure_jaw
    from facewright.write.rig import read_rig

    rig = read_rig(folder / "rig")
    figures = {"eyes": eyes.measure_eyes(rig), "mouth": mouth.measure_mouth(rig), "jaw": measure_jaw(rig)}
    if as_json:
        print(json.dumps(figures, indent=1))
        return
    of_eyes, of_mouth, jaw = figures.values()
    print(
        f"eyeball radius {of_eyes['radius_mm']:.2f} mm (11.5 to 12.5), lid gap at rest {of_eyes['lid_gap_mm']:.2f} mm "
        f"(0.3), lip gap at rest {of_mouth['lip_gap_mm']:.2f} mm (0.3)"
    )
    print(
        f"upper teeth move by {of_mouth['upper_teeth_moved_mm']:.2f} mm (0), the neck ring by "
        f"{of_mouth['neck_moved_mm']:.2f} mm (0)"
    )
    if jaw is not None:
        print(
            f"jawOpen and jaw bone differ by: teeth {jaw['teeth_mm']:.3f} mm, skin {jaw['skin_mean_mm']:.1f} mm mean, "
            f"{jaw['skin_p95_mm']:.1f} p95; hinge {jaw['before_ear_mm']:.0f} mm before the ear"
        )
    print("  ".join(["pose".ljust(34), "figure".ljust(11), "bar".rjust(5), "full".rjust(6), "plain".rjust(6)]))
    print_bars(of_eyes["poses"], {"depth_mm": eyes.DEPTH_BAR_MM, "margins_mm": eyes.GAP_BAR_MM})
    closed = {"jawOpen + mouthClose": {"gap_mm": of_mouth.get("mouth_close_gap_mm", ())}}
    print_bars(closed, {"gap_mm": mouth.CLOSE_BAR_MM})
    print_bars(worst_on_the_way(of_mouth["poses"]), mouth.BARS_MM)


def worst_on_the_way(poses):
    """Poses of one shape ("mouthSmile 0.5") as one, with the worst figure at any weight."""
    result = {}
    for pose, figures in poses.items():
        name, _, weight = pose.rpartition(" ")
        known = result.setdefault(name if weight.replace(".", "").isdigit() else pose, {})
        for key, values in figures.items():
            known[key] = tuple(map(max, zip(known.get(key, values), values)))
    return result


def print_bars(poses, bars):
    """A line for each figure of each pose that has a bar; what misses it is marked."""
    for pose, figures in poses.items():
        for key, bar in bars.items():
            if figures.get(key):
                full, plain = figures[key]
                verdict = "" if full <= bar else "  missed"
                print(f"{pose.ljust(34)}  {key.ljust(11)}  {bar:5.2f}  {full:6.2f}  {plain:6.2f}{verdict}")


def collect(folder, scan_file=None, shapes=False):
    """dict: report, neutral, and if asked rig_to_scan and shapes."""
    from facewright.evaluate.rig import measure_neutral, measure_rig_distances, measure_shapes
    from facewright.write.rig import read_rig

    rig = read_rig(folder / "rig")
    figures = {"report": read_report(folder / "report.json"), "neutral": measure_neutral(rig)}
    if scan_file is not None:
        figures["rig_to_scan"] = measure_rig_distances(rig, scan_in_rig_frame(scan_file, rig))
    if shapes:
        figures["shapes"] = measure_shapes(rig)
    return figures


def scan_in_rig_frame(path, rig):
    """The scan file, cleaned, in the frame of the rig's vertices."""
    from facewright.evaluate.rig import rig_frame
    from facewright.read import read_scan
    from facewright.scan import clean_scan

    scan, _ = clean_scan(read_scan(path))
    return scan.transformed(rig_frame(rig))


def read_report(path):
    """report.json as a dict."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"evaluate: cannot read {path} ({error}); give a folder that `facewright rig` wrote"
        ) from error


def report_rows(registration):
    """(name, summary) of every pair of distances in a report."""
    rows = []
    for region in ("", "lips", "nostrils"):
        block = registration.get(region, {}) if region else registration
        for key in ("scan_to_face_mm", "face_to_scan_mm"):
            if key in block:
                rows.append((f"{region or 'face'} {key.removesuffix('_mm').replace('_', ' ')}", block[key]))
    return rows


def print_distances(title, rows):
    """A table of summaries."""
    print(title)
    print("  ".join(["".ljust(24), *(column.rjust(8) for column in COLUMNS)]))
    for name, values in rows:
        cells = ["-".rjust(8) if values[c] is None else f"{values[c]:8.3f}" for c in COLUMNS]
        print("  ".join([name.ljust(24), *cells]))


def print_values(registration):
    """The single figures of a report, one a line."""
    for name, value in sorted(registration.items()):
        if isinstance(value, (int, float)):
            print(f"{name.ljust(24)}  {value:8.3f}")
