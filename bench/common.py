"""What the benchmarks share: data beside the project, painted masks, tables."""

from __future__ import annotations

import json
import resource
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib.path import Path as Polygon

from facewright.mesh.normals import face_normals
from facewright.mesh.raster import Camera, RayScene

ROOT = Path(__file__).resolve().parents[1]
SCANS = ROOT.parent / "shared" / "data" / "scans"
DATA = ROOT / "bench" / "data"
CACHE = ROOT / "bench" / "cache"
EXTERNAL_TEMPLATES = ROOT.parent / "templates"


def camera_of(view):
    """The orthographic camera of a view of a JSON file, in millimetres of the scan file's own axes."""
    height, width = view["size"]
    half_height = height * view["mm_per_px"] / 2
    return Camera.looking_at(view["center"], view.get("yaw", 0), view.get("pitch", 0), half_height, (height, width))


def file_vertices(scan):
    """Vertices as the scan's file has them: (n, 3) in file units."""
    T = scan.T_ours_to_scan
    return scan.vertices @ T[:3, :3].T + T[:3, 3]


def painted_mask(vertices, faces, painting):
    """(m,) bool: face centres seen, not glancingly, in an include polygon and in no exclude polygon.

    vertices (n, 3) in the file's units; painting as in data/menpo-james.skin.json
    """
    vertices = vertices * painting["mm_per_unit"]
    centers, normals = vertices[faces].mean(axis=1), face_normals(vertices, faces)
    scene = RayScene(vertices, faces)
    result = np.zeros(len(faces), bool)
    for kind, depth_mm, cosine in (("include", 2.0, 0.12), ("exclude", 6.0, -1.0)):
        for name, polygon in painting[kind]:
            camera = camera_of(painting["views"][name])
            pixels, _ = camera.project(centers)
            inside = np.flatnonzero(Polygon(polygon).contains_points(pixels) & (normals @ camera.R[2] > cosine))
            direction = np.broadcast_to(-camera.R[2], (len(inside), 3))
            hits = scene.cast(centers[inside] + 500.0 * camera.R[2], direction)
            result[inside[np.abs(hits.distance - 500.0) < depth_mm]] = kind == "include"
    return result


def read_json(name):
    """A file of bench/data."""
    return json.loads((DATA / name).read_text())


def print_table(title, header, rows):
    """A plain text table; numbers with two decimals, None as a dash."""
    cells = [[_cell(value) for value in row] for row in rows]
    widths = [max(len(row[i]) for row in (tuple(map(str, header)), *cells)) for i in range(len(header))]
    print(f"\n{title}")
    for row in [[str(head) for head in header], *cells]:
        print(
            "  ".join(
                text.ljust(width) if i == 0 else text.rjust(width) for i, (text, width) in enumerate(zip(row, widths))
            )
        )
    sys.stdout.flush()


def _cell(value):
    if value is None:
        return "-"
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "NO"
    if isinstance(value, (int, np.integer)):
        return str(value)
    if isinstance(value, (float, np.floating)):
        return f"{value:.3f}"
    return str(value)


class Verdict:
    """Collects figures against bars and says at the end how many are met."""

    def __init__(self):
        self.rows = []

    def check(self, where, what, value, bar):
        """value <= bar, kept for the table; a missing value counts as missed."""
        met = value is not None and np.isfinite(value) and value <= bar
        self.rows.append((where, what, value, bar, bool(met)))

    def print(self, title="Against the bars"):
        print_table(title, ("where", "figure", "measured", "bar", "met"), self.rows)
        print(f"{sum(row[-1] for row in self.rows)} of {len(self.rows)} met")

    @property
    def all_met(self):
        return all(row[-1] for row in self.rows)


@contextmanager
def timed(store, name):
    """Add the seconds of a block to store[name]."""
    start = time.perf_counter()
    yield
    store[name] = store.get(name, 0.0) + time.perf_counter() - start


def peak_memory_mb():
    """Peak resident memory of this process, MB (Linux counts kilobytes, macOS bytes)."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3
