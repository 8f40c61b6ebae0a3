"""Small textures of the mouth's parts, painted in the part's own UVs: what a material asks for by `paint`.

Nothing here knows a template: docs/template.md says how a part's UVs must run for each kind of paint. Colours are sRGB
as one sees them, in full light: the shade of the mouth comes on top (mouth_light).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from facewright.mesh.render import linear_to_srgb
from facewright.parts.paint_lids import paint_blend, paint_lashes, paint_occlusion

_IVORY, _NECK, _EDGE = (0.93, 0.905, 0.855), (0.90, 0.85, 0.775), (0.885, 0.885, 0.87)  # shades A1 to A2
_GUM, _MARGIN, _FOLD = (0.78, 0.49, 0.47), (0.83, 0.58, 0.55), (0.66, 0.29, 0.30)
_TONGUE, _COAT, _BENEATH = (0.76, 0.43, 0.43), (0.80, 0.58, 0.56), (0.66, 0.31, 0.33)
_THROAT = (0.48, 0.18, 0.17)


def paint_teeth(look, size=1024):
    """(size, size, 3) uint8 sRGB. look["cells"] = (columns, rows): a tooth a cell, columns from the midline to the
    back, upper left, upper right, lower left, lower right from the top. In a cell u goes round (0.5 the outer face), v
    from the neck (1) to the edge (0.18) and the chewing surface (0).
    """
    columns, rows = look["cells"]
    u, v = _grid(size)
    column, row = np.floor(u * columns), np.floor((1 - v) * rows)
    u, down = u * columns - column, (1 - v) * rows - row
    t = down / 0.82  # 0 inside the gum, 0.18 at the neck, 1 at the edge
    color = _mix(_IVORY, _NECK, _step(np.maximum(0.5 - 0.08 * column, 0.25), 0.1, t)[..., None] * 0.85)
    front = _step(3.5, 2.5, column)
    edge = (_step(0.72, 0.98, t) * front)[..., None]
    color = _mix(color, _EDGE, 0.6 * edge)
    # Growth lobes of the edge, faint streaks of the enamel, some teeth a little yellower than others.
    lobes = np.exp(-(((np.abs(u - 0.5) - 0.07) / 0.035) ** 2))
    color = color * (1 - 0.03 * (lobes * _step(0.5, 0.9, t) * front))[..., None]
    streaks = _noise(size, (22, 2), 1) * 0.012 + _noise(size, (9, 9), 2) * 0.012
    color = color * (1 + streaks)[..., None]
    own = np.random.default_rng(3).standard_normal((rows, columns))[row.astype(int), column.astype(int)]
    yellow = 0.012 + 0.006 * own + 0.01 * (column == 2)
    color = color * (1 - yellow[..., None] * [0.35, 0.6, 1.6])
    grooves = _step(0.80, 0.97, down) * (1 - front)
    color = color * (1 - 0.12 * grooves)[..., None]
    color = color * (1 - 0.35 * _step(0.26, 0.10, t))[..., None]  # the gum's shade
    return _image(color)


def plain_map(color, size=512):
    """(size, size, 3) uint8 sRGB of one linear colour."""
    return _image(np.broadcast_to(linear_to_srgb(np.asarray(color)), (size, size, 3)))


def paint_gums(look, size=512):
    """(size, size, 3) uint8 sRGB: u along the arch, v from 1 at the fold under the lip to 0.55 at the outer and 0.3 at
    the inner margin, to 0 at the palate or the floor of the mouth."""
    _, v = _grid(size)
    color = _mix(_GUM, _FOLD, _step(0.82, 0.98, v)[..., None])
    margin = np.exp(-(((v - 0.62) / 0.06) ** 2))[..., None]
    color = _mix(color, _MARGIN, 0.6 * margin)
    stipple = _noise(size, (1.2, 1.2), 4) * 0.02 + _noise(size, (14, 14), 5) * 0.03
    vessels = np.abs(_noise(size, (10, 3), 6))
    color = color * (1 + stipple)[..., None]
    color = color * (1 - 0.10 * (np.exp(-((vessels / 0.12) ** 2)) * _step(0.75, 0.95, v))[..., None] * [0.3, 1, 1])
    return _image(color)


def paint_tongue(look, size=512):
    """(size, size, 3) uint8 sRGB: u once around with 0.5 along the middle of the upper side, v from root to tip."""
    u, v = _grid(size)
    side = np.abs(u - 0.5) * 2  # 0 on top, 0.5 at the edges, 1 beneath
    color = _mix(_TONGUE, _BENEATH, _step(0.42, 0.62, side)[..., None])
    coat = _step(0.42, 0.1, side) * _step(0.98, 0.72, v)
    color = _mix(color, _COAT, (0.75 * coat * (0.75 + 0.25 * _noise(size, (12, 8), 7)))[..., None])
    papillae = _noise(size, (1.0, 1.0), 8)
    spots = np.clip(_noise(size, (1.6, 1.6), 9) - 1.6, 0, 1) * _step(0.5, 0.3, side) * _step(0.45, 0.95, v)
    color = color * (1 + 0.05 * papillae * _step(0.6, 0.4, side))[..., None]
    color = color * (1 - 0.35 * spots[..., None] * [0.2, 1, 1])
    groove = np.exp(-((side / 0.03) ** 2)) * _step(0.97, 0.6, v)
    color = color * (1 - 0.16 * groove)[..., None]
    veins = np.exp(-(((side - 0.86) / 0.03) ** 2)) * _step(0.4, 0.7, v)
    color = _mix(color, (0.45, 0.26, 0.36), 0.4 * veins[..., None])
    # What drops into the throat is as dark as that, or it would stand behind the tongue like a wall.
    return _image(_mix(color, _THROAT, _step(0.32, 0.16, v)[..., None]))


PAINTERS = {
    "teeth": paint_teeth,
    "gums": paint_gums,
    "tongue": paint_tongue,
    "lashes": paint_lashes,
    "occlusion": paint_occlusion,
    "blend": paint_blend,
}


def _grid(size):
    """u, v (size, size) of texel centres; row 0 is v = 1."""
    at = (np.arange(size) + 0.5) / size
    return np.meshgrid(at, 1 - at)


def _noise(size, grain, seed):
    """(size, size) smooth noise of unit variance; grain (rows, columns) texels at 512; tiles."""
    white = np.random.default_rng(seed).standard_normal((size, size))
    smooth = gaussian_filter(white, np.array(grain) * size / 512, mode="wrap")
    return smooth / smooth.std()


def _mix(a, b, amount):
    return np.asarray(a) + (np.asarray(b) - np.asarray(a)) * amount


def _step(low, high, value):
    """Smooth step from 0 at low to 1 at high, either way round."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _image(color):
    return (np.clip(color, 0, 1) * 255 + 0.5).astype(np.uint8)
