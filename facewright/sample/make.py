"""Make the embedded sample: python -m facewright.sample.make [--out FOLDER]. The same bytes on every run.

A person far from hm08's mean, with the faults of a real scan: another triangulation and other texture coordinates,
noise, holes, hair, strands, a collar; in centimetres, standing on the floor, turned a little to the side.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt

from facewright.evaluate.skin_paint import Complexion, HeadPaint
from facewright.evaluate.synthetic import SyntheticOptions, centered_between_eyes, make_head, paint
from facewright.mesh.closest import interpolate
from facewright.mesh.raster import raster_uv
from facewright.sample import FOLDER
from facewright.sample.charts import layout
from facewright.template.modifiers import read_modifiers, sample_identity
from facewright.template.store import npz_bytes, read_template

SEED = 20
TEXTURE = 1024
MM_PER_UNIT = 10.0
COMPLEXION = Complexion(
    skin=(0.74, 0.55, 0.45), lips=(0.63, 0.35, 0.33), brows=(0.20, 0.13, 0.09), hair=(0.23, 0.15, 0.10),
    iris=(0.28, 0.36, 0.30), cloth=(0.34, 0.42, 0.55), freckles=0.45,
)  # fmt: skip
OPTIONS = SyntheticOptions(n_faces=30000)


def place_in_room():
    """(4, 4) mm in our frame -> file: turned 20 degrees to the side, 8 forward, 158 cm above the floor, centimetres."""
    yaw, pitch = np.radians(20.0), np.radians(8.0)
    about_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    T = np.eye(4)
    T[:3, :3] = about_y @ about_x / MM_PER_UNIT
    T[:3, 3] = 12.0, 158.0, -7.0
    return T


def make_sample():
    """dict file name -> bytes of the sample."""
    template = read_template("hm08")
    delta = sample_identity(read_modifiers("hm08"), np.random.default_rng([SEED, 1]))
    person = centered_between_eyes(template.vertices + delta, template)
    head = make_head(template, person, np.random.default_rng([SEED, 2]), SEED, OPTIONS)
    uv, uv_faces = layout(head.vertices, head.faces)
    texture = paint_texture(head, uv, uv_faces, HeadPaint(template, person, COMPLEXION, SEED))
    T = place_in_room()

    def to_file(points):
        return points @ T[:3, :3].T + T[:3, 3]

    truth = {"vertices": to_file(person).astype(np.float32), "seed": np.array(SEED)}
    truth["topology_id"] = np.array(template.info["topology_id"])
    return {
        "head.obj": obj_text(to_file(head.vertices), head.faces, uv, uv_faces).encode(),
        "head.mtl": b"newmtl head\nKd 1 1 1\nmap_Kd albedo.jpg\n",
        "albedo.jpg": jpeg_bytes(texture),
        "truth.npz": npz_bytes(truth),
    }


def paint_texture(head, uv, uv_faces, brush):
    """(h, w, 3) uint8 albedo of a MadeHead; the gaps between charts carry the nearest colour."""
    face, barycentric = raster_uv(uv, uv_faces, TEXTURE)
    covered = face >= 0
    points = interpolate(head.clean, head.faces, face[covered], barycentric[covered])
    colors = np.zeros((TEXTURE, TEXTURE, 3))
    colors[covered] = paint(points, head.kind[face[covered]], brush)
    nearest = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return (colors[tuple(nearest)] * 255 + 0.5).astype(np.uint8)


def obj_text(vertices, faces, uv, uv_faces):
    """The scan as OBJ with one material."""
    lines = ["# made by facewright.sample.make", "mtllib head.mtl", "usemtl head"]
    lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in vertices.tolist()]
    lines += [f"vt {u:.5f} {v:.5f}" for u, v in uv.tolist()]
    corners = np.stack([faces, uv_faces], axis=2).reshape(-1, 6) + 1
    lines += [f"f {a}/{ta} {b}/{tb} {c}/{tc}" for a, ta, b, tb, c, tc in corners.tolist()]
    return "\n".join(lines) + "\n"


def jpeg_bytes(image, quality=88):
    """An image (h, w, 3) uint8 as JPEG without metadata."""
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, "JPEG", quality=quality, optimize=True)
    return stream.getvalue()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=FOLDER)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for name, content in make_sample().items():
        (options.out / name).write_bytes(content)
        print(f"{options.out / name}: {len(content):,} bytes")


if __name__ == "__main__":
    main()
