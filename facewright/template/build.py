"""Build a Template from an official folder of OBJ files in one topology and a description of it (docs/template.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facewright.conventions import ARKIT_SHAPES
from facewright.data import Landmarks, Part, Template
from facewright.errors import InputError
from facewright.mesh.adjacency import border_vertices
from facewright.mesh.openness import vertex_openness
from facewright.mesh.polygons import triangulated
from facewright.template import rules
from facewright.template.assemble import assemble, fit_sphere
from facewright.template.corners import even_corners, relaxed_corners
from facewright.template.landmarks import template_landmarks
from facewright.template.lines import feature_lines, find_loops
from facewright.template.lips import closed_lips, paired_modes
from facewright.template.regions import Head, skin_openness, skin_regions, still_region
from facewright.template.skeleton import head_skeleton
from facewright.template.source import read_description, read_source_mesh, read_source_vertices
from facewright.template.symmetry import mirror_map, symmetrized
from facewright.template.tongue import tongue_out


def build_template(source_folder, description_path):
    """The Template that a description makes of a source folder.

    raises   InputError for files that are missing or of another mesh; StageError where no line or region is found
    """
    folder = Path(source_folder)
    description = read_description(description_path)
    unit = float(description["source"]["unit_mm"])
    neutral = read_source_mesh(folder / description["source"]["neutral"])
    _check_counts(description, neutral)
    source_shapes = _read_shapes(folder, description, neutral.vertices, unit)
    shaped = assemble(description, neutral, unit, source_shapes)

    vertices = shaped.vertices - _origin(shaped)
    groups, twin_groups = shaped.groups
    mirror = mirror_map(vertices, shaped.polygons, groups=groups, twin_groups=twin_groups)
    vertices = symmetrized(vertices, mirror)
    names, deltas = _arkit(description, source_shapes, shaped.origin)
    identity = _read_identity(folder, description, neutral.vertices, unit)[:, shaped.origin]

    head = _head(shaped, vertices, mirror)
    stops = _source_stops(description, shaped)
    loops = find_loops(head, skin_openness(head))
    lines = feature_lines(head, loops, stops)
    vertices, identity = _closed_lips(description, shaped, vertices, identity, head, lines)
    vertices = _relaxed_corners(description, shaped, vertices, head, lines)
    head = _head(shaped, vertices, mirror)
    openness = skin_openness(head)
    regions = skin_regions(head, openness, loops, lines)

    deltas = _shape_rules(description, shaped, vertices, names, deltas, head, lines)
    identity, deltas = (_even_corners(description, shaped, head, lines, fields) for fields in (identity, deltas))
    deltas = rules.symmetric_shapes(names, deltas, mirror)
    identity = _even_eyes(shaped, vertices, identity, head)
    regions = _whole_head(regions, len(vertices))
    regions["skull"] = regions["outer"] & ~regions["face"] & still_region(deltas, 0.05)
    faces, _ = triangulated(shaped.polygons)
    uv_faces, _ = triangulated(shaped.uv_polygons)
    skeleton, skin_weights = head_skeleton(vertices, faces, shaped, deltas[names.index("jawOpen")], regions, head.eyes)
    return Template(
        vertices=vertices,
        faces=faces,
        polygons=shaped.polygons,
        uv=shaped.uv,
        uv_faces=uv_faces,
        uv_polygons=shaped.uv_polygons,
        mirror=mirror,
        parts=shaped.parts,
        regions=regions,
        lines=lines,
        landmarks=_landmarks(shaped, vertices, faces, mirror, regions["lip_upper"] | regions["lip_lower"]),
        shape_names=names,
        deltas=deltas,
        identity_basis=identity,
        openness=_openness(description, shaped, vertices, faces),
        skeleton=skeleton,
        skin_weights=skin_weights,
        materials=description["materials"],
        info=dict(description["info"]) | {"rules": sorted(description.get("rules", {}))},
    )


def _check_counts(description, neutral):
    """InputError unless the neutral has as many vertices and polygons as the description was written for."""
    for key in ("vertices", "polygons"):
        expected, got = description["source"].get(key), len(getattr(neutral, key))
        if expected is not None and got != expected:
            raise InputError(
                f"template source: the neutral has {got} {key}, the description is for {expected}; "
                "use the release that it was written for"
            )


def _read_shapes(folder, description, neutral, unit):
    """source name -> (n, 3) deltas in mm of every source shape that the description uses."""
    shapes = description["shapes"]
    wanted = []
    for name in ARKIT_SHAPES:
        if name not in shapes.get("made_by_rule", []):
            wanted.extend(_sources_of(name, shapes))
    pattern = description["source"]["shape"]
    n = len(neutral)
    return {
        name: (read_source_vertices(folder / pattern.replace("*", name), n) - neutral) * unit
        for name in dict.fromkeys(wanted)
    }


def _sources_of(name, shapes):
    """Names of the source shapes that add up to an ARKit shape."""
    if name in shapes.get("sums", {}):
        return shapes["sums"][name]
    for side in ("Left", "Right"):
        if name.endswith(side) and name not in ("jawLeft", "jawRight", "mouthLeft", "mouthRight"):
            return [name[: -len(side)] + shapes.get(side.lower(), side)]
    return [name]


def _arkit(description, source_shapes, origin):
    """ARKIT_SHAPES and their deltas (52, n, 3); zero where a rule makes them later."""
    deltas = np.zeros((len(ARKIT_SHAPES), len(origin), 3))
    for row, name in enumerate(ARKIT_SHAPES):
        if name not in description["shapes"].get("made_by_rule", []):
            deltas[row] = sum(source_shapes[source] for source in _sources_of(name, description["shapes"]))[origin]
    return ARKIT_SHAPES, deltas


def _read_identity(folder, description, neutral, unit):
    """(i, n, 3) identity modes of the source, mm per standard deviation; (0, n, 3) if the description has none."""
    pattern = description["source"].get("identity")
    paths = sorted(folder.glob(pattern)) if pattern else []
    if pattern and not paths:
        raise InputError(f"template source: no file {pattern} in {folder}; is this the official folder?")
    modes = np.empty((len(paths), len(neutral), 3))
    for row, path in zip(modes, paths):
        row[:] = (read_source_vertices(path, len(neutral)) - neutral) * unit
    return modes


def _origin(shaped):
    """Midway between the eyeballs' centres."""
    left = fit_sphere(shaped.vertices[shaped.part("eye_left").vertex_slice])[0]
    right = fit_sphere(shaped.vertices[shaped.part("eye_right").vertex_slice])[0]
    return 0.5 * (left + right)


def _head(shaped, vertices, mirror):
    """The skin and its surroundings as the finders of regions and lines take it."""
    left = shaped.part("eye_left")
    center, radius = fit_sphere(vertices[left.vertex_slice])
    tongue = vertices[shaped.part("tongue").vertex_slice]
    skin = shaped.parts[0].vertex_slice
    balls = [_part_mesh(shaped, vertices, part) for part in shaped.parts if part.name.startswith(("eye_", "cornea_"))]
    offsets = np.cumsum([0] + [len(points) for points, _ in balls])
    return Head(
        vertices=vertices[skin],
        polygons=shaped.polygons[shaped.skin_polygons],
        mirror=mirror[skin],
        eyes=np.stack([center, center * [-1, 1, 1]]),
        eye_radius=radius,
        mouth=tongue.mean(axis=0) * [0, 1, 1],
        balls=(
            np.vstack([points for points, _ in balls]),
            np.vstack([faces + start for (_, faces), start in zip(balls, offsets)]),
        ),
    )


def _part_mesh(shaped, vertices, part):
    faces, _ = triangulated(shaped.polygons)
    return vertices[part.vertex_slice], faces[part.face_slice] - part.vertices[0]


def _source_stops(description, shaped):
    """Stops of lines, given as source vertices, in the template's order."""
    place = {int(source): index for index, source in reversed(list(enumerate(shaped.origin)))}
    return {name: [place[v] for v in stops] for name, stops in description.get("lines", {}).items()}


def _closed_lips(description, shaped, vertices, identity, head, lines):
    """Neutral and identity modes whose paired lip points meet, each lip moved half the way."""
    options = description.get("rules", {}).get("close_lips")
    if not options:
        return vertices, identity
    upper, lower = lines["lip_seam_upper"], lines["lip_seam_lower"]
    skin = shaped.parts[0].vertex_slice
    radius = float(options["radius_mm"])
    closed, modes = vertices.copy(), identity.copy()
    closed[skin] = symmetrized(closed_lips(head.vertices, head.faces, upper, lower, radius_mm=radius), head.mirror)
    keep = paired_modes(closed[skin], head.faces, upper, lower, radius_mm=radius)
    for mode in modes:
        mode[skin] += keep(mode[skin])
    return closed, modes


def _relaxed_corners(description, shaped, vertices, head, lines):
    """The neutral without slivers at the corners of the mouth."""
    options = description.get("rules", {}).get("even_corners")
    if not options:
        return vertices
    seams, skin = (lines["lip_seam_upper"], lines["lip_seam_lower"]), shaped.parts[0].vertex_slice
    relaxed = np.array(vertices)
    moved = relaxed_corners(vertices[skin], head.faces, seams, radius_mm=float(options["relax_mm"]))
    relaxed[skin] = symmetrized(moved, head.mirror)
    return relaxed


def _even_corners(description, shaped, head, lines, fields):
    """Identity modes or shapes (s, n, 3) that move the small faces at the corners of the mouth alike."""
    options = description.get("rules", {}).get("even_corners")
    if not options:
        return fields
    corners, skin = lines["lip_seam_upper"][[0, -1]], shaped.parts[0].vertex_slice
    radius, smooth = float(options["radius_mm"]), float(options["smooth_mm"])
    even = np.array(fields)
    even[:, skin] = even_corners(
        head.vertices, head.faces, corners, fields[:, skin], radius_mm=radius, smooth_mm=smooth
    )
    return even


def _shape_rules(description, shaped, vertices, names, deltas, head, lines):
    """Deltas with turning eyes and a tongue that comes out, as the description asks."""
    options = description.get("rules", {})
    deltas = deltas.copy()
    if "turn_eyes" in options:
        for side, center in zip(("Left", "Right"), head.eyes):
            moved = [part for part in shaped.parts if part.attach == f"eye_{side.lower()}"]
            for name, (yaw, pitch) in rules.eye_turns(side, options["turn_eyes"]).items():
                for part in moved:
                    s = part.vertex_slice
                    deltas[names.index(name), s] = rules.turned(vertices[s], center, yaw, pitch)
    if "tongue_out" in options:
        jaw_open = deltas[names.index("jawOpen")]
        lips = 0.5 * (vertices[lines["lip_seam_upper"]] + vertices[lines["lip_seam_lower"]])
        deltas[names.index("tongueOut")] = _tongue_out(
            options["tongue_out"], shaped, vertices, jaw_open, lips[len(lips) // 2]
        )
    return deltas


def _tongue_out(options, shaped, vertices, jaw_open, lips):
    """(n, 3) the tongue comes out between lips and teeth that part by a share of jawOpen; lips (3,) their middle."""
    tongue, teeth = shaped.part("tongue"), vertices[shaped.part("teeth_lower").vertex_slice]
    points, faces = _part_mesh(shaped, vertices, tongue)
    border = np.flatnonzero(border_vertices(faces, len(points)))
    share = float(options["jaw_open"])
    delta = share * jaw_open
    edge = teeth[np.abs(teeth[:, 0]) < points[:, 0].max(), 1].max()
    delta[tongue.vertex_slice] = tongue_out(
        points,
        faces,
        border,
        jaw_open[tongue.vertex_slice],
        [0.0, max(lips[1], edge), lips[2]],
        lips + [0.0, -float(options["drop_mm"]), float(options["out_mm"])],
        share=share,
        thin=float(options["thin"]),
    )
    return delta


def _even_eyes(shaped, vertices, identity, head):
    """Identity modes in which whatever is attached to an eye keeps its roundness."""
    identity = identity.copy()
    for side, center in zip(("left", "right"), head.eyes):
        chosen = np.zeros(len(vertices), bool)
        for part in shaped.parts:
            chosen[part.vertex_slice] |= part.attach == f"eye_{side}"
        identity[:, chosen] = rules.even_eyes(identity[:, chosen], vertices[chosen], center)
    return identity


def _whole_head(regions, n):
    """Masks of the skin as masks of all parts."""
    return {name: np.concatenate([mask, np.zeros(n - len(mask), bool)]) for name, mask in regions.items()}


def _openness(description, shaped, vertices, faces):
    """(n,) openness of all parts; thin things on the skin (lashes, fluid) cast no shadow and count as open."""
    materials = description["materials"]
    solid = [p for p in shaped.parts if p.attach != "skin" or materials[p.material].get("alpha", 1.0) >= 0.5]
    chosen = np.concatenate([np.arange(*part.faces) for part in solid])
    openness = np.ones(len(vertices))
    members = np.concatenate([np.arange(*part.vertices) for part in solid])
    openness[members] = vertex_openness(vertices, faces[chosen])[members]
    return openness


def _landmarks(shaped, vertices, faces, mirror, lips):
    """Landmarks found on pictures of the skin and the whole eyeballs, without lashes and the like in front."""
    shown = [part for part in shaped.parts if part.name == "skin" or part.name.startswith(("eye_", "cornea_"))]
    shown.sort(key=lambda part: (part.name != "skin", part.name.rsplit("_", 1)[-1]))
    index = np.concatenate([np.arange(*part.vertices) for part in shown])
    face_index = np.concatenate([np.arange(*part.faces) for part in shown])
    renumber = np.full(len(vertices), -1)
    renumber[index] = np.arange(len(index))
    found = template_landmarks(
        vertices[index],
        renumber[faces[face_index]],
        renumber[mirror[index]],
        _merged(shown, index, face_index),
        lips=lips[index],
    )
    return Landmarks(found.names, face_index[found.faces], found.barycentric, found.weights)


def _merged(shown, index, face_index):
    """The skin and one part per eye that takes in the cornea, numbered as the shown vertices and faces are."""
    parts = []
    for side in ("skin", "left", "right"):
        mine = [part for part in shown if part.name.rsplit("_", 1)[-1] == side]
        starts = [int(np.flatnonzero(index == part.vertices[0])[0]) for part in mine]
        sizes = [part.vertices[1] - part.vertices[0] for part in mine]
        first = [int(np.flatnonzero(face_index == part.faces[0])[0]) for part in mine]
        counts = [part.faces[1] - part.faces[0] for part in mine]
        name = side if side == "skin" else f"eye_{side}"
        parts.append(Part(name, (starts[0], starts[0] + sum(sizes)), (first[0], first[0] + sum(counts)), name))
    return tuple(parts)
