"""Draw the pictures of docs/shapes.md: python docs/draw_shapes.py [--templates hm08 ict] [--out DIR].

Every shape and pair of the templates beside each other, each on its own head, then the 26 expressions and the 15
visemes on the first. A rig is played with in-betweens and correctives.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from render import jpeg_bytes

from facewright.errors import InputError
from facewright.mesh.raster import Camera
from facewright.rigging import template_rig
from facewright.template.store import read_template
from facewright.write.close_ups import close_up_cameras, close_up_poses
from facewright.write.files import replace_file
from facewright.write.puppet import Puppet
from facewright.write.sheet import Cell, Section, compose_sheet

NAMES = ("eyes", "cheeks", "mouth")
IN_A_ROW = 2  # shapes, each with a picture per template
FACE, FACE_COLUMNS = (232, 196), 7


def own_rig(name):
    """The Rig of a template's own head, or None where the template is not here."""
    try:
        return template_rig(read_template(name))
    except InputError:
        return None


def beside_each_other(rigs, where):
    """A sheet of one part of the face: each shape, the templates' pictures next to each other. rigs: name -> Rig"""
    puppets = {name: Puppet(rig) for name, rig in rigs.items()}
    poses = {name: close_up_poses(rig)[where] for name, rig in rigs.items()}
    cells = []
    for label in dict.fromkeys(label for found in poses.values() for label in found):
        for name, rig in rigs.items():
            camera = close_up_cameras(rig)[where]
            picture = puppets[name].picture(poses[name].get(label, {}), camera)
            cells.append(Cell(picture, f"{label} ({name})" if label in poses[name] else f"{name} has none"))
    columns = IN_A_ROW * len(rigs)
    rows = tuple(tuple(cells[i : i + columns]) for i in range(0, len(cells), columns))
    return compose_sheet(f"{NAMES[where]}", "weight 1, with in-betweens and correctives", [Section("", rows)])


def whole_faces(rig, poses, title):
    """A sheet of the whole face in named poses."""
    puppet = Puppet(rig)
    eyes, _, mouth = (camera.center for camera in close_up_cameras(rig))
    camera = Camera.looking_at(0.5 * (eyes + mouth) + [0.0, 3.0, 0.0], 12.0, 0.0, 88.0, FACE)
    cells = []
    for label, weights in poses.items():
        cells.append(Cell(puppet.picture(weights, camera), label))
    rows = tuple(tuple(cells[i : i + FACE_COLUMNS]) for i in range(0, len(cells), FACE_COLUMNS))
    return compose_sheet(title, "", [Section("", rows)])


def numbered(poses):
    """The poses under their numbers: names of expressions are longer than their pictures are wide."""
    return {str(number): weights for number, weights in enumerate(poses.values(), 1)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--templates", nargs="*", default=["hm08", "ict"])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images")
    options = parser.parse_args()
    found = {name: own_rig(name) for name in options.templates}
    rigs = {name: rig for name, rig in found.items() if rig is not None}
    for name in set(found) - set(rigs):
        print(f"template {name} is not here: left out")
    sheets = {f"shapes-{NAMES[where]}": partial(beside_each_other, rigs, where) for where in range(len(NAMES))}
    first = next(iter(rigs.values()))
    sheets["expressions"] = partial(whole_faces, first, numbered(first.expressions), "26 expressions")
    visemes = {name.removeprefix("viseme_"): weights for name, weights in first.visemes.items()}
    sheets["visemes"] = partial(whole_faces, first, visemes, "15 visemes")
    for name, draw in sheets.items():
        content = jpeg_bytes(draw())
        replace_file(options.out / f"{name}.jpg", content)
        print(f"{options.out / name}.jpg  {len(content) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
