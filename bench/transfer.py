"""Deformation transfer: seconds for all 52 shapes, exactness, and what closes on people when it closes on the template.

    python bench/transfer.py [--template hm08|FOLDER ...] [--persons 6] [--repeat 5]

Without --template: hm08, and the ICT template if one lies beside the project. Persons are drawn from the template's
identity modes, half a standard deviation each.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from common import EXTERNAL_TEMPLATES, Verdict, peak_memory_mb, print_table

from facewright.conventions import mirrored_name
from facewright.data import Face
from facewright.parts import fit_parts
from facewright.solve.procrustes import best_rotation
from facewright.template.store import DESCRIPTION, read_template
from facewright.transfer import DeformationTransfer, TransferOptions, transfer_shapes

SECONDS_BAR, EXACT_BAR = 1.2, 1e-8
MIRROR = np.array([-1.0, 1.0, 1.0])
TURNED = {"jawLeft": "jawRight", "jawRight": "jawLeft", "mouthLeft": "mouthRight", "mouthRight": "mouthLeft"}


def person(template, seed):
    """A Face of the template's identity space with its parts in place; seed 0 is the template itself, untouched."""
    weights = np.random.default_rng(seed).standard_normal(len(template.identity_basis)) * (0.5 if seed else 0.0)
    vertices = template.vertices + np.tensordot(weights, template.identity_basis, 1)
    seen, closed = np.ones(len(vertices), bool), {"left": False, "right": False}
    face = Face(template, vertices, vertices, template.regions, template.lines, seen, {}, closed, {})
    return fit_parts(face) if seed else face


def best_seconds(function, repeat):
    """Seconds on the wall and of all cores together, each of the fastest of several calls."""
    wall, cores = [], []
    for _ in range(repeat):
        start, busy = time.perf_counter(), time.process_time()
        function()
        wall.append(time.perf_counter() - start)
        cores.append(time.process_time() - busy)
    return min(wall), min(cores)


def time_transfer(template, repeat):
    """Rows (what, vertices, set-up, shapes, both, both on all cores): the head as one system; skin and parts apart."""
    face = person(template, 1)
    fixed = template.regions["skull"].copy()
    fixed |= ~template.deltas.any(axis=(0, 2))

    def set_up():
        return DeformationTransfer(template.vertices, face.vertices, template.faces, fixed=fixed)

    ready = set_up()
    first, _ = best_seconds(set_up, repeat)
    second, _ = best_seconds(lambda: ready.transfer(template.deltas), repeat)
    whole = best_seconds(lambda: set_up().transfer(template.deltas), repeat)
    parts = best_seconds(lambda: transfer_shapes(face), repeat)
    n = len(template.vertices)
    return [("one system", n, first, second, *whole), ("skin, bones, rest", n, None, None, *parts)]


def measure_exactness(template):
    """name -> largest deviation in mm."""
    face = person(template, 2)
    shapes = transfer_shapes(face)
    points = np.random.default_rng(1).normal(size=(2, 5, 3))
    R, shift = best_rotation(points[0], points[1]), np.array([30.0, -500.0, 80.0])
    moved = transfer_shapes(replace(face, vertices=face.vertices @ R.T + shift))
    skin = template.skin.vertices[1]
    system = {"faces": template.faces[template.skin.face_slice], "fixed": template.regions["skull"][:skin]}
    source, target, deltas = template.vertices[:skin], face.vertices[:skin], template.deltas[:, :skin]
    own = DeformationTransfer(source, target, **system).transfer(deltas)
    turned = DeformationTransfer(source @ R.T + shift, target, **system).transfer(deltas @ R.T)
    # What rides on the lids is made anew from the skin, whose stored deltas are rounded.
    riding = np.zeros(len(template.vertices), bool)
    for part in template.parts:
        riding[part.vertex_slice] = part.attach.startswith("lid_")
    off = np.abs(transfer_shapes(person(template, 0)) - template.deltas)
    result = {
        "onto itself": off[:, ~riding].max(),
        "rigid motion of the target": np.abs(moved - shapes @ R.T).max(),
        "rigid motion of the source": np.abs(turned - own).max(),
    }
    other = [template.shape_names.index(TURNED.get(name, mirrored_name(name))) for name in template.shape_names]
    if np.abs(template.deltas[other][:, template.mirror] * MIRROR - template.deltas).max() < 1e-9:
        mirrored = transfer_shapes(replace(face, vertices=face.vertices[template.mirror] * MIRROR))
        result["mirrored head"] = np.abs(mirrored - shapes[other][:, template.mirror] * MIRROR).max()
    return {name: float(value) for name, value in result.items()}


def gap(template, vertices, shapes, names, upper, lower):
    """Largest distance in mm between paired points of two lines under a sum of shapes."""
    moved = vertices + sum(shapes[template.shape_names.index(name)] for name in names)
    at = np.round(np.linspace(0, len(template.lines[lower]) - 1, len(template.lines[upper]))).astype(int)
    apart = moved[template.lines[upper]] - moved[template.lines[lower][at]]
    return float(np.linalg.norm(apart, axis=1).max())


def measure_closing(template, persons):
    """Rows (head, lips mm, blink as a share of the open eye) with links, and lips and blink without."""

    def row(vertices, shapes):
        lips = gap(template, vertices, shapes, ("jawOpen", "mouthClose"), "lip_seam_upper", "lip_seam_lower")
        lids = ("lid_upper_left", "lid_lower_left")
        opened = gap(template, vertices, shapes * 0, ("eyeBlinkLeft",), *lids)
        return lips, gap(template, vertices, shapes, ("eyeBlinkLeft",), *lids) / opened

    rows = [("template", *row(template.vertices, template.deltas), None, None)]
    for seed in range(1, persons + 1):
        face = person(template, seed)
        linked = row(face.vertices, transfer_shapes(face))
        plain = row(face.vertices, transfer_shapes(face, TransferOptions(w_lids=0.0, w_lips=0.0)))
        rows.append((f"person {seed}", *linked, *plain))
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--template", nargs="*", default=None)
    parser.add_argument("--persons", type=int, default=6)
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    names = options.template or ["hm08"]
    beside = EXTERNAL_TEMPLATES / "ict"
    if options.template is None and (beside / DESCRIPTION).is_file():
        names.append(str(beside))
    verdict = Verdict()
    for name in names:
        template = read_template(name)
        title = f"{template.info['name']}: {len(template.shape_names)} shapes"
        rows = time_transfer(template, options.repeat)
        print_table(f"{title}, seconds", ("system", "vertices", "set-up", "shapes", "both", "core seconds"), rows)
        verdict.check(template.info["name"], "seconds, set-up included", max(row[-2] for row in rows), SECONDS_BAR)
        for what, value in measure_exactness(template).items():
            verdict.check(template.info["name"], f"{what}, 1e-12 mm", value * 1e12, EXACT_BAR * 1e12)
        header = ("head", "lips mm", "blink", "lips mm, no links", "blink, no links")
        print_table(f"{title}, what stays open", header, measure_closing(template, options.persons))
    verdict.print()
    print(f"peak memory {peak_memory_mb():.0f} MB")


if __name__ == "__main__":
    main()
