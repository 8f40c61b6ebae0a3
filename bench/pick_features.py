"""Pick features of a scan by hand: close-ups with a grid, and pixels lifted to points of the scan file.

    python bench/pick_features.py views SCAN.obj VIEWS.json --out FOLDER      pictures to look at
    python bench/pick_features.py lift SCAN.obj VIEWS.json --out FEATURES.json

VIEWS.json: {"scan": name, "mm_per_unit": 53.5, "pickings": [{"name": "first", "views": {VIEW: {"center": [x, y, z] mm,
"yaw": degrees, "pitch": degrees, "size": [height, width] px, "mm_per_px": 0.1, "textured": true}}, "points": {FEATURE:
[VIEW, x, y]}, "curves": {CURVE: [VIEW, [[x, y], ...]]}}]}. FEATURES.json has the same points as (x, y, z) in the scan
file's own units. Right and left are the person's.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from common import camera_of, file_vertices
from PIL import Image, ImageDraw

from facewright.mesh.closest import interpolate
from facewright.mesh.raster import RayScene
from facewright.mesh.render import render
from facewright.read import read_scan

GRID_PX = 50


def draw_grid(image):
    """The picture with a line every 50 px and its coordinate on the rim."""
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture, "RGBA")
    for x in range(0, picture.width, GRID_PX):
        draw.line([(x, 0), (x, picture.height)], fill=(255, 255, 255, 90 if x % 100 == 0 else 40))
        draw.text((x + 2, 2), str(x), fill=(255, 255, 0, 255))
    for y in range(0, picture.height, GRID_PX):
        draw.line([(0, y), (picture.width, y)], fill=(255, 255, 255, 90 if y % 100 == 0 else 40))
        draw.text((2, y + 2), str(y), fill=(255, 255, 0, 255))
    return picture


def draw_marks(picture, picking, name):
    """Red crosses and lines where this picking has put its points in the named view."""
    draw = ImageDraw.Draw(picture)
    for view, x, y in picking.get("points", {}).values():
        if view == name:
            draw.line([(x - 4, y), (x + 4, y)], fill=(255, 0, 0))
            draw.line([(x, y - 4), (x, y + 4)], fill=(255, 0, 0))
    for view, points in picking.get("curves", {}).values():
        if view == name:
            draw.line([tuple(point) for point in points], fill=(0, 255, 0))
    return picture


def write_views(scan, spec, folder, marks):
    """One PNG per view: textured or clay, with grid and, if asked, with the points picked so far."""
    folder.mkdir(parents=True, exist_ok=True)
    vertices = file_vertices(scan) * spec["mm_per_unit"]
    for picking in spec["pickings"]:
        for name, view in picking["views"].items():
            looks = {}
            if view.get("textured") and scan.has_texture:
                looks = {"texture": scan.textures[0], "uv": scan.uv, "uv_faces": scan.uv_faces}
            picture = draw_grid(render(vertices, scan.faces, camera_of(view), **looks))
            if marks:
                picture = draw_marks(picture, picking, name)
            picture.save(folder / f"{picking['name']}-{name}.png")


def lift(vertices, faces, view, pixels):
    """(k, 3) surface points under pixels (k, 2) of a view; vertices in mm.

    A ray that falls through a slit between the lips takes the mean of what lies 0.3 mm above and below it instead.
    """
    camera, scale = camera_of(view), view["mm_per_px"]
    pixels = np.asarray(pixels, float).reshape(-1, 2)
    scene = RayScene(vertices, faces)
    points, depths = [], []
    for shift in (0.0, -0.3, 0.3):
        x = (pixels[:, 0] - camera.size[1] / 2) * scale
        y = -(pixels[:, 1] - camera.size[0] / 2) * scale + shift
        origins = camera.center + x[:, None] * camera.R[0] + y[:, None] * camera.R[1] + 1000.0 * camera.R[2]
        hits = scene.cast(origins, np.broadcast_to(-camera.R[2], origins.shape))
        if shift == 0.0 and (hits.face < 0).any():
            raise SystemExit(f"pixel {pixels[hits.face < 0][0].tolist()} is off the scan")
        points.append(interpolate(vertices, faces, np.maximum(hits.face, 0), hits.barycentric))
        depths.append(hits.distance)
    beside = np.maximum(depths[1], depths[2])
    slit = np.isfinite(beside) & (depths[0] > beside + 3.0)
    return np.where(slit[:, None], (points[1] + points[2]) / 2, points[0])


def lift_all(scan, spec):
    """The features as data: every point and curve of every picking in file units."""
    scale = spec["mm_per_unit"]
    vertices = file_vertices(scan) * scale
    result = {"scan": spec["scan"], "unit": "the scan file's own", "mm_per_unit": scale, "pickings": []}
    for picking in spec["pickings"]:
        points, curves = {}, {}
        for name, (view, x, y) in picking["points"].items():
            points[name] = np.round(lift(vertices, scan.faces, picking["views"][view], [[x, y]])[0] / scale, 6).tolist()
        for name, (view, pixels) in picking.get("curves", {}).items():
            lifted = lift(vertices, scan.faces, picking["views"][view], pixels)
            curves[name] = np.round(lifted / scale, 6).tolist()
        result["pickings"].append({"name": picking["name"], "points": points, "curves": curves})
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["views", "lift"])
    parser.add_argument("scan", type=Path)
    parser.add_argument("views", type=Path)
    parser.add_argument("--albedo", type=Path, help="texture, where the file names none")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--marks", action="store_true", help="draw the points picked so far")
    options = parser.parse_args()
    spec = json.loads(options.views.read_text())
    scan = read_scan(options.scan, albedo=options.albedo)
    if options.command == "views":
        write_views(scan, spec, options.out, options.marks)
    else:
        options.out.write_text(json.dumps(lift_all(scan, spec), indent=1) + "\n")


if __name__ == "__main__":
    main()
