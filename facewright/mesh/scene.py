"""Several meshes in one picture, with textures, normal maps, gloss and transparency: previews and documentation.

One ray per pixel and, where a pixel differs from its neighbours, four: smooth outlines at a third of the cost of
supersampling everything.
"""

from __future__ import annotations

import copy
import threading
from dataclasses import dataclass

import numpy as np

from facewright.mesh.adjacency import touching
from facewright.mesh.normals import normalized, vertex_normals
from facewright.mesh.raster import RayScene
from facewright.mesh.render import BACKGROUND, CLAY, LIGHTS, linear_to_srgb, srgb_to_linear
from facewright.mesh.tangents import corner_tangents, from_tangent_space

CLAY_LINEAR = srgb_to_linear(np.array(CLAY))
AMBIENT = 0.16
MAX_LAYERS = 12
ONWARD_MM = 0.002
"""Behind what is seen through, which single precision tells 100 times finer; what lies nearer is looked for by itself,
since a strip may lie on the skin."""
MIN_ROUGHNESS = 0.18
EDGE_THRESHOLD = 0.04
RAY_CHUNK = 1 << 17


@dataclass(frozen=True)
class Drawable:
    """A mesh and how it looks.

    vertices (n, 3) mm, faces (m, 3)
    color      linear RGB 0..1: (3,) or (n, 3); default clay
    texture    (h, w, 3 or 4) uint8 sRGB, takes the place of color; a fourth channel is opacity
    normal_map (h, w, 3) uint8, tangent space, +Y; both with uv (t, 2), v up, and uv_faces (m, 3)
    roughness  0..1: below about 0.5 a highlight shows
    opacity    0..1
    shade      (n,) share of the light that comes so deep
    normals    (n, 3), default area-weighted vertex normals
    """

    vertices: np.ndarray
    faces: np.ndarray
    color: tuple[float, float, float] | np.ndarray | None = None
    texture: np.ndarray | None = None
    normal_map: np.ndarray | None = None
    uv: np.ndarray | None = None
    uv_faces: np.ndarray | None = None
    roughness: float = 0.7
    opacity: float = 1.0
    shade: np.ndarray | None = None
    normals: np.ndarray | None = None


class Scene:
    """Drawables ready to be seen by any number of raster.Camera.

    camera  the only one that will look: faces that cannot come into its picture are left out, which changes no pixel
    """

    def __init__(self, drawables, camera=None):
        self.drawables = tuple(drawables)
        offsets = np.cumsum([0] + [len(d.vertices) for d in self.drawables])
        self.faces = np.concatenate([d.faces + offset for d, offset in zip(self.drawables, offsets)])
        self.first_face = np.cumsum([0] + [len(d.faces) for d in self.drawables])
        self._colors = np.concatenate([_vertex_colors(d) for d in self.drawables], dtype=np.float32)
        self._looks = [_Looks(d) for d in self.drawables]
        self._stand([d.vertices for d in self.drawables], [d.shade for d in self.drawables], camera)

    def posed(self, vertices, camera=None, shades=None):
        """The Scene with other vertices: a sequence of (n, 3), one for each drawable; shades likewise, (n,) or None."""
        scene = copy.copy(self)
        scene._stand(vertices, shades or [d.shade for d in self.drawables], camera)
        return scene

    def _stand(self, vertices, shades, camera):
        """Make ready what depends on the vertices."""
        every = np.concatenate(vertices)
        self._near = np.arange(len(self.faces)) if camera is None else camera.in_picture(every, self.faces)
        self.rays = RayScene(every, self.faces[self._near])
        bounds = np.searchsorted(self._near, self.first_face)
        normals = []
        for i, (drawable, now) in enumerate(zip(self.drawables, vertices)):
            if now is drawable.vertices and drawable.normals is not None:
                normals.append(drawable.normals)
            else:
                normals.append(
                    _normals_of(now, drawable.faces, self._near[slice(*bounds[i : i + 2])] - self.first_face[i])
                )
        light = [np.ones(len(now)) if shade is None else shade for now, shade in zip(vertices, shades)]
        self._vertices, self._solid = every, None
        self._looks_at = np.concatenate(
            [np.concatenate(normals), self._colors, np.concatenate(light)[:, None]], axis=1, dtype=np.float32
        )
        self._frames = [looks.frames(now, normal) for looks, now, normal in zip(self._looks, vertices, normals)]

    def render(self, camera, *, unlit=False, background=BACKGROUND):
        """A picture (h, w, 3) uint8 sRGB of what the camera looks at."""
        top, bottom, left, right = camera.looked_at
        origins, directions = camera.rays()
        pixel = 2 * camera.half_height / camera.size[0]
        image = self._trace(origins, directions, camera, pixel, unlit, background)
        image = image.reshape(bottom - top, right - left, 3)
        edges = np.flatnonzero(_edges(image))
        if len(edges):
            corners = pixel / 4 * np.array([(-1, 1), (1, 1), (-1, -1), (1, -1)]) @ camera.R[:2]
            moved = (origins[edges] + corners[:, None]).reshape(-1, 3)
            directions = np.broadcast_to(-camera.R[2], moved.shape)
            samples = self._trace(moved, directions, camera, pixel, unlit, background)
            image.reshape(-1, 3)[edges] = samples.reshape(4, -1, 3).sum(axis=0) / 4
        return np.clip(np.rint(linear_to_srgb(image) * 255), 0, 255).astype(np.uint8)

    def _trace(self, origins, directions, camera, pixel_mm, unlit, background):
        """(k, 3) float32 linear colours along rays."""
        back = srgb_to_linear(np.array(background)).astype(np.float32)
        result = np.empty((len(origins), 3), np.float32)
        for start in range(0, len(origins), RAY_CHUNK):
            piece = slice(start, start + RAY_CHUNK)
            result[piece] = self._trace_chunk(origins[piece], directions[piece], camera, pixel_mm, unlit, back)
        return result

    def _trace_chunk(self, origins, directions, camera, pixel_mm, unlit, background):
        image = np.zeros((len(origins), 3), np.float32)
        through = np.ones(len(origins), np.float32)
        active = np.arange(len(origins))
        start, way = origins, directions
        for layer in range(MAX_LAYERS):
            hits = self.rays.cast(start, way)
            if layer > 0:
                self._find_passed(hits, start, way)
            hits_at = np.flatnonzero(hits.face >= 0)
            active = active[hits_at]
            if not len(active):
                break
            face, barycentric = self._near[hits.face[hits_at]], hits.barycentric[hits_at].astype(np.float32)
            color, opacity = self._shade(face, barycentric, camera, pixel_mm, unlit)
            light = through[active]
            image[active] += color * light[:, None]
            light *= 1.0 - opacity
            through[active] = light
            onward = light > 0.01
            active, hits_at = active[onward], hits_at[onward]
            way = directions[active]
            start = start[hits_at] + way * (hits.distance[hits_at] + ONWARD_MM)[:, None]
            if not len(active):
                break
        return image + through[:, None] * background

    def _find_passed(self, hits, start, way):
        """Put into hits what hides all behind it and lies where the rays have just passed something see-through."""
        if self._solid is None:
            through = np.repeat([looks.seen_through for looks in self._looks], np.diff(self.first_face))[self._near]
            corners = self._vertices[self.faces[self._near]]
            low, high = corners[through].min(axis=(0, 1)), corners[through].max(axis=(0, 1))
            beside = (corners.min(axis=1) > high + ONWARD_MM) | (corners.max(axis=1) < low - ONWARD_MM)
            at = np.flatnonzero(~through & ~beside.any(axis=1))
            self._solid = at, RayScene(self._vertices, self.faces[self._near[at]]) if len(at) else None
        at, rays = self._solid
        if rays is None:
            return
        found = rays.cast(start - 2.0 * ONWARD_MM * way, way, 2.0 * ONWARD_MM)
        passed = np.flatnonzero(found.face >= 0)
        hits.face[passed], hits.barycentric[passed] = at[found.face[passed]], found.barycentric[passed]
        hits.distance[passed] = found.distance[passed] - 2.0 * ONWARD_MM

    def _shade(self, face, barycentric, camera, pixel_mm, unlit):
        """What hits add to a picture, linear (k, 3), and their opacities (k,)."""
        mixed = _mix(self._looks_at, self.faces[face], barycentric)
        normal, color, shade = normalized(mixed[:, :3]), mixed[:, 3:6], mixed[:, 6:]
        opacity, there = np.ones((2, len(face)), np.float32)
        gloss = np.zeros(len(face), np.float32)
        owner = np.searchsorted(self.first_face, face, side="right") - 1
        for number in np.unique(owner):
            chosen = slice(None) if len(self.drawables) == 1 else np.flatnonzero(owner == number)
            local = face[chosen] - self.first_face[number]
            looks = self._looks[number]
            opacity[chosen] = looks.opacity
            gloss[chosen] = looks.roughness
            if looks.needs_uv:
                uv = _mix_corners(looks.uv_corners, local, barycentric[chosen])
                if looks.texture is not None:
                    color[chosen], there[chosen] = looks.albedo(uv, pixel_mm)
                if looks.normal_map is not None:
                    frames = self._frames[number]
                    normal[chosen] = looks.bent(frames, normal[chosen], local, barycentric[chosen], uv, pixel_mm)
        opacity *= there
        if unlit:
            return color * opacity[:, None], opacity
        # What is clear, as a cornea, mirrors as much as if it were not; a map's alpha says that nothing is there.
        local = normal @ camera.R.T.astype(np.float32)
        return shade * (_matt(local, color) * opacity[:, None] + (_shine(local, gloss) * there)[:, None]), opacity


class _Looks:
    """A drawable's maps, at every size that pictures ask for."""

    def __init__(self, drawable):
        self.roughness, self.opacity = drawable.roughness, drawable.opacity
        self.texture, self.normal_map = drawable.texture, drawable.normal_map
        self.needs_uv = drawable.uv is not None and (self.texture is not None or self.normal_map is not None)
        with_alpha = self.needs_uv and self.texture is not None and self.texture.shape[2] == 4
        self.seen_through = self.opacity < 1.0 or with_alpha
        self._levels = {"texture": [self.texture], "normal_map": [self.normal_map]}
        self._growing = threading.Lock()
        if not self.needs_uv:
            self.texture = self.normal_map = None
            return
        self._mesh = drawable.faces, drawable.uv, drawable.uv_faces
        self.uv_corners = drawable.uv[drawable.uv_faces].astype(np.float32)
        self._uv_per_mm = _median_uv_per_mm(drawable)

    def frames(self, vertices, normals):
        """Tangents and signs of the corners of a drawable with a normal map as it stands now, else None."""
        if self.normal_map is None:
            return None
        faces, uv, uv_faces = self._mesh
        return tuple(array.astype(np.float32) for array in corner_tangents(vertices, faces, normals, uv, uv_faces))

    def albedo(self, uv, pixel_mm):
        """Linear colours (k, 3) and the map's own opacities (k,), 1 where it has none."""
        sample = _bilinear(self._level("texture", pixel_mm), uv) / np.float32(255.0)
        return srgb_to_linear(sample[:, :3]), sample[:, 3] if sample.shape[1] == 4 else np.float32(1.0)

    def bent(self, frames, normal, face, barycentric, uv, pixel_mm):
        """Normals (k, 3) turned by the normal map."""
        tangents, signs = frames
        sample = (_bilinear(self._level("normal_map", pixel_mm), uv) - 128.0) / np.float32(127.0)
        tangent = normalized(_mix_corners(tangents, face, barycentric))
        return from_tangent_space(sample, normal, tangent, signs[face])

    def _level(self, name, pixel_mm):
        """The map, halved until its texels are about as large as the picture's pixels."""
        levels = self._levels[name]
        texels_per_pixel = self._uv_per_mm * levels[0].shape[0] * pixel_mm
        wanted = int(np.clip(np.rint(np.log2(max(texels_per_pixel, 1.0))), 0, 8))
        with self._growing:  # threads that look at the same thing must not halve it twice
            while len(levels) <= wanted and min(levels[-1].shape[:2]) > 1:
                image = levels[-1][: levels[-1].shape[0] // 2 * 2, : levels[-1].shape[1] // 2 * 2].astype(np.uint16)
                pairs = image[0::2] + image[1::2]
                levels.append(((pairs[:, 0::2] + pairs[:, 1::2] + 2) // 4).astype(np.uint8))
        return levels[min(wanted, len(levels) - 1)]


def _normals_of(vertices, faces, chosen):
    """(n, 3) normals of vertices (n, 3), right at the corners of the chosen faces (k,)."""
    if len(chosen) < len(faces):
        touched = np.zeros(len(vertices), bool)
        touched[faces[chosen]] = True
        faces = faces[touching(touched, faces)]
    return vertex_normals(vertices, faces)


def _vertex_colors(drawable):
    color = CLAY_LINEAR if drawable.color is None else drawable.color
    return np.broadcast_to(color, (len(drawable.vertices), 3))


def _median_uv_per_mm(drawable):
    a, b, c = (drawable.vertices[drawable.faces[:, i]] for i in range(3))
    surface = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    p, q, r = (drawable.uv[drawable.uv_faces[:, i]] for i in range(3))
    in_map = np.abs((q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0])
    return float(np.median(np.sqrt(in_map / np.maximum(surface, 1e-12))))


def _mix(values, corners, barycentric):
    """Values (n, c) at (k, 3) corners weighted by (k, 3): (k, c)."""
    result = values[corners[:, 0]] * barycentric[:, :1]
    result += values[corners[:, 1]] * barycentric[:, 1:2]
    result += values[corners[:, 2]] * barycentric[:, 2:]
    return result


def _mix_corners(values, face, barycentric):
    """Values (m, 3, c) kept per corner, at (k,) faces weighted by (k, 3): (k, c)."""
    return _mix(values.reshape(-1, values.shape[-1]), face[:, None] * 3 + np.arange(3), barycentric)


def _bilinear(image, uv):
    """(k, c) float32 in 0..255, v up, repeating."""
    height, width = image.shape[:2]
    x, y = uv[:, 0] * width - 0.5, (1.0 - uv[:, 1]) * height - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    left, top = x0.astype(np.int64) % width, y0.astype(np.int64) % height
    right, bottom = (left + 1) % width, (top + 1) % height
    flat = image.reshape(height * width, -1)
    upper = flat[top * width + left] * (1 - fx) + flat[top * width + right] * fx
    lower = flat[bottom * width + left] * (1 - fx) + flat[bottom * width + right] * fx
    return upper * (1 - fy) + lower * fy


def _matt(local, color):
    """Linear colours of camera-space normals (k, 3) under the lights: Lambert."""
    light = np.full(len(local), AMBIENT, np.float32)
    for x, y, z, strength in LIGHTS:
        light += np.float32(strength) * np.maximum(local @ _unit(x, y, z), 0.0)
    return color * light[:, None]


def _shine(local, roughness):
    """(k,) the key light's highlight on smooth surfaces with camera-space normals (k, 3) (Blinn-Phong; three lights
    would put three dots into an eye)."""
    result = np.zeros(len(local), np.float32)
    glossy = np.flatnonzero(roughness < 0.5)
    if len(glossy):
        x, y, z, strength = LIGHTS[0]
        power = 2.0 / np.maximum(roughness[glossy], MIN_ROUGHNESS) ** 4 - 2.0
        facing = np.maximum(local[glossy] @ _unit(*(_unit(x, y, z) + [0, 0, 1])), 0.0)
        result[glossy] = np.minimum(strength * 0.04 * (power + 2.0) / 8.0 * facing**power, 2.0)
    return result


def _unit(x, y, z):
    return np.array([x, y, z], np.float32) / np.float32(np.sqrt(x * x + y * y + z * z))


def _edges(image):
    """(h, w) bool: pixels that differ from a neighbour by more than the eye forgives (image (h, w, 3) linear)."""
    tone = np.sqrt(np.maximum(image, 0.0)).sum(axis=2)
    edges = np.zeros(tone.shape, bool)
    across = np.abs(np.diff(tone, axis=1)) > 3 * EDGE_THRESHOLD
    down = np.abs(np.diff(tone, axis=0)) > 3 * EDGE_THRESHOLD
    edges[:, 1:] |= across
    edges[:, :-1] |= across
    edges[1:] |= down
    edges[:-1] |= down
    return edges
