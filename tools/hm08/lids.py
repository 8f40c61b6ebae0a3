"""What lies on the lids, by rule: lashes, tear film, caruncle, and the strips that soften where lid and eyeball meet.

All for the left eye; the right one's are mirror images.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.mesh.closest import Surface
from facewright.mesh.normals import normalized
from facewright.mesh.polyline import arc_lengths
from hm08.eyeball import at_height
from hm08.parts import Piece
from hm08.teeth import turned_over


@dataclass(frozen=True)
class Lash:
    """A row of lashes as one curved card.

    root_mm  from the margin's inner edge over the lid's thickness; length mm in the middle; columns and rows
    curl     degrees from straight away from the eye towards away from the opening, at the root and at the tip
    v        part of the texture's height
    """

    lid: str
    root_mm: float
    length: float
    curl: tuple[float, float]
    columns: int
    rows: int
    v: tuple[float, float]


LASHES = (
    Lash("upper", 2.3, 8.2, (-20.0, 52.0), 30, 5, (0.5, 1.0)),
    Lash("upper", 2.0, 6.6, (-30.0, 36.0), 24, 4, (0.5, 1.0)),
    Lash("lower", 1.7, 4.4, (8.0, 58.0), 22, 4, (0.0, 0.5)),
)
LASH_ENDS = (0.10, 0.94)  # of the margin's length, from the inner corner
FAN = 0.55  # how far the outermost lashes lean to the sides
STRIP_COLUMNS = 28
# mm into the opening of each row. Strips lie that far off the ball that their chords do not cut into the cornea.
OCCLUSION = {"upper": (-0.3, 0.35, 1.0, 1.9, 3.0, 4.6), "lower": (-0.3, 0.35, 0.9, 1.7, 2.6)}
BLEND = {"upper": (-0.3, 0.12, 0.45), "lower": (-0.3, 0.15, 0.6)}
FILM, FILM_ENDS = (-0.1, 0.18, 0.5), (0.07, 0.97)  # its mirroring tip would stand out of a canthus as a white splinter
CARUNCLE_MM = (1.8, 1.15, 0.7)
CARUNCLE_SHARE = 0.05


class Lids:
    """The left lids of a head: V (n, 3), F (m, 3) of the skin, lines, center (3,) of the ball."""

    def __init__(self, V, F, lines, center):
        self.center = center
        near = np.linalg.norm(V[F[:, 0]] - center, axis=1) < 30.0
        self.skin = Surface(V, F[near])
        self.margins = {lid: V[lines[f"lid_{lid}_left"]] for lid in ("upper", "lower")}

    def at(self, lid, share):
        """Points (k, 3) of a margin at shares of its length, and unit vectors (k, 3) there: along it, away from the
        eye's centre, and across, away from the opening."""
        points = _sampled(self.margins[lid], share)
        ends = [_sampled(self.margins[lid], np.clip(share + step, 0, 1)) for step in (-0.06, 0.06)]
        along = normalized(ends[1] - ends[0])
        away = normalized(points - self.center)
        across = normalized(np.cross(along, away))
        outward = 1.0 if lid == "upper" else -1.0
        return points, along, away, outward * np.sign(across[:, 1].mean()) * across


def _sampled(line, share):
    steps = arc_lengths(line)
    return np.stack([np.interp(share, steps / steps[-1], line[:, c]) for c in range(3)], axis=1)


def lid_pieces(V, F, lines, center):
    """Pieces that ride on the lids of both eyes."""
    lids = Lids(V, F, lines, center)
    left = [
        ("lashes", lash_cards(lids), "lashes"),
        ("caruncle", caruncle(lids), "caruncle"),
        ("lacrimal", _joined([_film(lids)]), "lacrimal"),
        ("occlusion", _strips(lids, OCCLUSION, 0.17), "occlusion"),
        ("blend", _strips(lids, BLEND, 0.10), "blend"),
    ]
    pieces = []
    for name, (vertices, polygons, uv), material in left:
        k = len(vertices)
        for side, sign in (("left", 1), ("right", -1)):
            mine = vertices * [sign, 1, 1]
            quads = polygons if sign > 0 else turned_over(polygons)
            mirror = np.arange(k) + sign * k
            pieces.append(Piece(f"{name}_{side}", mine, quads, uv, quads, mirror, material, f"lid_{side}"))
    return pieces


def lash_cards(lids):
    """vertices, polygons, uv of all lashes: v from the root to the tip within each card's part of the texture."""
    cards = []
    for lash in LASHES:
        share = np.linspace(*LASH_ENDS, lash.columns)
        points, along, away, across = lids.at(lash.lid, share)
        root = lids.skin.closest(points + lash.root_mm * away).points
        # Short at the inner corner, longest outside the middle.
        length = lash.length * (0.55 + 0.45 * np.sin(np.pi * np.clip(share * 0.92 + 0.02, 0, 1)) ** 0.7)
        length *= 0.82 + 0.25 * share
        angles = np.radians(np.linspace(*lash.curl, lash.rows))
        lean = FAN * (share - 0.42)[:, None] * along
        rows, at = [root], root
        for a in 0.5 * (angles[:-1] + angles[1:]):
            step = np.cos(a) * away + np.sin(a) * across + lean
            at = at + step * (length / (lash.rows - 1))[:, None]
            rows.append(at)
        cards.append(_grid(np.stack(rows), np.linspace(*lash.v, lash.rows)))
    return _joined(cards)


def _strips(lids, rows, off):
    """One band on either lid that lies on the eyeball; v from 1 at the upper and 0 at the lower
    margin to 0.5; off mm from the ball."""
    bands = []
    for lid, ends in (("upper", (1.0, 0.5)), ("lower", (0.0, 0.5))):
        # Not at one height: half closed, the two strips pass each other.
        points = _into_opening(lids, lid, rows[lid], off + (0.05 if lid == "lower" else 0.0))
        bands.append(_grid(points, np.linspace(*ends, len(points)), over=lid == "lower"))
    return _joined(bands)


def _film(lids):
    """The tear film: a narrow slope from the lower margin onto the eyeball."""
    points = _into_opening(lids, "lower", FILM, 0.05, FILM_ENDS)
    points[1] += 0.12 * normalized(points[1] - lids.center)
    return _grid(points, np.linspace(0, 1, len(points)), over=True)


def _into_opening(lids, lid, rows, off, ends=(0.0, 1.0)):
    """(rows, columns, 3): the margin, then rows into the opening on the eyeball; closer together where it is narrow."""
    share = np.linspace(*ends, STRIP_COLUMNS)
    points, _, _, across = lids.at(lid, share)
    other = lids.at("lower" if lid == "upper" else "upper", share)[0]
    room = 0.5 * np.linalg.norm(other - points, axis=1)
    result = [points]
    for into in rows[1:]:
        step = (into * np.minimum(room / rows[-1], 1.0))[:, None]
        on_ball = at_height(points - step * across, lids.center, off)
        # At the corners the margins stand off the ball: there the strip slopes down to it.
        result.append(on_ball)
    result[0] = points - rows[0] * across * 0.5
    return np.stack(result)


def caruncle(lids):
    """A small wet bump in the inner corner."""
    (upper,), (along,), (away,), _ = lids.at("upper", np.array([CARUNCLE_SHARE]))
    (lower,) = lids.at("lower", np.array([CARUNCLE_SHARE]))[0]
    ups = normalized((upper - lower)[None])[0]
    out = np.cross(along, ups)
    out = out * np.sign(out @ away)
    middle = 0.5 * (upper + lower) - 0.75 * out
    wide, high, deep = CARUNCLE_MM
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 8), 2 * np.pi * np.arange(12) / 12, indexing="ij")
    x, y, z = np.cos(theta), np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
    # Pointed towards the corner, round towards the ball.
    local = np.stack([wide * x, high * y * (1 + 0.25 * x), deep * z], axis=2)
    points = middle + local @ np.stack([along, ups, out])
    at = np.arange(8 * 12).reshape(8, 12)
    after = np.roll(at, -1, axis=1)
    quads = np.stack([at[:-1], at[1:], after[1:], after[:-1]], axis=2).reshape(-1, 4)
    uv = np.stack([theta / np.pi, phi / (2 * np.pi)], axis=2).reshape(-1, 2)
    return points.reshape(-1, 3), quads, uv


def _grid(points, v, over=False):
    """vertices, quads, uv of rows (r, c, 3): u along the columns, v (r,)."""
    r, c = points.shape[:2]
    at = np.arange(r * c).reshape(r, c)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=2).reshape(-1, 4)
    uv = np.stack(np.meshgrid(np.linspace(0, 1, c), v), axis=2).reshape(-1, 2)
    return points.reshape(-1, 3), turned_over(quads) if over else quads, uv


def _joined(grids):
    start = np.cumsum([0] + [len(points) for points, _, _ in grids])
    quads = [np.where(polygons >= 0, polygons + offset, -1) for (_, polygons, _), offset in zip(grids, start)]
    return np.concatenate([g[0] for g in grids]), np.concatenate(quads), np.concatenate([g[2] for g in grids])
