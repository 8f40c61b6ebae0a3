"""Make a rig from one neutral head scan (OBJ, PLY, GLB or glTF; any topology, orientation and unit).

The folder given by --out receives rig.glb, rig/ (everything without loss), textures/, preview.png, report.json and
stages/ (so that a stopped or changed run goes on where it was). Look at preview.png first.

  facewright rig head.obj --out result/
  facewright rig head.ply --units cm --template ict --texture-size 4096 --out result/
  facewright rig head.obj --landmarks fixed.json --out result/     # a few points moved by hand
"""

from __future__ import annotations

import argparse
from pathlib import Path

from facewright.cli.progress import ProgressLine
from facewright.conventions import MM_PER_UNIT

HELP = "make a rig from one head scan"
IRIS_PATTERNS = ("fibres", "crypts", "furrows", "flower", "burst", "speckled")
UPS = ("x", "y", "z", "-x", "-y", "-z")
SHAPES_HELP = (
    "apple: exactly the 52 ARKit shapes; full: left and right halves of the shapes that move both sides, in-betweens "
    "(name@0.5) and pair correctives (a+b)"
)


def add_job_arguments(parser):
    """Options that `rig` and `demo` share."""
    parser.add_argument("--template", default="hm08", metavar="NAME|FOLDER", help="template to fit (default: hm08)")
    parser.add_argument(
        "--texture-size", type=_texture_size, default=2048, metavar="N", help="side of the maps, pixels (default: 2048)"
    )
    parser.add_argument(
        "--eyes",
        choices=("template", "as-scanned"),
        default="template",
        help="closed lids: open them to the template's aperture, or leave them (default: template)",
    )
    parser.add_argument(
        "--iris",
        choices=IRIS_PATTERNS,
        default="fibres",
        help="pattern of the irises (default: fibres); the colour is the scan's where its eyes are open",
    )
    parser.add_argument(
        "--formats", type=_formats, default=("glb",), metavar="LIST", help="glb, obj, comma-separated (default: glb)"
    )
    parser.add_argument("--shapes", choices=("apple", "full"), default="apple", help=SHAPES_HELP)
    parser.add_argument(
        "--jobs", type=_jobs, default=2, metavar="N", help="cores to use (default: 2); the result does not depend on it"
    )
    parser.add_argument(
        "--from",
        dest="from_stage",
        metavar="STAGE",
        help="run again from read, landmarks, register, parts, transfer, bake or write",
    )
    parser.add_argument("--quiet", action="store_true", help="print no progress")


def add_arguments(parser):
    """Arguments of `facewright rig`."""
    parser.add_argument("scan", help="the head scan: .obj, .ply, .glb or .gltf")
    parser.add_argument("--out", required=True, metavar="FOLDER", help="folder that receives the rig")
    parser.add_argument("--albedo", metavar="IMAGE", help="colour image of the scan, if the file names none")
    parser.add_argument("--normal-map", metavar="IMAGE", help="tangent-space normal map of the scan (+Y up)")
    parser.add_argument("--units", choices=tuple(MM_PER_UNIT), help="unit of the scan (default: found)")
    parser.add_argument("--up", choices=UPS, help="up axis of the scan (default: found)")
    parser.add_argument("--mirror", action="store_true", help="the scan is a mirror image: turn it round")
    parser.add_argument("--landmarks", metavar="FILE", help="JSON with landmarks placed by hand (docs/input.md)")
    add_job_arguments(parser)


def run(options):
    """Run the job and say where to look."""
    run_job(options.scan, options)


def run_job(scan, options):
    """Run the job on a scan with parsed options, show its progress, print what it found."""
    from facewright.pipeline import JobOptions, rig_job

    fields = {name: getattr(options, name) for name in JobOptions.__dataclass_fields__ if hasattr(options, name)}
    earlier = [path for path in _made(options.out).values() if path.exists()]
    with ProgressLine(options.quiet) as progress:
        report = rig_job(scan, options.out, JobOptions(**fields), progress)
    summarise(report, options.out)
    gone = [str(path) for path in earlier if not path.exists()]
    if gone:
        print(f"note: {' and '.join(gone)} of an earlier run was removed; --formats glb,obj writes both")


def _made(out):
    """dict format -> path of what it writes into the folder."""
    return {"glb": Path(out, "rig.glb"), "obj": Path(out, "obj")}


def summarise(report, out):
    """A few lines for the eye; the rest is in report.json."""
    fit = report["registration"]["scan_to_face_mm"]
    seconds = sum(time for stage, time in report["timings_s"].items() if not report["reused"][stage])
    if fit["mean"] is not None:
        print(f"scan to face: mean {fit['mean']:.2f} mm, p95 {fit['p95']:.2f} mm; {seconds:.0f} s")
    for warning in report["warnings"]:
        print(f"note: {warning}")
    files = " and ".join(str(_made(out)[name]) for name in report["options"]["formats"])
    print(f"look at {Path(out, 'preview.png')}; the rig is {files}")


def _texture_size(text):
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 64 or value > 8192:
        raise argparse.ArgumentTypeError(f"{text}: give a number of pixels from 64 to 8192")
    return value


def _jobs(text):
    if not text.isdigit() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"{text}: give a number of threads from 1 to 256")
    return int(text)


def _formats(text):
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    unknown = [name for name in names if name not in ("glb", "obj")]
    if unknown or not names:
        raise argparse.ArgumentTypeError(f"{text}: formats are glb and obj, comma-separated")
    return names
