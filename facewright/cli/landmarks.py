"""Find the landmarks of a scan and write them to a small JSON that can be edited and given back to `facewright rig`.

The picture beside it shows each point with its name. Delete the points that are right, move those that are not: what is
left in the file is obeyed, the rest is found again.

  facewright landmarks head.obj --out points.json
  facewright rig head.obj --landmarks points.json --out result/
"""

from __future__ import annotations

from pathlib import Path

from facewright.cli.rig import UPS
from facewright.conventions import MM_PER_UNIT

HELP = "write a scan's landmarks, to be moved by hand"


def add_arguments(parser):
    """Arguments of `facewright landmarks`."""
    parser.add_argument("scan", help="the head scan: .obj, .ply, .glb or .gltf")
    parser.add_argument("--out", required=True, metavar="FILE", help="JSON to write; a PNG of the same name beside it")
    parser.add_argument("--albedo", metavar="IMAGE", help="colour image of the scan, if the file names none")
    parser.add_argument("--units", choices=tuple(MM_PER_UNIT), help="unit of the scan (default: found)")
    parser.add_argument("--up", choices=UPS, help="up axis of the scan (default: found)")
    parser.add_argument("--mirror", action="store_true", help="the scan is a mirror image: turn it round")
    parser.add_argument("--all", action="store_true", help="all 478 points (mp0..mp477), not only the named ones")


def run(options):
    """Find, write, draw."""
    from facewright.errors import InputError
    from facewright.read import read_scan
    from facewright.scan import LandmarkOptions, clean_scan, find_landmarks, write_landmarks
    from facewright.scan.landmark_files import NAMED
    from facewright.write.landmarks import draw_landmarks

    out = Path(options.out)
    picture = out.with_suffix(".png")
    if out == picture or out.is_dir():
        raise InputError(f"{out}: points are written as JSON with a picture beside it; give --out a name like p.json")
    if picture.exists() and not out.exists():  # head.json beside the scan's own head.png
        raise InputError(f"{picture}: is there already and would be overwritten; give --out another name")
    scan, _ = clean_scan(read_scan(options.scan, albedo=options.albedo, unit=options.units))
    found = find_landmarks(scan, LandmarkOptions(options.up, options.units, options.mirror))
    names = None if options.all else {f"mp{number}": name for name, number in NAMED.items()}
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_landmarks(out, found.landmarks, found.scan, names=names)
        draw_landmarks(picture, found.scan, found.landmarks, names)
    except OSError as error:
        raise InputError(
            f"{error.filename or out}: cannot be written ({error.strerror}); choose another --out"
        ) from error
    for warning in found.warnings:
        print(f"note: {warning}")
    print(f"{out}: {'all' if options.all else len(names)} points; look at {picture}")
