"""Close-ups of eyes and mouth for every shape and for the pairs, half way and whole: where rigs fail first."""

from __future__ import annotations

import numpy as np

from facewright.conventions import EYE_PAIRS, MOUTH_PAIRS, SMILING_EYES, TONGUE_PAIR
from facewright.evaluate.play import both_sides
from facewright.evaluate.shapes import shape_names, with_base
from facewright.mesh.raster import Camera
from facewright.write.sheet import Cell, Section

WEIGHTS = (0.5, 1.0)
SIZE = (152, 292)  # (height, width) in pixels
COLUMNS = 6
_UPPER, _MIDDLE = ("eye", "brow"), ("cheekSquint", "noseSneer")  # what is looked at; the rest is the mouth's


def close_up_poses(rig):
    """Three dicts label -> weights, for the eyes, the middle of the face and the mouth: every shape of a rig, both
    sides of one together, and the pairs."""
    names = shape_names(rig)
    one_name = dict.fromkeys(_without_side(name, names) for name in names)
    poses = {name: with_base(name, names) for name in one_name}
    pairs = (*EYE_PAIRS, SMILING_EYES, *MOUTH_PAIRS, TONGUE_PAIR)
    poses |= {" + ".join(pair): dict.fromkeys(pair, 1.0) for pair in pairs}
    poses = {label: both_sides(weights, names) for label, weights in poses.items()}
    sorted_out = {}, {}, {}
    for label, weights in poses.items():
        if weights is not None:
            where = 0 if label.startswith(_UPPER) else 1 if label.startswith(_MIDDLE) else 2
            sorted_out[where][label] = weights
    return sorted_out


def close_up_sections(rig, puppet):
    """Sections of a contact sheet; played with in-betweens and correctives where the rig has them.

    puppet  the rig's puppet.Puppet
    """
    titles = ("Eyes and brows", "Cheeks and nose", "Mouth and jaw")
    note = "both sides together; pairs last"
    if rig.in_betweens or rig.correctives:
        note += "; played with in-betweens and pair correctives, which the plain 52 shapes lack (--shapes full)"
    sections = []
    for title, camera, poses in zip(titles, close_up_cameras(rig), close_up_poses(rig)):
        jobs = [(label, weights, share) for label, weights in poses.items() for share in WEIGHTS]

        def cell(job, camera=camera):
            label, weights, share = job
            image = puppet.picture({name: share * weight for name, weight in weights.items()}, camera)
            return Cell(image, label if share == 1.0 else f"{label}, {share:g}")

        cells = [cell(job) for job in jobs]
        rows = tuple(tuple(cells[i : i + COLUMNS]) for i in range(0, len(cells), COLUMNS))
        if rows:
            sections.append(Section(f"{title}, half way and whole", rows, note))
    return sections


def _without_side(name, names):
    """mouthSmileLeft and mouthSmileRight -> mouthSmile, where the rig has both; jawLeft stays."""
    for side, other in (("Left", "Right"), ("Right", "Left")):
        stem = name.removesuffix(side)
        if stem != name and stem + other in names and stem not in ("jaw", "mouth"):
            return stem
    return name


def close_up_cameras(rig):
    """Cameras on the eyes with the brows, on the middle of the face, and on the mouth with the chin."""
    vertices = rig.meshes[0].vertices
    middles = []
    for prefix, otherwise in (("lid_", (0.0, 2.0, 0.0)), ("lip_", (0.0, -65.0, 0.0))):
        lines = [line for name, line in rig.lines.items() if name.startswith(prefix)]
        middles.append(vertices[np.concatenate(lines)].mean(axis=0) if lines else np.array(otherwise))
    eyes, mouth = middles
    frames = ((eyes + [0.0, 8.0, 0.0], 27.0), (0.5 * (eyes + mouth), 46.0), (mouth + [0.0, -9.0, 0.0], 36.0))
    return [Camera.looking_at(center, 0.0, 0.0, half_height, SIZE) for center, half_height in frames]
