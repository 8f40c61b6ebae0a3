"""Iris colour and place of the rig of the embedded sample against the truth it was painted with.

    python bench/iris.py [RESULT]

RESULT is a folder that `facewright demo` wrote; without it the job is run.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from common import print_table

from facewright.evaluate.iris import CENTER_BAR_MM, COLOR_BAR, color_difference, measure_irises
from facewright.evaluate.rig import rig_frame
from facewright.mesh.render import srgb_to_linear
from facewright.pipeline import JobOptions, rig_job
from facewright.sample import sample_path, truth_path
from facewright.sample.make import COMPLEXION
from facewright.solve.procrustes import best_similarity
from facewright.template.store import read_template
from facewright.transfer.eyeball import measure_eyeball
from facewright.write.rig import read_rig


def rows(result):
    """[side, figure, value, bar] of a result of the sample."""
    rig, template = read_rig(result / "rig"), read_template("hm08")
    T = rig_frame(rig)
    truth = np.load(truth_path())["vertices"] @ T[:3, :3].T + T[:3, 3]
    color = srgb_to_linear(np.array(COMPLEXION.iris))
    found = []
    for side, iris in measure_irises(rig).items():
        off = float(np.linalg.norm(true_center(template, truth, side) - iris["center_mm"]))
        found.append([side, "colour, CIEDE2000", round(color_difference(iris["color"], color), 2), COLOR_BAR])
        found.append([side, "centre off, mm", round(off, 2), CENTER_BAR_MM])
    return found


def true_center(template, truth, side):
    """(2,) where the iris of a head (n, 3) is seen from the front: its eye is the template's, turned with the head."""
    ball, at = measure_eyeball(template, side), template.part(f"eye_{side}").vertex_slice
    eye = template.vertices[at]
    R, scale, t = best_similarity(eye, truth[at], np.ones(len(eye)))
    return (scale * R @ (ball.center + ball.radius * ball.axis) + t)[:2]


def show(result):
    """Print the table of a result."""
    print_table("iris of the embedded sample", ["eye", "figure", "value", "bar"], rows(result))


def main():
    if len(sys.argv) > 1:
        show(Path(sys.argv[1]))
        return
    with tempfile.TemporaryDirectory() as folder:
        rig_job(sample_path(), folder, JobOptions(texture_size=512))
        show(Path(folder))


if __name__ == "__main__":
    main()
