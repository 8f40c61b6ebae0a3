"""A Rig as OBJ files: the neutral and each target, polygons as they are modelled, one vertex order in all files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facewright.mesh.render import linear_to_srgb
from facewright.write.files import file_name, png_bytes, replace_file

MATERIALS = "rig.mtl"


def write_obj(rig, folder, png=png_bytes):
    """Write neutral.obj, one OBJ per target, rig.mtl and the maps it names into a folder. Returns the OBJ paths.

    Millimetres, in our axes; every mesh is an object ("o skin"); quads stay quads. No vn lines: smooth shading is the
    reader's, and differs under each target. png: how images are encoded (files.PngOnce)
    """
    folder = Path(folder)
    for name, pixels in rig.maps.items():
        replace_file(folder / f"{file_name(name)}.png", png(pixels))
    replace_file(folder / MATERIALS, _materials(rig).encode("utf-8"))
    blocks = _static_blocks(rig)
    paths = [folder / "neutral.obj"]
    replace_file(paths[0], _obj(rig, blocks, "neutral", None))
    for index, target in enumerate(rig.target_names):
        paths.append(folder / f"{file_name(target)}.obj")
        replace_file(paths[-1], _obj(rig, blocks, target, index))
    return paths


def _obj(rig, blocks, name, target):
    """The bytes of one OBJ; target is an index into the deltas or None for the neutral."""
    lines = [f"# {name}; millimetres, +Y up, +Z out of the face, +X the person's left\nmtllib {MATERIALS}\n"]
    for mesh, (uvs, faces) in zip(rig.meshes, blocks):
        moved = target is not None and mesh.deltas is not None
        vertices = mesh.vertices + mesh.deltas[target] if moved else mesh.vertices
        lines += [f"o {mesh.name}\n", _rows("v %.5f %.5f %.5f\n", vertices), uvs, faces]
    return "".join(lines).encode("utf-8")


def _static_blocks(rig):
    """(vt lines, usemtl and f lines) of each mesh: the same in all files. OBJ counts from 1 through all objects."""
    blocks, first_vertex, first_uv = [], 1, 1
    for mesh in rig.meshes:
        corners = np.stack([mesh.polygons + first_vertex, mesh.uv_polygons + first_uv], axis=2)  # (p, 4, 2)
        quads = mesh.polygons[:, 3] >= 0
        faces = _rows("f %d/%d %d/%d %d/%d %d/%d\n", corners[quads].reshape(-1, 8))
        faces += _rows("f %d/%d %d/%d %d/%d\n", corners[~quads, :3].reshape(-1, 6))
        blocks.append((_rows("vt %.6f %.6f\n", mesh.uv), f"usemtl {mesh.material.name}\n{faces}"))
        first_vertex += len(mesh.vertices)
        first_uv += len(mesh.uv)
    return blocks


def _rows(template, values):
    return (template * len(values)) % tuple(values.ravel().tolist())


def _materials(rig):
    """The text of the MTL: colours in sRGB as its readers expect, maps by their file names."""
    text = []
    for material in {mesh.material.name: mesh.material for mesh in rig.meshes}.values():
        color = linear_to_srgb(np.array(material.color))
        text.append(f"newmtl {material.name}\nKd {color[0]:.4f} {color[1]:.4f} {color[2]:.4f}\nKs 0 0 0")
        text.append(f"d {material.alpha:.3f}")
        if material.albedo:
            text.append(f"map_Kd {file_name(material.albedo)}.png")
            if rig.maps[material.albedo].shape[2:] == (4,):
                text.append(f"map_d {file_name(material.albedo)}.png")
        if material.normal:
            text.append(f"norm {file_name(material.normal)}.png")
    return "\n".join(text) + "\n"
