"""Baking and preview: seconds, peak memory and how true the maps are, on a scan whose colours and normals are known.

    python bench/bake.py [--template hm08|FOLDER] [--size 2048] [--jobs 2]

The scan is the template's own outer skin, subdivided twice (no relation to its UVs), with a hole in one cheek and one
across the back of the head; its colour is a function of place, the same on both sides.
"""

from __future__ import annotations

import argparse
import time

import igl
import numpy as np
from common import peak_memory_mb, print_table

from facewright.bake import BakeOptions, bake, describe_maps
from facewright.bake.maps import FILLED, SEEN
from facewright.bake.texels import at_points, build_texels
from facewright.data import Face, Scan
from facewright.template.store import read_template

CHEEK, CHEEK_MM = np.array([48.0, -42.0, -5.0]), 22.0
BACK_Z_MM = -130.0


def color_at(points):
    """(k, 3) sRGB 0..1 of places (k, 3) mm: skin-like hues with waves of 20 to 100 mm."""
    x, y, z = np.abs(points[:, 0]) / 16, points[:, 1] / 12, points[:, 2] / 20
    return np.stack([0.72 + 0.12 * np.sin(y), 0.52 + 0.1 * np.cos(x), 0.44 + 0.08 * np.sin(z + x)], axis=1)


def make_scan(template):
    """The outer skin as a scan with vertex colours and two holes."""
    skin = template.skin
    faces = template.faces[skin.face_slice]
    faces = faces[template.regions["outer"][faces].all(axis=1)]
    vertices, faces = igl.upsample(template.vertices[skin.vertex_slice].copy(), faces.copy(), 2)
    centers = vertices[faces].mean(axis=1)
    keep = (np.linalg.norm(centers - CHEEK, axis=1) > CHEEK_MM) & (centers[:, 2] > BACK_Z_MM)
    used, faces = np.unique(faces[keep], return_inverse=True)
    return Scan(vertices[used], faces.reshape(-1, 3), colors=color_at(vertices[used]))


def make_face(template):
    """The template itself as a Face."""
    seen = np.ones(len(template.vertices), bool)
    closed = {"left": False, "right": False}
    return Face(template, template.vertices, template.vertices, template.regions, template.lines, seen, {}, closed, {})


def measure_colors(template, maps, size):
    """Rows (what, share of texels, mean error, 99th percentile) in units of 1/255."""
    skin = template.skin
    faces = template.faces[skin.face_slice]
    texels = build_texels(template.uv, template.uv_faces[skin.face_slice], size)
    points = at_points(template.vertices, faces, texels.face, texels.barycentric).astype(float)
    error = np.abs(maps["albedo"].reshape(-1, 3)[texels.index] - 255 * color_at(points)).mean(axis=1)
    coverage = maps["coverage"].ravel()[texels.index]
    rows = []
    cheek = np.linalg.norm(points - CHEEK, axis=1) < CHEEK_MM
    for what, chosen in (
        ("seen", coverage == SEEN),
        ("cheek, from the other side", cheek & (coverage == FILLED)),
        ("all that is filled", coverage == FILLED),
    ):
        if chosen.any():
            rows.append(
                (what, float(chosen.mean()), float(error[chosen].mean()), float(np.percentile(error[chosen], 99)))
            )
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--template", default="hm08")
    parser.add_argument("--size", type=int, default=2048)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    template = read_template(options.template)
    scan, face = make_scan(template), make_face(template)
    before = peak_memory_mb()
    start, cpu = time.perf_counter(), time.process_time()
    maps = bake(scan, face, BakeOptions(size=options.size), options.jobs)
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    cost = (options.size, options.jobs, seconds, cpu, peak_memory_mb(), peak_memory_mb() - before)
    print_table("Cost", ("size", "jobs", "seconds", "CPU seconds", "peak MB", "MB over the start"), [cost])
    print_table(
        "Colours against the truth, of 255",
        ("texels", "share", "mean", "p99"),
        measure_colors(template, maps, options.size),
    )
    print_table("Maps", ("figure", "value"), list(describe_maps(face, maps).items()))


if __name__ == "__main__":
    main()
