"""Eyes of made heads without colours: are they read as open or shut, and how far off in height are their lids.

    python bench/clay_eyes.py [--templates hm08 ict] [--seeds 0 1 2] [--faces 3000] [--noise 0.3]

Every head is made in one template and fitted with the others, with eyes open and shut. It can be decimated and noisy.
"""

from __future__ import annotations

import argparse

import igl
import numpy as np
from cases import SEEDS, find_benchmark_template, person
from common import Verdict, print_table
from variants import manifold

from facewright.data import Scan
from facewright.evaluate.distances import benchmark_scale, interpupillary_mm
from facewright.evaluate.synthetic import SyntheticOptions, synthetic_scan
from facewright.mesh.normals import vertex_normals
from facewright.register import register
from facewright.register.pairs import eyes_closed, landmark_pairs
from facewright.scan import clean_scan, find_landmarks

HEADER = ("scan", "fitted with", "shut", "landmarks say", "read as shut", "lids off in height")
OPENING = {False: 0.0, True: 1.0}
HEIGHT_BAR_MM = 1.0


def clay_head(template, seed, shut, faces=None, noise_mm=0.0):
    """(Scan, truth (n, 3)) of a test person without colours, decimated to so many faces, with noise added."""
    vertices = person(template, seed)
    vertices = vertices + OPENING[shut] * (template.shape("eyeBlinkLeft") + template.shape("eyeBlinkRight"))
    options = SyntheticOptions(open_back=seed % 3 == 2, colored=False)
    scan, truth = synthetic_scan(template, vertices, seed, options)
    V, F = scan.vertices, scan.faces
    if faces:
        V, F = manifold(V, F)
        V, F, _, _ = igl.qslim(np.asfortranarray(V), np.asfortranarray(F, dtype=np.int32), faces)
        V, F = np.asarray(V), np.asarray(F, np.int64)
    noise = np.random.default_rng(seed).normal(0.0, noise_mm, len(V))
    return Scan(V + noise[:, None] * vertex_normals(V, F), F, unit_mm=1.0, name=scan.name), truth["vertices"]


def height_off(fit, template, truth, made_in):
    """Mean distance in height of the fit's four lid lines from the true ones, over the middle of each."""
    off = []
    for name in (f"lid_{which}_{side}" for which in ("upper", "lower") for side in ("left", "right")):
        line, true = (v[t.lines[name]] for v, t in ((fit, template), (truth, made_in)))
        line, true = (points[np.argsort(points[:, 0])] for points in (line, true))
        x = np.linspace(*np.quantile(true[[0, -1], 0], (0.2, 0.8)), 25)
        off.append(np.abs(np.interp(x, *line[:, :2].T) - np.interp(x, *true[:, :2].T)).mean())
    return float(np.mean(off))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--templates", nargs="+", default=["hm08", "ict"])
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--faces", type=int, help="decimate the scans to so many triangles")
    parser.add_argument("--noise", type=float, default=0.0, help="more noise, mm")
    options = parser.parse_args()
    templates = {name: find_benchmark_template(name) for name in options.templates}
    templates = {name: template for name, template in templates.items() if template is not None}
    verdict, rows = Verdict(), []
    for made_in in templates.values():
        for seed in options.seeds:
            for shut in OPENING:
                scan, truth = clay_head(made_in, seed, shut, options.faces, options.noise)
                found = find_landmarks(clean_scan(scan)[0])
                to_ours = np.linalg.inv(found.scan.T_ours_to_scan)
                truth = truth @ to_ours[:3, :3].T + to_ours[:3, 3]
                for name, template in templates.items():
                    if template is made_in and len(templates) > 1:
                        continue
                    said = eyes_closed(landmark_pairs(found.scan, found.landmarks, template, ()))
                    face = register(found.scan, found.landmarks, template)
                    scale = benchmark_scale(interpupillary_mm(truth, made_in))
                    off = height_off(face.fit, template, truth, made_in) * scale
                    wrong = sum(closed != shut for closed in face.eyes_closed.values())
                    both = (sum(said.values()), sum(face.eyes_closed.values()))
                    rows.append((scan.name, name, shut, *(f"{count} of 2" for count in both), off))
                    verdict.check(f"{scan.name}, {'shut' if shut else 'open'}", "eyes read wrong", wrong, 0)
                    if not shut:
                        verdict.check(f"{scan.name}, open", "lids off in height", off, HEIGHT_BAR_MM)
    print_table("Eyes in clay, mm at 63 mm between the pupils", HEADER, rows)
    verdict.print()


if __name__ == "__main__":
    main()
