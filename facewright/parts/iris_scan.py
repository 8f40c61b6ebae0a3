"""What a scan shows of its irises: where they are and what colour they have.

The centre is found as iris recognition does (Daugman 1993, the integro-differential operator): the circle across which
the light changes most, counted where the lids are open. The colour is the mean of the ring between pupil and limbus
after what is too dark or too bright for it has been left out (facial-rigs-and-stylization 2019, 3.4, with shares
instead of fixed bounds in HSV).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.mesh.closest import interpolate
from facewright.mesh.raster import RayScene
from facewright.mesh.render import sample_texture, srgb_to_linear
from facewright.parts.iris import WHITE

RADIUS_MM = (5.0, 6.6)
_STEP_MM = 0.25
_SHADE_MM = 1.2  # beside the margins: lashes and the lids' shadow
_REACH_MM = (4.0, 3.0)  # from the middle of the lids, sideways and up
_RING = (0.42, 0.80)  # shares of the iris's radius between which its colour is taken
_TRIM = (0.15, 0.9)  # quantiles of light kept in that ring
_LEAST_CONTRAST = 0.12
_LEAST_PIXELS = 60
_BESIDE, _BRIGHT = 1.1, (0.75, 0.95)  # radii from which on there is white; quantiles of light that show it, not gleams
_LIT = 0.5  # share of a white's light from which on an eye counts as lit: whites differ, and lids throw shadows
_DARKEST = 0.01  # a white darker than this says nothing
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class Iris:
    """center (2,) x, y mm; radius mm; color (3,) linear RGB; contrast of its edge, a share of the white's light.

    white (3,) linear RGB of the white beside it, as the scan shows it: in the shade of brows and lids it may be dark
    """

    center: np.ndarray
    radius: float
    color: np.ndarray
    contrast: float
    white: np.ndarray

    @property
    def whiteness(self):
        """Share in 0..1 of the light of a white in full light."""
        return float(min(1.0, self.white @ LUMINANCE / np.dot(WHITE, LUMINANCE)))

    @property
    def light(self):
        """Share in 0..1 of the light that an eye in the open has: 1 for a white as bright as can be told from one."""
        return min(1.0, self.whiteness / _LIT)

    @property
    def lit_color(self):
        """(3,) linear RGB of the iris in as much light as makes its white one: photographs have eyes in the shade."""
        return self.color * np.maximum(1.0, _LIT * np.array(WHITE) / np.maximum(self.white, _DARKEST))


def find_irises(scan, face):
    """side -> Iris of the eyes that a scan shows open and in colour; scan in our frame, face data.Face fitted to it."""
    if not scan.has_texture and scan.colors is None:
        return {}
    sides = [side for side in ("left", "right") if not face.eyes_closed.get(side, False)]
    found = {side: _find(scan, face.fit, face.lines, side) for side in sides}
    return {side: iris for side, iris in found.items() if iris is not None}


def _find(scan, vertices, lines, side):
    upper, lower = (vertices[lines[f"lid_{lid}_{side}"]] for lid in ("upper", "lower"))
    points, room = _opening(upper, lower)
    colors, met = _colors(scan, points)
    points, room, colors = points[met], room[met], colors[met]
    clear = room > _SHADE_MM
    if clear.sum() < _LEAST_PIXELS:
        return None
    light = colors @ LUMINANCE
    center, radius, contrast = _circle(points[clear], light[clear], np.concatenate([upper, lower])[:, :2].mean(axis=0))
    if contrast < _LEAST_CONTRAST:
        return None
    distance = np.linalg.norm(points - center, axis=1) / radius
    ring = clear & (distance > _RING[0]) & (distance < _RING[1])
    if ring.sum() < _LEAST_PIXELS:
        return None
    low, high = np.quantile(light[ring], _TRIM)
    kept = ring & (light >= low) & (light <= high)
    beside = clear & (distance > _BESIDE)
    if not beside.any():
        return None
    low, high = np.quantile(light[beside], _BRIGHT)
    white = colors[beside & (light >= low) & (light <= high)].mean(axis=0)
    return Iris(center, radius, colors[kept].mean(axis=0), contrast, white)


def _opening(upper, lower):
    """Pixels (k, 2) between two margins seen from the front, and (k,) mm to the nearer margin, up or down."""
    both = np.concatenate([upper, lower])
    x = np.arange(both[:, 0].min(), both[:, 0].max(), _STEP_MM)
    y = np.arange(both[:, 1].min(), both[:, 1].max(), _STEP_MM)
    top, bottom = (np.interp(x, *line[np.argsort(line[:, 0])][:, :2].T) for line in (upper, lower))
    room = np.minimum(top[None] - y[:, None], y[:, None] - bottom[None])
    inside = room > 0
    X, Y = np.meshgrid(x, y)
    return np.stack([X[inside], Y[inside]], axis=1), room[inside]


def _colors(scan, points):
    """Linear RGB (k, 3) of the scan seen from the front at points (k, 2), and (k,) bool: it has a colour there."""
    origins = np.column_stack([points, np.full(len(points), scan.vertices[:, 2].max() + 50.0)])
    hits = RayScene(scan.vertices, scan.faces).cast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
    met = hits.face >= 0
    colors = np.zeros((len(points), 3))
    if not scan.has_texture:
        at = np.flatnonzero(met)
        colors[at] = srgb_to_linear(interpolate(scan.colors, scan.faces, hits.face[at], hits.barycentric[at]))
        return colors, met
    number = np.zeros(len(scan.faces), int) if scan.face_texture is None else scan.face_texture
    met &= number[np.maximum(hits.face, 0)] >= 0
    for texture in np.unique(number[hits.face[met]]):
        at = np.flatnonzero(met & (number[np.maximum(hits.face, 0)] == texture))
        uv = interpolate(scan.uv, scan.uv_faces, hits.face[at], hits.barycentric[at])
        colors[at] = srgb_to_linear(sample_texture(scan.textures[texture], uv)[:, :3] / 255.0)
    return colors, met


def _circle(points, light, middle):
    """Centre (2,), radius and contrast of the best iris edge among points (k, 2) with light (k,)."""
    white = max(float(np.quantile(light, 0.95)), 1e-6)
    best, place = -1.0, (middle, RADIUS_MM[0])
    step, reach, radii = 0.6, np.array(_REACH_MM), np.arange(*RADIUS_MM, 0.2)
    for _ in range(3):
        x, y = (np.arange(-r, r + 1e-9, step) for r in reach)
        center = place[0]
        for shift in np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 2):
            distance = np.linalg.norm(points - center - shift, axis=1)
            for radius in radii:
                inner = (distance > 0.72 * radius) & (distance < radius - 0.2)
                outer = (distance > radius + 0.4) & (distance < radius + 1.4)
                if inner.sum() < _LEAST_PIXELS / 2 or outer.sum() < _LEAST_PIXELS / 2:
                    continue
                score = (light[outer].mean() - light[inner].mean()) / white
                # An iris is one dark disc: whatever is as dark as it outside speaks against the circle.
                score -= 0.5 * (light[outer] < light[inner].mean()).mean()
                if score > best:
                    best, place = score, (center + shift, float(radius))
        step, reach = step / 3, np.full(2, step)
        radii = np.clip(place[1] + np.linspace(-0.2, 0.2, 5), *RADIUS_MM)
    return *place, best
