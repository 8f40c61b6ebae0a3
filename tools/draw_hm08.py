"""Draw the pictures of docs/template-hm08.md from the shipped template: python tools/draw_hm08.py [--out DIR]."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from facewright.evaluate.uv import ATLAS_PIXELS, signed_uv_areas
from facewright.mesh.normals import face_areas
from facewright.mesh.polygons import polygon_edges
from facewright.mesh.raster import Camera, raster_uv
from facewright.mesh.render import render, render_with_hits
from facewright.rigging import in_place, rig_from_face, template_rig, unscanned_face
from facewright.template.modifiers import read_modifiers, sample_identity
from facewright.template.store import read_template
from facewright.write.puppet import BACKGROUND, Puppet

REGION_COLORS = {
    "scalp": (0.35, 0.38, 0.70),
    "neck": (0.30, 0.62, 0.34),
    "face": (0.80, 0.52, 0.40),
    "ear_left": (0.86, 0.74, 0.22),
    "ear_right": (0.86, 0.74, 0.22),
    "eyes": (0.30, 0.55, 0.85),
    "lips": (0.90, 0.45, 0.42),
    "lip_upper": (0.75, 0.10, 0.12),
    "lip_lower": (0.55, 0.03, 0.20),
    "nostrils": (0.08, 0.08, 0.10),
    "socket_left": (0.05, 0.30, 0.10),
    "socket_right": (0.05, 0.30, 0.10),
    "mouth_interior": (0.30, 0.05, 0.25),
}
# Dark blue to yellow at 0, 5, 10, 15, 20 px/mm.
DENSITY_COLORS = np.array(
    [[0.05, 0.02, 0.20], [0.16, 0.22, 0.48], [0.08, 0.45, 0.50], [0.30, 0.68, 0.32], [0.98, 0.86, 0.15]]
)
HEAD, SIZE = (0.0, -35.0, -40.0), (640, 560)
SKIN, SCLERA, IRIS, PUPIL = (0.60, 0.40, 0.31), (0.80, 0.78, 0.75), (0.15, 0.10, 0.06), (0.01, 0.01, 0.01)


def density_picture(template, size=1024):
    """(size, size, 3): the atlas, coloured by texels per millimetre at 4096 squared."""
    faces, uv_faces = (a[template.skin.face_slice] for a in (template.faces, template.uv_faces))
    scale = np.abs(signed_uv_areas(template.uv, uv_faces)) / face_areas(template.vertices, faces)
    steps = np.clip(ATLAS_PIXELS * np.sqrt(scale) / 5.0, 0.0, 4.0)
    colors = np.stack([np.interp(steps, np.arange(5), DENSITY_COLORS[:, c]) for c in range(3)], axis=1)
    face, barycentric = raster_uv(template.uv, uv_faces, size)
    image = np.where((face >= 0)[..., None], colors[np.maximum(face, 0)], 1.0)
    edge = (barycentric.min(axis=2) < 0.06) & (face >= 0)
    image[edge] *= 0.75
    return (image * 255).astype(np.uint8)


def bare_faces(template):
    """(m, 3) faces of the skin and the eyeballs: lashes and what is clear would hide the lids."""
    shown = [part for part in template.parts if part.name in ("skin", "eye_left", "eye_right")]
    return np.concatenate([template.faces[part.face_slice] for part in shown])


def painted(template):
    """(n, 3) linear colours: skin, and eyes with iris and pupil."""
    colors = np.tile(SKIN, (len(template.vertices), 1))
    for part in template.parts:
        if part.name in ("eye_left", "eye_right"):
            faces, uv_faces = (a[part.face_slice].ravel() for a in (template.faces, template.uv_faces))
            radius = np.linalg.norm(template.uv[uv_faces] - 0.5, axis=1)[:, None]
            colors[faces] = np.where(radius < 0.09, PUPIL, np.where(radius < 0.25, IRIS, SCLERA))
    return colors


def region_picture(template, yaw, pitch=0.0):
    colors = np.tile(SCLERA, (len(template.vertices), 1))
    for name, color in REGION_COLORS.items():
        colors[template.regions[name]] = color
    colors[template.regions["skull"]] *= 0.6
    for line in template.lines.values():
        colors[line] = 0.0
    camera = Camera.looking_at(HEAD, yaw, pitch, 150, SIZE)
    return render(template.vertices, bare_faces(template), camera, colors=colors)


def wire_picture(template, center, yaw, half_height):
    """The polygons' edges over clay, drawn where they are seen."""
    camera = Camera.looking_at(center, yaw, 0.0, half_height, SIZE)
    image, hits = render_with_hits(template.vertices, bare_faces(template), camera, colors=painted(template))
    depth = (1000.0 - hits.distance).reshape(SIZE)
    edges = polygon_edges(template.polygons)
    t = np.linspace(0.0, 1.0, 24)[:, None, None]
    points = ((1 - t) * template.vertices[edges[:, 0]] + t * template.vertices[edges[:, 1]]).reshape(-1, 3)
    pixels, height = camera.project(points)
    x, y = np.floor(pixels).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < SIZE[1]) & (y < SIZE[0])
    x, y, height = x[inside], y[inside], height[inside]
    seen = height > depth[y, x] - 0.4
    image = image.astype(float)
    image[y[seen], x[seen]] *= 0.45
    return image.astype(np.uint8)


def people_picture(template, count=8, seed=5):
    """Random people of the modifiers, neutral, as finished rigs."""
    modifiers, rng = read_modifiers("hm08"), np.random.default_rng(seed)
    camera = Camera.looking_at(HEAD, 20, 0, 155, (480, 420))
    people = [template.vertices + sample_identity(modifiers, rng) for _ in range(count)]
    rigs = [rig_from_face(in_place(unscanned_face(template, person))) for person in people]
    return sheet([Puppet(rig).picture({}, camera) for rig in rigs], count // 2)


def shapes_picture(template):
    """The template's finished rig in each of the 52 shapes; mouthClose as it is used, with the jaw open."""
    camera = Camera.looking_at((0.0, -35.0, 0.0), 0, 0, 85, (280, 233))
    puppet = Puppet(template_rig(template))
    poses = [{name: 1.0} | ({"jawOpen": 1.0} if name == "mouthClose" else {}) for name in template.shape_names]
    return sheet([puppet.picture(pose, camera) for pose in poses], 9)


def sheet(images, columns):
    blank = np.tile(np.round(255 * np.array(BACKGROUND)).astype(np.uint8), (*images[0].shape[:2], 1))
    images = images + [blank] * (-len(images) % columns)
    rows = [np.concatenate(images[i : i + columns], axis=1) for i in range(0, len(images), columns)]
    return np.concatenate(rows, axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path(__file__).resolve().parents[1] / "docs" / "images"
    parser.add_argument("--out", type=Path, default=default)
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    template = read_template("hm08")
    head = sheet(
        [
            region_picture(template, 0),
            region_picture(template, 60),
            region_picture(template, 20, -45),
            wire_picture(template, (0.0, -20.0, 0.0), 0, 95),
            wire_picture(template, (10.0, -65.0, 20.0), 25, 32),
            wire_picture(template, (31.0, 0.0, 10.0), 0, 24),
        ],
        3,
    )
    pictures = {
        "hm08-atlas": density_picture(template),
        "hm08-regions": head,
        "hm08-people": people_picture(template),
        "hm08-shapes": shapes_picture(template),
    }
    for name, picture in pictures.items():
        Image.fromarray(picture).save(out / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
