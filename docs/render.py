"""Draw the pictures of README.md and of the pages here: python docs/render.py [--only NAME ...] [--out DIR].

The embedded sample goes through the stages in memory; nothing is kept but the pictures. hm08's own pictures come from
tools/draw_hm08.py.
"""

from __future__ import annotations

import argparse
import io
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from facewright.bake import BakeOptions, bake
from facewright.data import Face, Rig, Scan
from facewright.mesh.normals import face_areas
from facewright.mesh.polygons import polygon_edges
from facewright.mesh.raster import Camera, RayScene
from facewright.mesh.scene import Drawable, Scene
from facewright.parts import find_irises
from facewright.read import read_scan
from facewright.register import register
from facewright.rigging import in_place, rig_from_face
from facewright.sample import sample_path
from facewright.scan import clean_scan, find_landmarks
from facewright.template.store import read_template
from facewright.write.files import replace_file
from facewright.write.preview import (
    HEAT_LIMIT_MM,
    heat_colors,
    heat_drawable,
    preview_sheet,
    scan_drawables,
)
from facewright.write.puppet import Puppet, rig_drawables
from facewright.write.sheet import CAPTION, GROUND

MOST_BYTES = 300_000
GAP, CAPTION_HEIGHT = 6, 34
BACKGROUND = tuple(channel / 255 for channel in GROUND)
HEAD, FACE, MOUTH = (11.0, -17.0, -40.0), (11.0, -40.0, 0.0), (0.0, -76.0, 20.0)
EXPRESSIONS = (
    ("jawOpen",),
    ("mouthSmileLeft", "mouthSmileRight"),
    ("eyeBlinkLeft",),
    ("mouthPucker",),
    ("browInnerUp",),
)


@dataclass(frozen=True)
class Sample:
    """What the stages made of the embedded sample."""

    scan: Scan
    face: Face
    rig: Rig
    maps: dict[str, np.ndarray]


def rigged_sample(texture_size=2048):
    """The embedded sample, stage by stage as in docs/api.md."""
    scan, _ = clean_scan(read_scan(sample_path()))
    found = find_landmarks(scan)
    face = register(found.scan, found.landmarks, read_template("hm08"))
    face = in_place(face, find_irises(found.scan, face))
    maps = bake(found.scan, face, BakeOptions(size=texture_size))
    return Sample(found.scan, face, rig_from_face(face, maps), maps)


def hero(sample):
    """Scan, rig in colour, rig in clay, and below them five expressions."""
    camera = partial(Camera.looking_at, HEAD, 24.0, 4.0, 152.0, (600, 584))
    heads = [
        (scan_drawables(sample.scan, textured=True), "scan"),
        (rig_drawables(sample.rig, textured=True), "rig"),
        (rig_drawables(sample.rig, textured=False), "rig, clay"),
    ]
    top = strip([(picture(drawables, camera()), name) for drawables, name in heads])
    near = Camera.looking_at(FACE, 14.0, 2.0, 100.0, (380, 348))
    bottom = strip([(expression(sample.rig, names, near), " + ".join(names)) for names in EXPRESSIONS])
    return stack(top, bottom)


def registration(sample):
    """The scan in clay, the template's polygons on it, and how far one lies from the other."""
    camera = Camera.looking_at(HEAD, 28.0, 4.0, 148.0, (560, 500))
    heat = picture([heat_drawable(sample.scan, sample.face)], camera)
    draw_scale(heat)
    cells = [
        (picture(scan_drawables(sample.scan, textured=False), camera), "scan"),
        (wire(sample.face, camera), "hm08, fitted"),
        (heat, "distance from fit to scan"),
    ]
    return strip(cells)


def mouth_close(sample):
    """jawOpen, both, and mouthClose alone, which is no pose."""
    camera = Camera.looking_at(MOUTH, 18.0, 0.0, 62.0, (360, 400))
    poses = (("jawOpen",), ("jawOpen", "mouthClose"), ("mouthClose",))
    labels = ("jawOpen 1", "jawOpen 1, mouthClose 1", "mouthClose 1 alone: not a pose")
    return strip([(expression(sample.rig, names, camera), label) for names, label in zip(poses, labels)])


def textures(sample):
    """The maps of the skin."""
    cells = []
    for name in ("albedo", "normal", "coverage"):
        image = Image.fromarray(np.squeeze(sample.maps[name])).convert("RGB").resize((480, 480), Image.LANCZOS)
        cells.append((np.asarray(image), f"{name}.png"))
    return strip(cells)


def preview(sample):
    """preview.png of the demo, smaller."""
    sheet = Image.fromarray(preview_sheet(sample.rig, sample.scan, sample.face))
    width = 1080
    return np.asarray(sheet.resize((width, round(sheet.height * width / sheet.width)), Image.LANCZOS))


def expression(rig, names, camera):
    """The textured rig with some targets at 1."""
    posed = Puppet(rig, textured=True).posed(dict.fromkeys(names, 1.0), camera, full=False)
    return posed.render(camera, background=BACKGROUND).copy()


def picture(drawables, camera):
    return Scene(drawables).render(camera, background=BACKGROUND).copy()


def wire(face, camera, width_px=1.2, supersample=2):
    """The fitted skin and eyeballs in clay with the edges of their polygons drawn where they are seen."""
    template = face.template
    last = template.part("eye_right")
    V, F = face.vertices[: last.vertices[1]], template.faces[: last.faces[1]]
    height, width = camera.size
    fine = Camera(camera.R, camera.center, camera.half_height, (height * supersample, width * supersample))
    image = picture([Drawable(V, F)], fine).astype(np.float32)
    hits = RayScene(V, F).cast(*fine.rays())
    seen = np.flatnonzero(hits.face >= 0)
    triangles = hits.face[seen]
    sides = np.linalg.norm(V[F[:, [2, 0, 1]]] - V[F[:, [1, 2, 0]]], axis=2)  # (m, 3), opposite each corner
    altitudes = 2 * face_areas(V, F)[:, None] / np.maximum(sides, 1e-9)
    altitudes[~_is_polygon_edge(template, F)] = np.inf
    away_mm = (np.maximum(hits.barycentric[seen], 1e-9) * altitudes[triangles]).min(axis=1)
    mm_per_px = 2 * camera.half_height / height
    ink = 0.45 * np.clip(1.5 - away_mm / (0.5 * width_px * mm_per_px), 0.0, 1.0)
    image.reshape(-1, 3)[seen] *= (1.0 - ink)[:, None]
    return image.reshape(height, supersample, width, supersample, 3).mean(axis=(1, 3)).astype(np.uint8)


def _is_polygon_edge(template, F):
    """(m, 3) bool: the side opposite each corner of F (m, 3) is an edge of a polygon, not a quad's diagonal."""
    n = len(template.vertices)
    edges = np.sort(polygon_edges(template.polygons), axis=1)
    sides = np.sort(np.stack([F[:, [1, 2]], F[:, [2, 0]], F[:, [0, 1]]], axis=1), axis=2)
    return np.isin(sides[..., 0] * n + sides[..., 1], edges[:, 0] * n + edges[:, 1])


def draw_scale(image):
    """Put the error scale into the lower left corner of a picture (h, w, 3), in place."""
    height = image.shape[0]
    bar = np.repeat(heat_colors(np.linspace(0, HEAT_LIMIT_MM, 150))[None], 10, axis=0)
    image[height - 40 : height - 30, 16:166] = bar
    canvas = Image.fromarray(image)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(13)
    draw.text((16, height - 24), "0", CAPTION, font)
    draw.text((166, height - 24), f"{HEAT_LIMIT_MM} mm and more", CAPTION, font, anchor="ra")
    image[:] = np.asarray(canvas)


def strip(cells):
    """Pictures of one height beside each other with captions beneath: (h, w, 3) uint8. cells: (image, caption)."""
    height = cells[0][0].shape[0]
    width = sum(image.shape[1] + GAP for image, _ in cells) - GAP
    canvas = Image.new("RGB", (width, height + CAPTION_HEIGHT), GROUND)
    draw = ImageDraw.Draw(canvas)
    left = 0
    for image, caption in cells:
        canvas.paste(Image.fromarray(image), (left, 0))
        middle = left + image.shape[1] / 2
        draw.text((middle, height + 6), caption, CAPTION, ImageFont.load_default(17), anchor="ma")
        left += image.shape[1] + GAP
    return np.asarray(canvas)


def stack(top, bottom):
    """Two strips under each other on the wider one's width."""
    width = max(top.shape[1], bottom.shape[1])
    canvas = np.empty((top.shape[0] + bottom.shape[0], width, 3), np.uint8)
    canvas[:] = GROUND
    for image, row in ((top, 0), (bottom, top.shape[0])):
        left = (width - image.shape[1]) // 2
        canvas[row : row + image.shape[0], left : left + image.shape[1]] = image
    return canvas


def jpeg_bytes(image):
    """The picture as JPEG of the best quality that keeps it under MOST_BYTES."""
    for quality in (92, 88, 84, 78, 70, 60):
        stream = io.BytesIO()
        Image.fromarray(image).save(stream, "JPEG", quality=quality, optimize=True, subsampling=0)
        if stream.tell() <= MOST_BYTES:
            break
    return stream.getvalue()


PICTURES = {
    "hero": hero,
    "registration": registration,
    "mouth-close": mouth_close,
    "textures": textures,
    "preview": preview,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images")
    parser.add_argument("--only", nargs="+", choices=tuple(PICTURES), default=tuple(PICTURES), metavar="NAME")
    options = parser.parse_args()
    sample = rigged_sample()
    for name in options.only:
        content = jpeg_bytes(PICTURES[name](sample))
        replace_file(options.out / f"{name}.jpg", content)
        print(f"{options.out / name}.jpg  {len(content) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
