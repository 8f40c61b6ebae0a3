"""preview.png: the rig beside the scan, close-ups, the distance between them, and every shape."""

from __future__ import annotations

import io
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from PIL import Image

from facewright.mesh.closest import Surface
from facewright.mesh.normals import vertex_normals
from facewright.mesh.raster import Camera
from facewright.mesh.render import srgb_to_linear
from facewright.mesh.scene import CLAY_LINEAR, Drawable, Scene
from facewright.write.close_ups import close_up_sections
from facewright.write.files import replace_file
from facewright.write.sheet import PANEL, Cell, Section, color_bar, compose_sheet

BACKGROUND = tuple(c / 255.0 for c in PANEL)
COLUMNS = 9
THUMBNAIL = (224, 192)
VIEW = (384, 292)
CLOSE_UP = (276, 442)
FIT_CLOSE_UP = (384, 442)
VIEWS = {"front": 0.0, "three-quarter": 42.0, "side": 86.0}
HEAT_LIMIT_MM = 0.5
# sRGB stops of the error scale, from nothing to the limit: dark blue, teal, yellow, red.
HEAT_STOPS = np.array([(38, 52, 92), (46, 132, 140), (236, 212, 110), (206, 58, 48)], float)
NOT_SEEN = (88, 88, 94)
INNER_SHADE = 0.45
MOUTH_LIGHT_MM = 18.0  # behind the lips, where half of the light is left
BEHIND_LIPS = ("teeth_", "gums_", "tongue")
CLAY_MAP_PX = 256


def write_preview(rig, scan, face, path, jobs=2):
    """Write a contact sheet of a Rig (data.Rig) made from a Scan through a Face, as PNG.

    The whole face is shown under the plain shapes, the close-ups as in-betweens and correctives play them.

    scan  in our frame, as the face was fitted to it; jobs is the number of threads, which changes no pixel
    """
    sheet = preview_sheet(rig, scan, face, jobs)
    buffer = io.BytesIO()
    Image.fromarray(sheet).save(buffer, "png", compress_level=3)
    replace_file(path, buffer.getvalue())


def preview_sheet(rig, scan, face, jobs=2):
    """The contact sheet as (h, w, 3) uint8."""
    small = replace(rig, maps={name: _at_most(image, CLAY_MAP_PX) for name, image in rig.maps.items()})
    played, plain = small, small.plain()
    scenes = {
        "scan": Scene(scan_drawables(scan, textured=True)),
        "rig": Scene(rig_drawables(rig, textured=True)),
        "scan clay": Scene(scan_drawables(scan, textured=False)),
        "rig clay": Scene(rig_drawables(small, textured=False)),
        "fit": Scene([heat_drawable(scan, face)]),
    }
    wanted = [(name, view, camera) for name in scenes for view, camera in _head_cameras(rig).items()]
    for name in scenes:
        size = FIT_CLOSE_UP if name == "fit" else CLOSE_UP
        wanted += [(name, view, camera) for view, camera in _close_up_cameras(rig, size).items()]
    thumbnail_camera = _shape_camera(rig)
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        rendered = pool.map(lambda job: _picture(scenes[job[0]], job[2]), wanted)
        pictures = {(name, view): picture for (name, view, _), picture in zip(wanted, rendered)}
        closer = close_up_sections(played, partial(rig_drawables, textured=False), _picture, pool.map)
        shapes = list(pool.map(lambda t: _shape_cell(plain, t, thumbnail_camera), range(-1, len(plain.target_names))))
    sections = [
        _neutral_section(pictures, scan),
        _close_up_section(pictures, face),
        _fit_section(pictures),
        _shape_section(shapes),
        *closer,
    ]
    triangles = sum(len(mesh.faces) for mesh in rig.meshes)
    subtitle = f"template {rig.info.get('template', '?')}, {triangles:,} triangles, {len(plain.target_names)} shapes"
    return compose_sheet(str(rig.info.get("name", scan.name)), subtitle, sections)


def _at_most(image, pixels):
    """The image halved until it is no larger; clay pictures show eyes and teeth small, a hundred times over."""
    while min(image.shape[:2]) >= 2 * pixels:
        even = image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2].astype(np.uint16)
        pairs = even[0::2] + even[1::2]
        image = ((pairs[:, 0::2] + pairs[:, 1::2] + 2) // 4).astype(np.uint8)
    return image


def _picture(scene, camera):
    return scene.render(camera, background=BACKGROUND)


def _neutral_section(pictures, scan):
    def row(suffix, label):
        return tuple(
            Cell(pictures[name + suffix, view], f"{name}, {view}{label}") for view in VIEWS for name in ("scan", "rig")
        )

    note = "" if scan.has_texture or scan.colors is not None else "the scan has no colour"
    return Section("Neutral", (row("", ""), row(" clay", ", clay")), note)


def _close_up_section(pictures, face):
    def row(part):
        return tuple(Cell(pictures[name, part], name) for name in ("scan", "rig", "scan clay", "rig clay"))

    closed = any(face.eyes_closed.values())
    note = "the scan's lids are closed; the rig's neutral has them open" if closed else ""
    return Section("Eyes and mouth", (row("eyes"), row("mouth")), note)


def _fit_section(pictures):
    legend = color_bar(heat_colors(np.linspace(0, HEAT_LIMIT_MM, 64)), ("0 mm", "0.25", f"{HEAT_LIMIT_MM} and more"))
    cells = tuple(Cell(pictures["fit", view], view) for view in (*VIEWS, "eyes", "mouth"))
    return Section("Distance from the fit to the scan", (cells,), "grey where the scan shows nothing", legend)


def _shape_section(cells):
    rows = tuple(tuple(cells[i : i + COLUMNS]) for i in range(0, len(cells), COLUMNS))
    return Section("Shapes at weight 1", rows, "Left is the person's left: on the right in these pictures")


def _shape_cell(rig, target, camera):
    """The clay rig under one target; -1 is the neutral. mouthClose is made for an open jaw and shown with it."""
    targets = () if target < 0 else (target,)
    name = "neutral" if target < 0 else rig.target_names[target]
    if name == "mouthClose" and "jawOpen" in rig.target_names:
        targets, name = (target, rig.target_names.index("jawOpen")), "mouthClose + jawOpen"
    return Cell(_picture(Scene(rig_drawables(rig, textured=False, targets=targets)), camera), name)


def scan_drawables(scan, textured):
    """The scan as one Drawable, or one for each of its textures."""
    if textured and scan.has_texture:
        number = np.zeros(len(scan.faces), int) if scan.face_texture is None else scan.face_texture
        normals = vertex_normals(scan.vertices, scan.faces)
        drawables = []
        for i in np.unique(number):
            mine = number == i
            looks = {"texture": scan.textures[i], "uv": scan.uv, "uv_faces": scan.uv_faces[mine]} if i >= 0 else {}
            drawables.append(Drawable(scan.vertices, scan.faces[mine], normals=normals, **looks))
        return drawables
    if textured and scan.colors is not None:
        return [Drawable(scan.vertices, scan.faces, color=srgb_to_linear(scan.colors))]
    return [Drawable(scan.vertices, scan.faces)]


def rig_drawables(rig, textured, targets=()):
    """A Drawable per mesh of the rig under targets at weight 1. Clay keeps the colours of eyes, teeth and tongue."""

    def moved(mesh):
        if not targets or mesh.deltas is None:
            return mesh.vertices
        return mesh.vertices + sum(mesh.deltas[target] for target in targets)

    skin, drawables = moved(rig.meshes[0]), []
    for mesh in rig.meshes:
        material = mesh.material
        if material.alpha < 0.05 or (not textured and material.alpha < 0.9):
            continue
        vertices = moved(mesh)
        looks = {"color": material.color, "roughness": material.roughness, "opacity": material.alpha}
        if textured:
            maps = {"texture": rig.maps.get(material.albedo), "normal_map": rig.maps.get(material.normal)}
            looks |= {**maps, "uv": mesh.uv, "uv_faces": mesh.uv_faces}
        elif mesh is rig.meshes[0]:
            looks = {"color": _clay_with_dark_inside(rig, vertices)}
        elif material.albedo in rig.maps:
            looks |= {"texture": rig.maps[material.albedo], "uv": mesh.uv, "uv_faces": mesh.uv_faces}
        if not textured and mesh.name.startswith(BEHIND_LIPS):
            looks["shade"] = _shade(rig, skin, vertices)
        drawables.append(Drawable(vertices, mesh.faces, **looks))
    return drawables


def _clay_with_dark_inside(rig, vertices):
    """(n, 3) linear clay, darker inside mouth, sockets and nostrils, where no light would reach."""
    color = np.tile(CLAY_LINEAR, (len(vertices), 1))
    for name in ("mouth_interior", "socket_left", "socket_right", "nostrils"):
        if name in rig.regions:
            color[rig.regions[name]] *= INNER_SHADE
    if "mouth_interior" in rig.regions:
        inside = rig.regions["mouth_interior"]
        color[inside] *= _shade(rig, vertices, vertices[inside])[:, None]
    return color


def _shade(rig, skin, points):
    """(k,) share of the light that reaches points (k, 3) behind the lips of a posed skin (n, 3)."""
    lips = [skin[line[len(line) // 2], 2] for name, line in rig.lines.items() if name.startswith("lip_seam")]
    depth = np.maximum((max(lips) if lips else points[:, 2]) - points[:, 2], 0.0)
    return 1.0 / (1.0 + (depth / MOUTH_LIGHT_MM) ** 2)


def heat_drawable(scan, face):
    """The fit, coloured by its distance to the scan."""
    skin = face.template.skin
    n = skin.vertices[1]
    fit, faces = face.fit[:n], face.template.faces[skin.face_slice]
    shown = face.regions["outer"][:n] & face.observed[:n]
    color = np.tile(srgb_to_linear(np.array(NOT_SEEN) / 255.0), (n, 1))
    if shown.any():
        distance = Surface(scan.vertices, scan.faces).closest(fit[shown]).distance
        color[shown] = srgb_to_linear(heat_colors(distance) / 255.0)
    return Drawable(fit, faces, color=color)


def heat_colors(distance):
    """(k, 3) uint8 of distances (k,) mm."""
    place = np.clip(distance / HEAT_LIMIT_MM, 0.0, 1.0) * (len(HEAT_STOPS) - 1)
    stops = np.arange(len(HEAT_STOPS))
    return np.stack([np.interp(place, stops, HEAT_STOPS[:, i]) for i in range(3)], axis=1).round().astype(np.uint8)


def _head_cameras(rig):
    """name -> Camera that shows the whole head."""
    vertices = rig.meshes[0].vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    height, width = VIEW
    half = max((high - low)[1] / 2.0, max((high - low)[0], (high - low)[2]) / 2.0 * height / width) * 1.06
    return {name: Camera.looking_at((low + high) / 2.0, yaw, 0.0, half, VIEW) for name, yaw in VIEWS.items()}


def _close_up_cameras(rig, size):
    """Cameras on both eyes and on the mouth, framed by the rig's feature lines."""
    vertices = rig.meshes[0].vertices
    cameras = {}
    for name, prefix, middle, share in (("eyes", "lid_", (0.0, 0.0), 0.86), ("mouth", "lip_", (0.0, -65.0), 0.62)):
        points = _line_points(rig, vertices, prefix)
        if not len(points):
            points = np.array([[middle[0] - 45.0, middle[1], 0.0], [middle[0] + 45.0, middle[1], 0.0]])
        low, high = points.min(axis=0), points.max(axis=0)
        half = (high - low)[0] / 2.0 / share * CLOSE_UP[0] / CLOSE_UP[1]
        cameras[name] = Camera.looking_at((low + high) / 2.0, 0.0, 0.0, half * size[0] / CLOSE_UP[0], size)
    return cameras


def _line_points(rig, vertices, prefix):
    indices = [indices for name, indices in rig.lines.items() if name.startswith(prefix)]
    return vertices[np.concatenate(indices)] if indices else np.empty((0, 3))


def _shape_camera(rig):
    """A front view that holds the face under every target."""
    skin = rig.meshes[0]
    face = rig.regions.get("face", np.ones(len(skin.vertices), bool))
    points = skin.vertices[face]
    low, high = points.min(axis=0), points.max(axis=0)
    if skin.deltas is not None and len(skin.deltas):
        low = np.minimum(low, (points + skin.deltas[:, face].min(axis=0)).min(axis=0))
    height, width = THUMBNAIL
    center = (low + high) / 2.0
    half = max((high - low)[1] / 2.0, (high - low)[0] / 2.0 * height / width) * 1.04
    return Camera.looking_at(center, 0.0, 0.0, half, THUMBNAIL)
