"""Nostrils: dark by the light that reaches them, and rims that keep the colour of the skin around.

A scanner sees a nostril as a dark stain with a ragged edge, as a shallow lit pit or as a plug, and its rim hardly ever
lies on the rim of the fit. So the scan's word is not taken where it shows the hole beside the template's one. Openness
alone leaves the floor behind a wide rim pale, depth alone lights what lies before a rim deep inside: both count.
"""

from __future__ import annotations

import numpy as np

from facewright.bake.fill import SHOWN_SHARE, continued, surface_distance
from facewright.bake.texels import at_points, gather_at_vertices
from facewright.mesh.fade import smooth_step
from facewright.mesh.openness import vertex_openness
from facewright.mesh.render import LUMA, linear_to_srgb, srgb_to_linear

AROUND_MM = 7.0  # before the rim
FULL = 0.55  # openness of skin in full light
DEEP_MM = 3.0
STEEP = 1.5  # power of the openness
LEAST = 0.06  # share of the light in the depth
WALLS = (0.82, 1.07, 1.16)  # powers of the light: it has met red skin before, as in a mouth
SHADED = 0.9  # what has less light than this is not read from a scan
HOLE_SHARE, HOLE_TEXELS = 0.75, 0.05  # darker than this share of the skin around, in so many of a vertex's texels
_DIRECTIONS = 128


def around_nostrils(V, F, nostrils):
    """(n,) bool of a skin (n, 3), (m, 3): nostrils (n,) and what lies less than AROUND_MM before them."""
    return surface_distance(V, F, nostrils, AROUND_MM) < AROUND_MM


def nostril_light(V, F, nostrils):
    """(n,) share of the light: 1 on the skin, falling to LEAST in the depth of the nostrils (n,) bool."""
    light = np.ones(len(V))
    asked = np.flatnonzero(around_nostrils(V, F, nostrils))
    if nostrils.any():
        openness = vertex_openness(V, F, n_directions=_DIRECTIONS, subset=asked)
        depth = surface_distance(V, F, ~nostrils, DEEP_MM)[asked]
        comes = np.minimum(openness / FULL, 1.0) ** STEEP * (1.0 - smooth_step(depth, 0.0, DEEP_MM))
        light[asked] = LEAST + (1.0 - LEAST) * comes
    return light


def darkened(colors, light):
    """Colours (n, 3) sRGB 0..255 in their share (n,) of the light."""
    share = light[:, None] ** np.array(WALLS)
    return linear_to_srgb(srgb_to_linear(colors / 255.0) * share) * 255.0


def hole_rims(skin, texels, colors, colored, means, share, nostrils, light):
    """(n,) bool: skin at and before the rims of nostrils (n,) bool that is not read from a scan.

    skin has V, F, outer (maps.bake); colors (k, 3), colored (k,) are those of its texels, means (n, 3), share (n,) of
    its vertices; light (n,) as nostril_light gives it
    """
    near = around_nostrils(skin.V, skin.F, nostrils) & skin.outer
    around = skin.outer & ~near & (share >= SHOWN_SHARE)
    rims = near & (light < SHADED)
    if near.any() and around.any():
        usual = continued(skin.V, skin.F, means, around, near)
        at = np.flatnonzero(near[skin.F].any(axis=1)[texels.face] & colored)
        beside = texels.chosen(at)
        expected = at_points(usual, skin.F, beside.face, beside.barycentric) @ LUMA
        dark, every = colors[at] @ LUMA < HOLE_SHARE * expected, np.ones(len(at), bool)
        holes = gather_at_vertices(np.empty((len(at), 0)), dark, every, beside, skin.F, len(near))[1]
        rims |= near & (holes > HOLE_TEXELS)
    return rims
