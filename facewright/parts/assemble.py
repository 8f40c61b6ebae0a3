"""A Rig from a face, its shapes and its maps: everything a writer needs, nothing a writer decides."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from facewright.data import Material, Mesh, Rig
from facewright.parts.fit import fit_skeleton
from facewright.parts.iris import EyeLook, paint_bulge, paint_eye
from facewright.parts.mouth_light import mouth_light, parts_behind_lips, shaded
from facewright.parts.paint import PAINTERS, plain_map
from facewright.transfer.eyeball import eye_parts, measure_eyeball
from facewright.transfer.halves import split_in_halves
from facewright.working_set import read_working_set

_STILL_MM = 1e-6
SKIN_MAPS = ("albedo", "normal")
# Powers of the light that irises and whites of a scan lack, and least share, that the rig's have.
_DIMMED, _WHITES_DIMMED, _LEAST_LIGHT = 0.25, 0.5, 0.6


@dataclass(frozen=True)
class AssemblyOptions:
    """eyes      how eyes are painted; None leaves them plain
    painted   whether the small maps of teeth, gums and lashes are painted; a rig that is only measured needs none
    left_out  parts that the rig shall not have, by the beginning of their names, where they just hang on the skin:
              lash cards without a texture and veils made for one size of ball are worse than nothing
    """

    eyes: EyeLook | None = field(default_factory=EyeLook)
    painted: bool = True
    left_out: tuple[str, ...] = ("lashes", "occlusion", "blend", "lacrimal")


def build_rig(face, deltas, maps=None, options=None, eyes=None):
    """The Rig of a Face whose parts are in place (fit_parts) with its shapes (transfer_shapes).

    deltas  (s, n, 3) mm from face.vertices, in the order of face.template.shape_names
    maps    name -> (h, w, c) uint8 of the skin; "albedo" and "normal" go on its material, others are left to textures/
    eyes    contact.Targets whose in-betweens and correctives the rig shall have; deltas are then eyes.deltas
    returns data.Rig: one mesh per part, the skin first; a part that no shape moves has no targets
    """
    options = options or AssemblyOptions()
    seen = face.stats.get("parts", {})
    if options.eyes is not None and options.eyes.iris_color is None and "iris_color" in seen:
        options = replace(options, eyes=_as_seen(options.eyes, seen))
    maps = maps or {}
    template = face.template
    words = read_working_set()
    targets = dict(zip(template.shape_names, deltas)) | (eyes.extras if eyes is not None else {})
    in_betweens = eyes.in_betweens if eyes is not None else {}
    halves = words.halves(template.shape_names)
    made, passed = split_in_halves(template, targets, halves, in_betweens)
    targets |= made
    deltas = np.stack(list(targets.values()))
    used = {name: np.asarray(maps[name]) for name in SKIN_MAPS if name in maps}
    light = cache(lambda: mouth_light(template))
    meshes = []
    for part in template.parts:
        if part.attach == "skin" and part.name.startswith(options.left_out):
            continue
        material, painted = _material(template, part, used, options, light)
        used.update(painted)
        meshes.append(_mesh(face, deltas, part, material))
    n_skin = template.skin.vertices[1]
    return Rig(
        meshes=tuple(meshes),
        target_names=tuple(targets),
        skeleton=fit_skeleton(template, face.vertices),
        maps=used,
        regions={name: mask[:n_skin] for name, mask in face.regions.items()},
        lines={name: line for name, line in face.lines.items() if (np.asarray(line) < n_skin).all()},
        info=rig_info(template),
        in_betweens=in_betweens | passed,
        correctives=eyes.correctives if eyes is not None else {},
        halves=halves,
        expressions=words.expressions,
        visemes=words.visemes,
    )


def rig_info(template):
    """What a rig says of where it comes from: template, version, topology, licence, credits (a list), copyright."""
    info = template.info
    credits = info.get("credits", ())
    return {
        "template": info.get("name"),
        "template_version": info.get("version"),
        "topology_id": info.get("topology_id"),
        "licence": info.get("licence"),
        "licence_text": info.get("licence_text"),
        "credits": [credits] if isinstance(credits, str) else list(credits),
        "copyright": info.get("copyright") or info.get("licence") or "",
        "units": "millimetres",
    }


def _mesh(face, deltas, part, material):
    """One part as a Mesh with indices of its own."""
    template, at = face.template, part.vertex_slice
    start, stop = part.vertices
    rows = (template.polygons[:, 0] >= start) & (template.polygons[:, 0] < stop)
    polygons, uv_polygons = template.polygons[rows], template.uv_polygons[rows]
    uv_faces = template.uv_faces[part.face_slice]
    corners, uv_local = np.unique(np.concatenate([uv_faces.ravel(), uv_polygons.ravel()]), return_inverse=True)
    shift = int(corners[0] < 0)  # the padding -1 sorts first
    uv_local = uv_local.reshape(-1) - shift
    own = deltas[:, at]
    moves = np.abs(own).max(initial=0.0) > _STILL_MM
    return Mesh(
        name=part.name,
        vertices=face.vertices[at],
        faces=template.faces[part.face_slice] - start,
        polygons=np.where(polygons >= 0, polygons - start, -1),
        uv=template.uv[corners[shift:]],
        uv_faces=uv_local[: uv_faces.size].reshape(-1, 3),
        uv_polygons=uv_local[uv_faces.size :].reshape(-1, 4),
        material=material,
        skin_weights=_weights(template, part),
        deltas=own if moves else None,
    )


def _weights(template, part):
    """(p, j) skin weights; what turns with a bone hangs on that bone alone."""
    bone = {"skull": "head"}.get(part.attach, part.attach)
    if bone == "skin" or bone not in template.skeleton.names:
        return template.skin_weights[part.vertex_slice]
    weights = np.zeros((part.vertices[1] - part.vertices[0], len(template.skeleton.names)))
    weights[:, template.skeleton.names.index(bone)] = 1.0
    return weights


def _as_seen(look, seen):
    """The EyeLook of a scan's eyes, from what parts.fit says of them. Where a photograph is dim or has the eyes in the
    shade, so it has all of the face: whites in full light would glow in it, so they, and irises in the shade, get less.
    """
    irises, whites = (
        max(share**power, _LEAST_LIGHT)
        for share, power in ((seen.get("eye_light", 1.0), _DIMMED), (seen.get("eye_white", 1.0), _WHITES_DIMMED))
    )
    return replace(
        look,
        iris_color=tuple(irises * np.asarray(seen["iris_color"])),
        sclera_color=tuple(whites * np.asarray(look.sclera_color)),
    )


def _material(template, part, maps, options, light):
    """The Material of a part and the maps painted for it; light() (n,) of mouth_light."""
    look = template.materials[part.material]
    plain = {
        "color": tuple(float(c) for c in look.get("color", (0.8, 0.8, 0.8))),
        "roughness": float(look.get("roughness", 0.6)),
        "alpha": float(look.get("alpha", 1.0)),
        "double_sided": bool(look.get("double_sided", False)),
    }
    if part is template.skin or part.name == "skin":
        found = {name: name for name in SKIN_MAPS if name in maps}
        if "albedo" in found:
            plain["color"] = (1.0, 1.0, 1.0)
        return Material(part.material, **plain, albedo=found.get("albedo"), normal=found.get("normal")), {}
    if part.attach.startswith("eye_") and options.eyes is not None and plain["alpha"] == 1.0:
        name = f"{part.name}_albedo"
        plain["color"] = (1.0, 1.0, 1.0)
        if part.name != part.attach:
            # Through the pupil of a separate iris its own back is seen, from within; the cornea before it shines.
            plain |= {"double_sided": True, "roughness": 1.0}
        else:
            plain["double_sided"] = False
        painted = {name: _painted(template, part, options.eyes)}
        cornea = _cornea_before(template, part)
        bulge = f"{part.name}_normal" if cornea is not None else None
        if cornea is not None:
            painted[bulge] = paint_bulge(*_eye_in_its_uvs(template, part), _mesh_of(template, cornea))
        return Material(part.name, **plain, albedo=name, normal=bulge), painted
    behind = [other for other in parts_behind_lips(template) if other.material == part.material]
    if options.painted and ("paint" in look or part in behind):
        name = f"{part.material}_albedo"
        painted = {}
        if name not in maps:
            image = PAINTERS[look["paint"]](look) if "paint" in look else plain_map(plain["color"])
            painted[name] = shaded(image, template, behind, light()) if part in behind else image
        return Material(part.material, **plain | {"color": (1.0, 1.0, 1.0)}, albedo=name), painted
    return Material(part.material, **plain), {}


def _painted(template, part, look):
    """The texture of one eye part, painted on the template's eye, which looks straight ahead as the person's does."""
    return paint_eye(*_eye_in_its_uvs(template, part), look, inner=part.name != part.attach)


def _eye_in_its_uvs(template, part):
    """vertices, faces, uv, uv_faces and Eyeball of a part of an eye, as paint_eye takes them."""
    ball = measure_eyeball(template, part.attach.removeprefix("eye_"))
    return *_mesh_of(template, part), template.uv, template.uv_faces[part.face_slice], ball


def _mesh_of(template, part):
    """Vertices and faces of a part by itself."""
    return template.vertices[part.vertex_slice], template.faces[part.face_slice] - part.vertices[0]


def _cornea_before(template, part):
    """The clear part before an eyeball that has its iris in its own mesh, else None."""
    others = [other for other in eye_parts(template, part.attach.removeprefix("eye_")) if other is not part]
    clear = all(float(template.materials[other.material].get("alpha", 1.0)) < 1.0 for other in others)
    return others[0] if part.name == part.attach and others and clear else None
