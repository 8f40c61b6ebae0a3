"""What every format module returns, before images are loaded and everything is checked: RawMesh."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from facewright.errors import InputError

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".tga", ".webp")
MOST_NAMED = 3  # images in a message


@dataclass(frozen=True)
class ImageSource:
    """An image that a mesh file names (label, to be found beside the mesh file) or holds (data)."""

    label: str
    beside: Path | None = None
    data: bytes | None = None


@dataclass(frozen=True)
class RawMaterial:
    """name, and the images of its albedo and its tangent-space normals, where it has them."""

    name: str
    albedo: ImageSource | None = None
    normal: ImageSource | None = None


@dataclass(frozen=True)
class RawMesh:
    """A triangle mesh as a file tells it; nothing checked yet.

    vertices (n, 3), faces (m, 3); uv (t, 2) v up, uv_faces (m, 3), -1 in rows of faces that have none
    face_material (m,) index into materials, -1 where a face has none
    colors   (n, 3) 0..1 sRGB
    unit_mm  millimetres per unit where the format says so
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None = None
    uv_faces: np.ndarray | None = None
    face_material: np.ndarray | None = None
    materials: tuple[RawMaterial, ...] = ()
    colors: np.ndarray | None = None
    unit_mm: float | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)


def path_beside(path, name):
    """The file that a mesh file at path names, never one outside the mesh file's own folder.

    A name from another machine ("C:\\scans\\skin.png", "../maps/skin.png") is looked for by its last part beside
    the mesh file. Raises InputError where there is none.
    """
    folder = path.parent.resolve()
    cleaned = name.strip().strip('"').replace("\\", "/")
    last = cleaned.rsplit("/", 1)[-1]
    if not last or "\0" in cleaned:
        raise InputError(f"{path.name}: names a file {name!r}, which is no file name; correct it")
    wanted = (folder / cleaned).resolve()
    if wanted.is_relative_to(folder) and wanted.is_file():
        return wanted
    beside = (folder / last).resolve()
    if beside.is_relative_to(folder) and beside.is_file():
        return beside
    if not wanted.is_relative_to(folder):
        raise InputError(
            f"{path.name}: names {name!r}, which lies outside its folder and is not read; "
            f"copy the file beside {path.name} or give the texture with --albedo"
        )
    raise InputError(
        f"{path.name}: names {name!r}, which does not exist; put it there or give the texture with --albedo"
        f"{images_beside(path)}"
    )


def images_beside(path):
    """The images in a mesh file's folder as " (a.png, b.jpg)", to be named by a user; "" for none or too many."""
    images = sorted(file.name for file in path.parent.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES)
    return f" ({', '.join(images)})" if 0 < len(images) <= MOST_NAMED else ""


def triangulate(counts):
    """Fans over polygons whose corners lie one after another.

    counts (p,) corners of each polygon
    returns (m, 3) indices of corners, and (m,) the polygon of each triangle; polygons under three corners give none
    """
    counts = np.asarray(counts, dtype=np.int64)
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    first = starts[polygon]
    return np.stack([first, first + step + 1, first + step + 2], axis=1), polygon


def colors_to_unit(colors):
    """Colours (n, 3) in 0..1, whether the file counts to 1 or to 255."""
    colors = np.asarray(colors, dtype=np.float64)
    if colors.size and np.nanmax(colors) > 1.0:
        colors = colors / 255.0
    return np.clip(colors, 0.0, 1.0)
