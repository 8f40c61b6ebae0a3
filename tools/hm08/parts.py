"""The parts beside the skin: eyeballs, teeth, gums, tongue; and how those of the mouth follow an identity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hm08.eyeball import cornea, eyeball, outermost
from hm08.gums import gum_band
from hm08.teeth import LOWER, UPPER, arch
from hm08.tongue import tongue

HANDLES = 10  # hm08's own points of teeth and tongue that stand for the mouth when an identity moves it


@dataclass(frozen=True)
class Piece:
    """A part with indices of its own: vertices (n, 3), polygons (p, 4), uv (t, 2), uv_polygons (p, 4), mirror (n,)."""

    name: str
    vertices: np.ndarray
    polygons: np.ndarray
    uv: np.ndarray
    uv_polygons: np.ndarray
    mirror: np.ndarray
    material: str
    attach: str


def mirrored_polygons(polygons):
    """The same polygons wound the other way."""
    turned = polygons[:, [0, 2, 1, 3]].copy()
    quad = polygons[:, 3] >= 0
    turned[quad] = polygons[quad][:, [0, 3, 2, 1]]
    return turned


def eye_pieces(center):
    """Pieces of the two eyes; the right one is the left one's mirror image."""
    return _eye_pair("eye", eyeball(), center, "eye")


def cornea_pieces(center):
    """Pieces of the two corneas."""
    return _eye_pair("cornea", cornea(), center, "cornea")


def outermost_eyes(center):
    """(2 n, 3) the vertices of eye_pieces, the left eye's first, raised to the corneas."""
    left = outermost() + center
    return np.concatenate([left, left * [-1, 1, 1]])


def _eye_pair(name, mesh, center, material):
    """Pieces of a mesh about the eye's centre (vertices, polygons, uv) and of its mirror image.

    Both textures stand upright: u grows to the person's left on both eyes.
    """
    vertices, polygons, uv = mesh
    left, k = vertices + center, len(vertices)
    # Cut from corner 0 to 2; the mirrored winding keeps corners 0 and 2.
    turned = mirrored_polygons(polygons)
    at = np.arange(k)
    return [
        Piece(f"{name}_left", left, polygons, uv, polygons, at + k, material, "eye_left"),
        Piece(f"{name}_right", left * [-1, 1, 1], turned, uv * [-1, 1] + [1, 0], turned, at - k, material, "eye_right"),
    ]


def evenly_cut(vertices, polygons, uv, uv_polygons):
    """polygons, uv, uv_polygons of a grid over both sides, such that right quads are cut as their left twins are.

    Quads are cut from corner 0 to 2; on the right they start one corner further.
    """
    right = (polygons[:, 3] >= 0) & (vertices[polygons[:, :3], 0].mean(axis=1) < 0)
    shifted = [np.where(right[:, None], np.roll(quads, -1, axis=1), quads) for quads in (polygons, uv_polygons)]
    return shifted[0], uv, shifted[1]


def mouth_pieces():
    """Pieces of the mouth, and the tongue's vertices when it is out (n, 3), the jaw's own motion left out."""
    pieces = []
    for jaw, name, attach in ((UPPER, "upper", "skull"), (LOWER, "lower", "jaw")):
        vertices, polygons, uv, uv_polygons, mirror = arch(jaw)
        pieces.append(Piece(f"teeth_{name}", vertices, polygons, uv, uv_polygons, mirror, "teeth", attach))
    vertices, polygons, uv, uv_polygons, mirror, out = tongue()
    pieces.append(Piece("tongue", vertices, *evenly_cut(vertices, polygons, uv, uv_polygons), mirror, "tongue", "jaw"))
    for jaw, name, attach in ((UPPER, "upper", "skull"), (LOWER, "lower", "jaw")):
        vertices, polygons, uv, mirror = gum_band(jaw)
        polygons, uv, uv_polygons = evenly_cut(vertices, polygons, uv, polygons)
        pieces.append(Piece(f"gums_{name}", vertices, polygons, uv, uv_polygons, mirror, "gums", attach))
    return pieces, out


def control_points(control, name):
    """(k,) control points of hm08's own teeth or tongue."""
    return np.unique(control.part_quads[name])


def mouth_rows(control, vertices):
    """Columns (h,) and weights (k, h): what points in the mouth (k, 3) do when hm08's own teeth and tongue move.

    The affine map that fits a few of them best, so that teeth stay teeth.
    """
    own = np.concatenate([control_points(control, name) for name in ("teeth_upper", "teeth_lower", "tongue")])
    handles = _spread_out(control.vertices[own], control.mirror[own], own)
    at = control.vertices[handles]
    design = np.concatenate([at - at.mean(axis=0), np.ones((len(at), 1))], axis=1)
    points = np.concatenate([vertices - at.mean(axis=0), np.ones((len(vertices), 1))], axis=1)
    return handles, points @ np.linalg.pinv(design)


def _spread_out(points, twins, index):
    """About HANDLES of index (k,), far apart and in mirrored pairs."""
    place = {int(v): i for i, v in enumerate(index)}
    chosen = [int(np.argmax(points[:, 2]))]
    while len(chosen) < HANDLES:
        distance = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(distance)))
        chosen.append(place[int(twins[chosen[-1]])])
    return index[np.unique([*chosen, *(place[int(twins[i])] for i in chosen)])]
