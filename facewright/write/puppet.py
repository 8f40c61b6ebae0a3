"""A rig to be pictured in any pose, in colour or in clay."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np

from facewright.evaluate.play import Player
from facewright.mesh.adjacency import differing, dilate
from facewright.mesh.scene import CLAY_LINEAR, Drawable, Scene
from facewright.mesh.winding import winding_numbers
from facewright.write.sheet import PANEL

BACKGROUND = tuple(c / 255.0 for c in PANEL)
INNER_SHADE = 0.2
LEAST_LIGHT = 0.15  # behind shut lips
OUTSIDE = 5.0  # times that share counts before the opening, as at a tongue that is out: there the rest is open as well
ALL_SEEN = 0.45  # share of half a sphere that the mouth's opening takes where all of the light comes in
BEHIND_LIPS = ("teeth_", "gums_", "tongue")
CLAY_MAP_PX = 256
_LEAST_ALPHA, _CLEAR, _SOLID = 0.05, 0.1, 0.9  # less is not shown; less only shines, as a cornea; clay


class Puppet:
    """A Rig that stands ready: a pose only moves what it moves."""

    def __init__(self, rig, textured=False):
        self._rig, self._textured, self._meshes = rig, textured, shown_meshes(rig, textured)
        self._players = {full: Player(rig, full) for full in (True, False)}
        self.scene = Scene(rig_drawables(rig, textured))
        self._rest = [mesh.vertices for mesh in self._meshes], self._shades([mesh.vertices for mesh in self._meshes])
        self._stills, self._drawing = {}, threading.Lock()

    def posed(self, weights, camera, full=True):
        """The Scene under dict shape -> weight, for one camera; full: with in-betweens and correctives."""
        vertices = self._players[full].meshes(self._meshes, weights)
        return self.scene.posed(vertices, camera, self._shades(vertices))

    def picture(self, weights, camera, full=True):
        """(h, w, 3) uint8 of a pose on the ground of a contact sheet.

        What the pose leaves alone is taken from the neutral's picture, which changes no pixel.
        """
        vertices = self._players[full].meshes(self._meshes, weights)
        shades = self._shades(vertices)
        image, window = np.array(self._still(camera)), self._touched(vertices, shades, camera)
        if window is not None:
            top, bottom, left, right = window
            # Whether a pixel lies on an edge is seen beside its neighbours: one more on each side.
            above, before = min(top, 1), min(left, 1)
            height, width = camera.size
            around = (top - above, min(bottom + 1, height), left - before, min(right + 1, width))
            closer = replace(camera, window=around)
            drawn = picture(self.scene.posed(vertices, closer, shades), closer)
            image[top:bottom, left:right] = drawn[above:, before:][: bottom - top, : right - left]
        return image

    def _shades(self, vertices):
        return [None] * len(vertices) if self._textured else mouth_shades(self._rig, vertices)

    def _still(self, camera):
        """The picture of the neutral, drawn once for a camera."""
        key = (camera.R.tobytes(), camera.center.tobytes(), camera.half_height, camera.size)
        with self._drawing:
            if key not in self._stills:
                self._stills[key] = picture(self.scene.posed(self._rest[0], camera, self._rest[1]), camera)
            return self._stills[key]

    def _touched(self, vertices, shades, camera):
        """(top, bottom, left, right) of the pixels that may differ from the neutral's; None if there are none."""
        corners = []
        for mesh, now, shade, rest, lit in zip(self._meshes, vertices, shades, *self._rest):
            if now is rest and shade is lit:
                continue
            touched = differing(now, rest)
            if shade is not None:
                touched |= shade != lit
            # A vertex turns the normals of its neighbours, which light the faces around them.
            touched = dilate(touched, mesh.faces, 2)
            corners += [rest[touched], now[touched]]
        corners = np.concatenate(corners) if corners else np.zeros((0, 3))
        if not len(corners):
            return None
        pixels = camera.project(corners)[0]
        height, width = camera.size
        first = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, (width, height)).astype(int)
        last = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, (width, height)).astype(int)
        return (first[1], last[1], first[0], last[0]) if (first < last).all() else None


def picture(scene, camera):
    """(h, w, 3) uint8 of a Scene on the ground of a contact sheet."""
    return scene.render(camera, background=BACKGROUND)


def shown_meshes(rig, textured):
    """The meshes of a rig that are seen; clay is not seen through, but for what does no more than shine."""
    return [
        mesh
        for mesh in rig.meshes
        if mesh.material.alpha >= _LEAST_ALPHA
        and (textured or mesh.material.alpha >= _SOLID or mesh.material.alpha < _CLEAR)
    ]


def rig_drawables(rig, textured):
    """A Drawable for each of shown_meshes. Clay keeps the colours of eyes, teeth and tongue."""
    drawables, meshes = [], shown_meshes(rig, textured)
    shades = [None] * len(meshes) if textured else mouth_shades(rig, [mesh.vertices for mesh in meshes])
    for mesh, shade in zip(meshes, shades):
        material = mesh.material
        looks = {"color": material.color, "roughness": material.roughness, "opacity": material.alpha}
        if textured:
            maps = {"texture": rig.maps.get(material.albedo), "normal_map": rig.maps.get(material.normal)}
            looks |= {**maps, "uv": mesh.uv, "uv_faces": mesh.uv_faces}
        elif mesh is rig.meshes[0]:
            looks = {"color": _clay_with_dark_inside(rig)}
        elif material.albedo in rig.maps:
            looks |= {
                "texture": _at_most(rig.maps[material.albedo], CLAY_MAP_PX),
                "normal_map": rig.maps.get(material.normal),
                "uv": mesh.uv,
                "uv_faces": mesh.uv_faces,
            }
        drawables.append(Drawable(mesh.vertices, mesh.faces, shade=shade, **looks))
    return drawables


def mouth_shades(rig, vertices):
    """A share of the light (n,), or None for all of it, for each mesh that clay shows: what comes in between the lips.

    vertices: the posed (n, 3) of shown_meshes, the skin first
    """
    skin, inside = vertices[0], rig.regions.get("mouth_interior")
    opening = _opening(rig)
    # Painted parts have half of their shade in their maps (parts.mouth_light), the bare lining none.
    shades = [
        _shade(skin, opening, now) ** 0.5 if mesh.name.startswith(BEHIND_LIPS) else None
        for mesh, now in zip(shown_meshes(rig, textured=False), vertices)
    ]
    if inside is not None:
        shades[0] = np.ones(len(skin))
        shades[0][inside] = _shade(skin, opening, skin[inside])
    return shades


def _opening(rig):
    """(m, 3) faces that span the skin's mouth from one line of the lips to the other; none without those lines."""
    if not {"lip_seam_upper", "lip_seam_lower"} <= set(rig.lines):
        return np.zeros((0, 3), int)
    upper, lower = (np.asarray(rig.lines[f"lip_seam_{lip}"]) for lip in ("upper", "lower"))
    strips = (upper[:-1], lower[:-1], upper[1:]), (upper[1:], lower[:-1], lower[1:])
    return np.concatenate([np.stack(strip, axis=1) for strip in strips])


def _shade(skin, opening, points):
    """(k,) share of the light that reaches points (k, 3) through the opening (m, 3) of a posed skin (n, 3)."""
    if not len(opening):
        return np.ones(len(points))
    seen = 2.0 * winding_numbers(skin, opening, points)  # share of half a sphere; less than 0 before the opening
    seen = np.where(seen < 0.0, -OUTSIDE * seen, seen)
    return LEAST_LIGHT + (1.0 - LEAST_LIGHT) * np.minimum(seen / ALL_SEEN, 1.0)


def _clay_with_dark_inside(rig):
    """(n, 3) linear clay, darker inside mouth, sockets and nostrils, where no light would reach."""
    color = np.tile(CLAY_LINEAR, (len(rig.meshes[0].vertices), 1))
    for name in ("mouth_interior", "socket_left", "socket_right", "nostrils"):
        if name in rig.regions:
            color[rig.regions[name]] *= INNER_SHADE
    return color


def _at_most(image, pixels):
    """The image halved until it is no larger; clay pictures show eyes and teeth small, a hundred times over."""
    while min(image.shape[:2]) >= 2 * pixels:
        even = image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2].astype(np.uint16)
        pairs = even[0::2] + even[1::2]
        image = ((pairs[:, 0::2] + pairs[:, 1::2] + 2) // 4).astype(np.uint8)
    return image
