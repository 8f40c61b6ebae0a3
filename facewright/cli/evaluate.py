"""Print the figures of a finished job: how well the fit met the scan, and whether the shapes are sound.

  facewright evaluate result/
  facewright evaluate result/ --scan head.obj     # measure the rig's neutral against the scan again
  facewright evaluate rig result/                 # all bars of the finished rig: eyes, mouth, shapes, blends
  facewright evaluate rig any.glb                 # the same of any GLB with named shapes, as far as it can be known
  facewright evaluate result/ --shapes            # every shape: size, folded faces, torn edges, new crossings
  facewright evaluate compression TEXTURES/ --neutral neutral.png --mesh neutral.obj --out figures/   # FaceZip

Distances are in millimetres; docs/evaluate.md defines every figure.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path

from facewright.errors import InputError

HELP = "print the figures of a finished job"
APART_MM = 5.0  # a fit lies within 0.5 mm of its scan: a scan beyond this everywhere is another one, or was moved
COLUMNS = ("mean", "rms", "p95", "max", "left_out")
COLUMN_WIDTHS = (("full", 9), ("plain 52", 9), ("bar", 10), ("bar of 52", 10))


def add_arguments(parser):
    """Arguments of `facewright evaluate`."""
    # The first word is optional, which argparse cannot say.
    parser.usage = "%(prog)s [rig | compression] FOLDER [options]"
    parser.add_argument(
        "result",
        nargs="+",
        metavar="FOLDER",
        help="a folder that `facewright rig` wrote; after rig: such a folder or a GLB; after compression: textures",
    )
    parser.add_argument(
        "--blends", type=int, default=1000, metavar="N", help="evaluate rig: random blends to try (default: 1000)"
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
        if options.scan is not None:
            raise InputError("evaluate rig: looks at no scan; leave out --scan, or the word rig")
        print_bars(_existing(folder), options.blends, options.json)
        return
    if what:
        raise InputError(f"evaluate: one folder at a time, got {len(options.result)}; or: evaluate rig FOLDER")
    figures = collect(_existing(folder), options.scan, options.shapes)
    if "rig_to_scan" in figures:
        note_a_scan_apart(figures["rig_to_scan"], options.scan)
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


def note_a_scan_apart(regions, scan):
    """Say so where no region of a rig lies near the scan; regions as measure_rig_distances gives them."""
    means = [ways["rig_to_scan"]["mean"] for ways in regions.values()]
    nearest = min((mean for mean in means if mean is not None), default=float("inf"))
    if nearest > APART_MM:
        print(f"note: the rig is nowhere near {scan}: made from another scan, or moved since?", file=sys.stderr)


def _existing(path):
    """The path; InputError where nothing lies there."""
    if not Path(path).exists():
        raise InputError(f"evaluate: {path} does not exist; give a folder that `facewright rig` wrote")
    return Path(path)


def print_bars(path, blends, as_json):
    """Every bar of a rig: with in-betweens and correctives, and the plain 52 beside it."""
    from facewright.evaluate.bars import rig_rows
    from facewright.read.gltf_rig import read_gltf_rig
    from facewright.write.rig import read_rig

    rig = read_gltf_rig(path) if path.is_file() else read_rig(path / "rig")
    rows = rig_rows(rig, blends, own_crossings(rig.info))
    if as_json:
        print(json.dumps([asdict(row) | {"met": row.met} for row in rows], indent=1))
        return
    if not rig.regions:
        print("no regions or feature lines in this file: folds and tears count the inside of the mouth too")
    print_rows(rows)


def own_crossings(info):
    """Crossings that the template of a rig has on its own head; None where that template is not here."""
    from facewright.evaluate.shapes import crossings
    from facewright.rigging import template_rig
    from facewright.template.store import list_templates, read_template

    # A file's word for a template is a name and never a path to be followed.
    name = info.get("template")
    if str(name) not in list_templates():
        return None
    template = read_template(name)
    same = template.info.get("topology_id") == info.get("topology_id")
    return crossings(template_rig(template)) if same else None


def print_rows(rows):
    """A table of evaluate.rows.Row, and how many bars are met."""
    wide = [max((len(getattr(row, name)) for row in rows), default=0) for name in ("group", "pose", "figure")]
    head = ("group".ljust(wide[0]), "pose".ljust(wide[1]), "figure".ljust(wide[2]))
    print("  ".join([*head, *(text.rjust(width) for text, width in COLUMN_WIDTHS)]))
    for row in rows:
        names = (row.group.ljust(wide[0]), row.pose.ljust(wide[1]), row.figure.ljust(wide[2]))
        values = (_number(row.full), _number(row.plain), _range(row.bar), _range(row.plain_bar))
        cells = [text.rjust(width) for text, (_, width) in zip(values, COLUMN_WIDTHS)]
        print("  ".join([*names, *cells, "" if row.met else "missed"]).rstrip())
    judged = [row for row in rows if row.has_bar]
    print(f"{sum(row.met for row in judged)} of {len(judged)} bars met")
    for row in judged:
        if not row.met:
            print(f"missed: {row.group}, {row.pose}, {row.figure}: {_number(row.full)} (bar {_range(row.bar)})")


def _number(value):
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.3f}"


def _range(bar):
    if bar == (None, None):
        return "-"
    least, most = ("" if end is None else f"{end:g}" for end in bar)
    return f"{least}..{most}"


def collect(folder, scan_file=None, shapes=False):
    """dict: report, neutral, and if asked rig_to_scan and shapes."""
    from facewright.evaluate.rig import measure_neutral, measure_rig_distances
    from facewright.evaluate.shapes import measure_shapes
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
