"""preview.png: the rig beside the scan, close-ups, the distance between them, and every shape."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from facewright.evaluate.shapes import shape_names
from facewright.mesh.closest import Surface
from facewright.mesh.normals import vertex_normals
from facewright.mesh.raster import Camera
from facewright.mesh.render import srgb_to_linear
from facewright.mesh.scene import Drawable, Scene
from facewright.write.close_ups import close_up_sections
from facewright.write.files import replace_file
from facewright.write.puppet import Puppet, picture, rig_drawables
from facewright.write.sheet import Cell, Section, color_bar, compose_sheet

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


def write_preview(rig, scan, face, path, title=None, closer=None):
    """Write a contact sheet of a Rig (data.Rig) made from a Scan through a Face, as PNG.

    The whole face is shown under the plain shapes, the close-ups as in-betweens and correctives play them.

    scan   in our frame, as the face was fitted to it
    title  over the sheet; default: the scan's name
    closer gives what draw_close_ups does for the rig, if that is drawn elsewhere; asked for last
    """
    sheet = preview_sheet(rig, scan, face, title, closer)
    buffer = io.BytesIO()
    Image.fromarray(sheet).save(buffer, "png", compress_level=3)
    replace_file(path, buffer.getvalue())


def preview_sheet(rig, scan, face, title=None, closer=None):
    """The contact sheet as (h, w, 3) uint8."""
    clay = Puppet(rig)
    scenes = {
        "scan": Scene(scan_drawables(scan, textured=True)),
        "rig": Scene(rig_drawables(rig, textured=True)),
        "scan clay": Scene(scan_drawables(scan, textured=False)),
        "rig clay": clay.scene,
        "fit": Scene([heat_drawable(scan, face)]),
    }
    wanted = [(name, view, camera) for name in scenes for view, camera in _head_cameras(rig).items()]
    for name in scenes:
        size = FIT_CLOSE_UP if name == "fit" else CLOSE_UP
        wanted += [(name, view, camera) for view, camera in _close_up_cameras(rig, size).items()]
    shapes, shape_camera = shape_names(rig), _shape_camera(rig)
    pictures = {(name, view): picture(scenes[name], camera) for name, view, camera in wanted}
    cells = [_shape_cell(clay, name, shapes, shape_camera) for name in (None, *shapes)]
    sections = [
        _neutral_section(pictures, scan),
        _close_up_section(pictures, face),
        _fit_section(pictures),
        _shape_section(cells),
        *(closer() if closer else close_up_sections(rig, clay)),
    ]
    triangles = sum(len(mesh.faces) for mesh in rig.meshes)
    subtitle = f"template {rig.info.get('template', '?')}, {triangles:,} triangles, {_counted(rig, shapes)}"
    return compose_sheet(title or scan.name, subtitle, sections)


def draw_close_ups(rig):
    """The close-ups of a preview, half of its work, for who wants to draw them beside the rest."""
    return close_up_sections(rig, Puppet(rig))


def _counted(rig, shapes):
    """ "52 shapes", and how many more targets rig/ and --shapes full have for them."""
    more = len(rig.target_names) - len(shapes)
    return f"{len(shapes)} shapes" + (f" (and {more} halves, in-betweens and correctives)" if more else "")


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


def _shape_cell(clay, name, names, camera):
    """The clay rig under one plain shape, None the neutral. mouthClose is made for an open jaw and shown with it."""
    weights, label = ({}, "neutral") if name is None else ({name: 1.0}, name)
    if name == "mouthClose" and "jawOpen" in names:
        weights["jawOpen"], label = 1.0, "mouthClose (jaw open)"
    return Cell(clay.picture(weights, camera, full=False), label)


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
