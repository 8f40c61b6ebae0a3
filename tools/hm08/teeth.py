"""Teeth by rule: seven crowns a side of each jaw, set side by side along a superellipse.

Sizes are means of adult teeth as dental anatomies give them: crown width along the arch, height from the neck to the
edge or the tips of the cusps, depth from cheek to tongue, all in mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CELLS = (
    7,
    4,
)  # the texture's grid, a tooth a cell; from the top: upper left, upper right, lower left, lower right
ROOT = -0.22  # crowns begin this share of their height above the neck, inside the gums
LEVELS = np.array([ROOT, 0.0, 0.22, 0.48, 0.72, 0.9, 1.0])  # from the neck (0) to the edge (1): where sizes are given
ARCH_POWER = 2.12  # of the superellipse: a little flatter before the incisors than an ellipse, as natural arches are
CONTACT = 1.03  # crowns are this much wider than their place on the arch, so that they touch


@dataclass(frozen=True)
class Tooth:
    """kind "incisor", "canine", "premolar" or "molar"; width, height, depth mm.

    edge  of the edge or the cusps' tips, mm above the jaw's edge line
    tilt  degrees by which the edge leans outwards
    """

    kind: str
    width: float
    height: float
    depth: float
    edge: float = 0.0
    tilt: float = 0.0

    @property
    def front(self):
        """Whether it has an edge and shows in every smile; else a chewing surface."""
        return self.kind in ("incisor", "canine")

    @property
    def grid(self):
        """Columns around, levels from the neck down, and rings of the chewing surface as shares of the last level."""
        if self.front:
            return 14, LEVELS, (0.45,)
        return 12, np.array([ROOT, 0.0, 0.35, 0.75, 1.0]), (0.62, 0.28)


@dataclass(frozen=True)
class Jaw:
    """One arch. teeth from the middle to the back; centers lie on a superellipse (half width, depth), its front at z.

    level  y of the edge line; up is +1 where necks lie above edges (upper jaw), -1 below
    """

    teeth: tuple[Tooth, ...]
    half_width: float
    depth: float
    front_z: float
    level: float
    up: float


UPPER = Jaw(
    teeth=(
        Tooth("incisor", 8.5, 10.5, 7.0, 0.0, 11.0),
        Tooth("incisor", 6.7, 9.1, 6.2, 0.8, 9.0),
        Tooth("canine", 7.7, 9.8, 7.8, 0.3, 4.0),
        Tooth("premolar", 7.1, 8.4, 9.0, 0.7, -1.0),
        Tooth("premolar", 6.8, 7.9, 9.0, 1.0, -2.0),
        Tooth("molar", 10.3, 7.0, 10.8, 1.5, -3.0),
        Tooth("molar", 9.6, 6.3, 10.6, 2.1, -3.0),
    ),
    half_width=26.5,
    depth=48.3,
    front_z=17.8,
    level=-72.2,
    up=1.0,
)
LOWER = Jaw(
    teeth=(
        Tooth("incisor", 5.4, 9.2, 5.8, 0.0, 6.0),
        Tooth("incisor", 6.0, 9.5, 6.0, 0.1, 5.0),
        Tooth("canine", 6.9, 10.3, 7.4, -0.2, 2.0),
        Tooth("premolar", 7.0, 9.3, 7.8, 0.3, -2.0),
        Tooth("premolar", 7.1, 8.9, 8.2, 0.3, -5.0),
        Tooth("molar", 11.0, 8.6, 10.2, 0.1, -8.0),
        Tooth("molar", 10.4, 8.3, 10.0, -0.4, -10.0),
    ),
    half_width=25.25,
    depth=48.3,
    front_z=15.8,
    level=-69.8,
    up=-1.0,
)
FRONT_LABIAL = (0.40, 0.47, 0.50, 0.45, 0.35, 0.24, 0.17)  # of the depth, at LEVELS
FRONT_LINGUAL = (0.42, 0.48, 0.45, 0.22, 0.06, -0.02, -0.05)
FRONT_WIDTH = (0.66, 0.77, 0.95, 1.01, 1.015, 1.005, 0.94)
BACK_WIDTH = (0.74, 0.80, 0.92, 0.99, 1.0, 0.92, 0.84)
BACK_HALF = (0.40, 0.44, 0.49, 0.50, 0.48, 0.42, 0.36)
POWER = {"incisor": 3.8, "canine": 3.0, "premolar": 2.8, "molar": 2.8}  # of an outline near the edge
NECK_POWER = 2.2
WIDEST = 0.68  # front teeth meet this share of their thickness before their inner face
EDGE_MM = 0.15  # a front tooth's edge is round, by this much between its rims
BACK_LEVELS = (ROOT, 0.0, 0.38, 0.70, 0.90)  # the rings of a crown with cusps; the last is its shoulder
BACK_CAP = (0.70, 0.34)  # rings of the chewing surface, as shares of the shoulder
# Cusps: where their tips are (shares of the shoulder along and across the arch), how far a hill reaches both ways (such
# shares), and mm from the tips to the lowest place.
CUSPS = {
    "premolar": (((0.0, 0.62), (0.0, -0.62)), (0.75, 0.45), 1.4),
    "molar": (((0.48, 0.6), (-0.48, 0.6), (0.48, -0.6), (-0.48, -0.6)), (0.40, 0.42), 1.5),
}


def tooth_section(tooth, t):
    """At level t of a crown: half width, outer and inner half depth (mm), and the superellipse's power."""
    width = np.interp(t, LEVELS, FRONT_WIDTH if tooth.front else BACK_WIDTH) * tooth.width / 2
    outer = np.interp(t, LEVELS, FRONT_LABIAL if tooth.front else BACK_HALF) * tooth.depth
    inner = np.interp(t, LEVELS, FRONT_LINGUAL if tooth.front else BACK_HALF) * tooth.depth
    return width, outer, inner, np.interp(t, [0.1, 0.75], [NECK_POWER, POWER[tooth.kind]])


def crown(tooth):
    """vertices (k, 3) in the tooth's own frame and quads: x away from the midline, y from the edge to the neck, z out.

    Edge line or tips of the cusps at y = 0. Rings from the neck down; the last vertex is the middle of the edge or of
    the chewing surface.
    """
    n, levels, cap = tooth.grid
    rings = [outline(tooth, t, n) for t in (levels if tooth.front else BACK_LEVELS)]
    last = rings[-1]
    middle = last.mean(axis=0)
    shares = (*(cap if tooth.front else BACK_CAP), 0.0)
    within = [middle + (last - middle) * share for share in shares]
    for ring, share in zip(within, shares):
        # Between its two rims an edge is round, wherever it curves to.
        ring[:, 1] = edge_lift(tooth, 2 * ring[:, 0] / tooth.width, 1.0) - EDGE_MM * (1 - share)
    if not tooth.front:
        reach = np.ptp(last, axis=0)[[0, 2]] / 2
        for ring in (last, *within):
            ring[:, 1] = chewing_surface(tooth, (ring - middle)[:, [0, 2]] / reach)
    return np.concatenate([*rings, *within[:-1], within[-1][:1]]), ring_quads(len(levels) + len(cap), n)


def outline(tooth, t, n):
    """(n, 3) points around a crown at level t, from +x over the outer face on; the edge's own curve lifts them."""
    phi = 2 * np.pi * np.arange(n) / n
    cos, sin = np.cos(phi), np.sin(phi)
    half, outer, inner, power = tooth_section(tooth, t)
    x = CONTACT * half * np.sign(cos) * np.abs(cos) ** (2 / power)
    share = np.interp(t, [0.2, 0.5], [0.5, WIDEST]) if tooth.front else 0.5
    middle = share * outer - (1 - share) * inner
    z = middle + np.where(sin > 0, outer - middle, inner + middle) * np.sign(sin) * np.abs(sin) ** (2 / power)
    return np.stack([x, tooth.height * (1 - t) + edge_lift(tooth, 2 * x / tooth.width, t), z], axis=1)


def chewing_surface(tooth, at):
    """(k,) mm that points at (k, 2), shares of the shoulder along and across the arch, lie from the level of the tips:
    round hills, so that neither the edge nor the surface has corners."""
    tips, reach, relief = CUSPS[tooth.kind]
    hills = sum(np.exp(-(((at - tip) / reach) ** 2).sum(axis=1)) for tip in tips)
    return relief * (1 - hills)


def edge_lift(tooth, x, t):
    """How much higher than flat an edge lies at x (-1 at the midline's side, 1 at the other), fading to the neck."""
    near = np.clip((t - 0.45) / 0.55, 0.0, 1.0) ** 2
    if tooth.kind == "canine":
        return near * tooth.height * (0.1 * np.abs(x + 0.08) ** 1.4 + 0.12 * np.abs(x) ** 4)
    if tooth.kind == "incisor":
        return near * tooth.height * (0.06 * np.abs(x) ** 4 + 0.07 * np.maximum(x, 0) ** 3)
    return np.zeros_like(x)


def ring_quads(n_rings, n):
    """Quads of rings one after the other and the fan to one last vertex; wound so that, rings going down a crown
    whose columns turn from +x to +z, normals point outwards."""
    at = np.arange(n_rings * n).reshape(n_rings, n)
    after = np.roll(at, -1, axis=1)
    bands = np.stack([at[:-1], after[:-1], after[1:], at[1:]], axis=2).reshape(-1, 4)
    pole = np.full(n, n_rings * n)
    return np.concatenate([bands, np.stack([at[-1], after[-1], pole, np.full(n, -1)], axis=1)])


def arch_frames(jaw):
    """(7, 3) centers, (7, 3) tangents away from the midline, (7, 3) outward normals of the left teeth, level."""
    across = np.sin(np.linspace(0, np.pi / 2, 4001)[:-1])  # shares of the half width
    x, z = jaw.half_width * across, jaw.front_z - jaw.depth * (1 - _behind(across))
    length = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(z))))
    ends = np.cumsum([tooth.width for tooth in jaw.teeth])
    middles = ends - np.array([tooth.width for tooth in jaw.teeth]) / 2
    at = np.interp(middles, length, across)
    centers = np.stack([jaw.half_width * at, 0 * at, jaw.front_z - jaw.depth * (1 - _behind(at))], axis=1)
    slope = jaw.depth * at ** (ARCH_POWER - 1) * _behind(at) ** (1 - ARCH_POWER)
    tangent = np.stack([jaw.half_width + 0 * at, 0 * at, -slope], axis=1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return centers, tangent, np.cross(tangent, [0.0, 1.0, 0.0])


def bend(jaw):
    """(7,) how much the arch turns at each tooth, rad per mm."""
    _, _, normals = arch_frames(jaw)
    turn = np.arctan2(normals[:, 0], normals[:, 2])
    ends = np.append(0.0, 0.5 * (turn[1:] + turn[:-1]))  # midline and between neighbours
    ends = np.append(ends, 2 * turn[-1] - ends[-1])
    return np.diff(ends) / [tooth.width for tooth in jaw.teeth]


def _behind(across):
    """Shares of an arch's depth that are left at shares of its half width: 1 at the front, 0 at the widest."""
    return (1 - across**ARCH_POWER) ** (1 / ARCH_POWER)


def placed(jaw, number, points):
    """Points (k, 3) of a left tooth's own frame in the head's frame; sides lie along the radius of the arch there, so
    that neighbours meet however deep."""
    tooth = jaw.teeth[number]
    centers, tangents, normals = arch_frames(jaw)
    lean = np.radians(tooth.tilt)
    y, z = points[:, 1] - 0.5 * tooth.height, points[:, 2]
    leaning = np.stack(
        [y * np.cos(lean) + z * np.sin(lean) + 0.5 * tooth.height, z * np.cos(lean) - y * np.sin(lean)], axis=1
    )
    x = points[:, 0] * (1 + leaning[:, 1] * bend(jaw)[number])
    result = centers[number] + x[:, None] * tangents[number] + leaning[:, 1:] * normals[number]
    result[:, 1] = jaw.level + jaw.up * (tooth.edge + leaning[:, 0])
    return result


def arch(jaw):
    """vertices (n, 3), polygons (p, 4), uv (t, 2), uv_polygons, mirror (n,): left teeth, then their mirror images."""
    vertices, polygons, uv, uv_polygons = [], [], [], []
    first_row = 0 if jaw.up > 0 else 2
    count = uv_count = 0
    for side in (1.0, -1.0):
        for number, tooth in enumerate(jaw.teeth):
            own, quads = crown(tooth)
            points = placed(jaw, number, own) * [side, 1, 1]
            if side * jaw.up < 0:
                quads = turned_over(quads)
            cell_uv, cell_quads = crown_uv(tooth, number, first_row + (side < 0), side * jaw.up < 0)
            vertices.append(points)
            polygons.append(np.where(quads >= 0, quads + count, -1))
            uv.append(cell_uv)
            uv_polygons.append(np.where(cell_quads >= 0, cell_quads + uv_count, -1))
            count, uv_count = count + len(points), uv_count + len(cell_uv)
    half = count // 2
    mirror = np.roll(np.arange(count), half)
    return np.concatenate(vertices), np.concatenate(polygons), np.concatenate(uv), np.concatenate(uv_polygons), mirror


def turned_over(quads):
    """The same polygons wound the other way, cut along the same diagonal."""
    turned = quads[:, [0, 3, 2, 1]]
    triangle = quads[:, 3] < 0
    turned[triangle] = quads[triangle][:, [0, 2, 1, 3]]
    return turned


def crown_uv(tooth, column, row, over):
    """uv (t, 2) and quads of one crown in its cell: u once around, the outer face in the middle, v down to the edge."""
    columns, levels, cap = tooth.grid
    n_rings, n = len(levels) + len(cap), columns + 1
    start = columns * 3 // 4  # the column at the inner face: there u begins and ends
    place = (np.arange(columns) - start) % columns
    u = np.linspace(0.0, 1.0, n)
    share = np.concatenate([np.interp(levels, [ROOT, 1.0], [0.0, 0.82]), np.linspace(0.88, 0.94, len(cap))])
    grid = np.stack(np.meshgrid(u, 1 - share), axis=2)  # rings, columns, 2
    pole = np.stack([0.5 * (u[:-1] + u[1:]), np.zeros(columns)], axis=1)
    local = np.concatenate([grid.reshape(-1, 2), pole])
    at = np.arange(n_rings * n).reshape(n_rings, n)
    here, there = at[:, place], at[:, place + 1]
    bands = np.stack([here[:-1], there[:-1], there[1:], here[1:]], axis=2).reshape(-1, 4)
    fan = np.stack([here[-1], there[-1], n_rings * n + place, np.full(columns, -1)], axis=1)
    quads = np.concatenate([bands, fan])
    margin = 0.02
    local = margin + (1 - 2 * margin) * local
    uv = (local + [column, CELLS[1] - 1 - row]) / CELLS
    return uv, turned_over(quads) if over else quads
