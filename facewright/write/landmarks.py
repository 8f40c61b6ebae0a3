"""A picture of a scan with its landmarks, for whoever moves them by hand."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from facewright.mesh.raster import Camera
from facewright.mesh.render import render, srgb_to_linear

YAWS = (-45.0, 0.0, 45.0)
CENTER, HALF_HEIGHT_MM, SIZE = (0.0, -35.0, 0.0), 85.0, (1000, 760)
POINT, TEXT, OUTLINE = (255, 214, 10), (255, 255, 255), (0, 0, 0)
RING, SMALL_RING = 6, 4  # radii of named points and of all, pixels: what a point marks shows within


def draw_landmarks(path, scan, landmarks, names=None):
    """Write a PNG: the scan (in our frame) from three sides with its landmarks.

    names  landmark name -> the name to draw; None draws every point with a weight, without names
    """
    looks = {}
    if scan.has_texture and len(scan.textures) == 1:
        looks = {"texture": scan.textures[0], "uv": scan.uv, "uv_faces": scan.uv_faces}
    elif scan.colors is not None:
        looks = {"colors": srgb_to_linear(scan.colors)}
    positions = landmarks.positions(scan.vertices, scan.faces)
    normals = np.cross(
        scan.vertices[scan.faces[landmarks.faces, 1]] - scan.vertices[scan.faces[landmarks.faces, 0]],
        scan.vertices[scan.faces[landmarks.faces, 2]] - scan.vertices[scan.faces[landmarks.faces, 0]],
    )
    shown = [i for i, name in enumerate(landmarks.names) if landmarks.weights[i] > 0 and (not names or name in names)]
    font = ImageFont.load_default(15)
    pictures = []
    for yaw in YAWS:
        camera = Camera.looking_at(CENTER, yaw, 0, HALF_HEIGHT_MM, SIZE)
        picture = Image.fromarray(render(scan.vertices, scan.faces, camera, **looks))
        draw = ImageDraw.Draw(picture)
        pixels, _ = camera.project(positions)
        for i in shown:
            if normals[i] @ camera.R[2] <= 0:
                continue
            x, y = pixels[i]
            radius = RING if names else SMALL_RING
            for r, width, color in ((radius + 1, 3, OUTLINE), (radius, 1, POINT)):
                draw.ellipse([x - r, y - r, x + r, y + r], outline=color, width=width)
            if names:
                draw.text((x + 9, y - 8), names[landmarks.names[i]], TEXT, font, stroke_width=2, stroke_fill=OUTLINE)
        pictures.append(np.asarray(picture))
    # Encoded first: a full disk then leaves no half picture under a name that says it is one.
    data = io.BytesIO()
    Image.fromarray(np.hstack(pictures)).save(data, "PNG")
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(data.getvalue())
    partial.replace(path)
