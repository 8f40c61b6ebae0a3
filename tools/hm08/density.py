"""Where the mesh is fine: levels of subdivision by a wished edge length, and the mouth's columns evened out.

The control mesh has 23 columns across the upper lip and 15 across the lower one, with the corner between columns 7
and 8 from the middle below. Lines of equal length, paired vertex by vertex, need 19 each: near the lips the columns
are moved along their rings by sampling the twice-subdivided surface elsewhere, so neither the surface nor any
shape changes.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.polyline import arc_lengths
from hm08.subdivide import adaptive, balanced, catmull_clark
from hm08.topology import QuadTopology

MOUTH_COLUMNS = 38
OLD_CORNER, NEW_CORNER = 7.6, 9.5
SEAM_RING = 1


def build_fine(control):
    """The AdaptiveMesh of the skin, the mirror map (n_level2,) and the grids.

    returns mesh, mirror, dict "mouth"/"eye_left"/"nostril_left" -> dict (4 ring, 4 column) -> level-2 vertex
    """
    n = control.n_skin
    first = catmull_clark(control.quads, n)
    second = catmull_clark(first.quads, first.S.shape[0])
    S2 = second.S @ first.S
    P = S2 @ control.vertices[:n]
    mirror2 = level2_mirror(control, first, second)
    mouth = level2_grid(control.mouth, control.quads, first, second, half=19)
    rest = {
        "eye_left": level2_grid(control.eye_left, control.quads, first, second),
        "nostril_left": level2_grid(control.nostril_left, control.quads, first, second),
    }
    R = sliding(mouth, mirror2, P)
    refine_first, refine_second = _wishes(control, first, R @ P, mirror2)
    mesh = adaptive(control.quads, n, first, second, refine_first, refine_second, R)
    return mesh, mirror2, {"mouth": mouth, **rest}


def level2_mirror(control, first, second):
    """(n_level2,) mirror map carried up through both levels."""
    mirror = control.mirror[: control.n_skin]
    for quads, level in ((control.quads, first), (first.quads, second)):
        mirror = _mirror_up(quads, level, mirror)
    return mirror


def _mirror_up(quads, level, mirror):
    n = len(mirror)
    out = np.full(level.S.shape[0], -1)
    out[:n] = mirror
    pairs = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)
    key = np.sort(pairs, axis=1) @ [n, 1]
    unique, index = np.unique(key, return_index=True)
    twin = np.searchsorted(unique, np.sort(mirror[pairs], axis=1) @ [n, 1])
    out[level.edge_point.ravel()] = level.edge_point.ravel()[index][twin]
    rows = np.sort(quads, axis=1)
    order = np.lexsort(rows.T)
    image = np.sort(mirror[quads], axis=1)
    image_order = np.lexsort(image.T)
    out[level.face_point[image_order]] = level.face_point[order]
    return out


def level2_grid(grid, quads, first, second, half=None):
    """dict (4 ring, 4 column) -> level-2 vertex of a Grid; half keeps columns 0..half only (no wrap)."""
    count = len(grid.rings[0])
    of_vertex = {}
    for k, ring in grid.rings.items():
        for i, v in enumerate(ring):
            if half is None or i <= half:
                of_vertex[int(v)] = (4 * k, 4 * i)
    table = {}
    for strip in grid.strips.values():
        for f in strip:
            corners = [of_vertex.get(int(v)) for v in quads[f]]
            if None in corners:
                continue
            C = np.array(corners, float)
            if C[:, 1].max() - C[:, 1].min() > 2 * count:  # the quad that closes the ring
                C[C[:, 1] < 2 * count, 1] += 4 * count
            for i in range(4):
                child = 4 * f + i
                child_C = np.array([C[i], (C[i] + C[(i + 1) % 4]) / 2, C.mean(axis=0), (C[i] + C[i - 1]) / 2])
                for j in range(4):
                    grand = second.quads[4 * child + j]
                    at = [child_C[j], (child_C[j] + child_C[(j + 1) % 4]) / 2]
                    at += [child_C.mean(axis=0), (child_C[j] + child_C[j - 1]) / 2]
                    for vertex, (r, c) in zip(grand, at):
                        table[(round(r), round(c) % (4 * count))] = int(vertex)
    return table


class ColumnWarp:
    """New column -> the old column whose place it takes, so that both lips have their vertices face to face.

    Along the seam ring each lip keeps as much of its own spacing as the other allows: the arc length from the middle
    to the corner is the mean of what both lips would have at that column.
    """

    def __init__(self, mouth, points):
        old = np.arange(0, 4 * 19 + 1) / 4
        ring = points[[mouth[(4 * SEAM_RING, round(4 * c))] for c in old]]
        arc = arc_lengths(ring)
        corner = np.interp(OLD_CORNER, old, arc)
        t = np.linspace(0.0, 1.0, 96)  # 0 at the middle of a lip, 1 at the corner
        below = np.interp(t * OLD_CORNER, old, arc) / corner
        above = (arc[-1] - np.interp(19 - t * (19 - OLD_CORNER), old, arc)) / (arc[-1] - corner)
        share = 0.5 * (below + above)
        old_below = np.interp(share * corner, arc, old)
        old_above = np.interp(arc[-1] - share * (arc[-1] - corner), arc, old)
        self._new = np.concatenate([t * NEW_CORNER, 19 - t[-2::-1] * (19 - NEW_CORNER)])
        smooth = np.concatenate([old_below, old_above[-2::-1]])
        kernel = np.ones(9) / 9
        inside = np.convolve(smooth, kernel, mode="valid")
        smooth[4:-4] = inside
        self._old = smooth

    def __call__(self, column, ring):
        """Old column (0..19) of a new column on a ring; away from the lips the warp fades out."""
        t = np.clip((ring - 5.0) / 5.0 if ring > 0 else (-1.0 - ring) / 8.0, 0.0, 1.0)
        strength = 1.0 - t * t * (3 - 2 * t)
        return column + strength * (np.interp(column, self._new, self._old) - column)


def sliding(mouth, mirror2, points):
    """(n, n) operator on level-2 points (n, 3): rows of the mouth's grid sample the surface at slid columns."""
    n, warp = len(points), ColumnWarp(mouth, points)
    rows, columns, values = [], [], []
    moved = np.zeros(n, bool)
    top = 4 * MOUTH_COLUMNS // 2

    def vertex(r, c):
        if c < 0 or c > top:
            return mirror2[mouth[(r, -c if c < 0 else 2 * top - c)]]
        return mouth[(r, c)]

    for (r, c), v in mouth.items():
        x = 4 * float(warp(c / 4, r / 4))
        base = int(np.floor(x + 1e-9))
        t = x - base
        if abs(t) < 1e-9 and base == c:
            continue
        weights = [-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2]
        weights.append((t + 1) * t * (t - 1) / 6)
        sources = [vertex(r, base + i) for i in (-1, 0, 1, 2)]
        for target, near in ((v, sources), (mirror2[v], [mirror2[s] for s in sources])):
            if moved[target]:
                continue
            moved[target] = True
            rows += [target] * 4
            columns += near
            values += weights
    keep = np.nonzero(~moved)[0]
    R = sp.csr_matrix((values, (rows, columns)), shape=(n, n))
    return R + sp.csr_matrix((np.ones(len(keep)), (keep, keep)), shape=(n, n))


def wished_edge(P, control):
    """(k,) wished edge length in mm at points P (k, 3) of the skin, and (k,) bool: never coarser than level 1."""
    x, y, z = np.abs(P[:, 0]), P[:, 1], P[:, 2]
    front = (z > -58) & (y > -118) & (y < 72)
    wish = np.where(front, 3.0, 5.0)
    wish = np.where((y > -112) & (y < 62) & (x < 58) & (z > -25), 2.7, wish)
    mouth = control.vertices[control.mouth.rings[5]].mean(axis=0)
    near_mouth = np.hypot(x, y - mouth[1]) < 42
    brow = (np.abs(y - 17) < 16) & (x < 55) & (z > -15)
    wish = np.where(near_mouth | brow, 2.0, wish)
    wish = np.where((x < 16) & (y > 10) & (y < 66) & (z > 0), 1.9, wish)  # hm08's own quads are smaller there
    band = (x > 10) & (x < 46) & (y < -25) & (y > -85) & (z > -5)  # the nasolabial fold
    return np.where(band, 1.8, wish), front & (x < 70)


def _wishes(control, first, P2, mirror2):
    """refine_first (m,), refine_second (4 m,) for the wished edge lengths; symmetric, without frayed borders."""
    V = control.vertices[: control.n_skin]
    quads, m = control.quads, len(control.quads)
    length = np.linalg.norm(V[quads] - V[np.roll(quads, -1, axis=1)], axis=2).mean(axis=1)
    inner = _beyond(control)
    around, near = np.zeros(m, bool), np.zeros(m, bool)
    for grid, top in ((control.mouth, 8), (control.eye_left, 9), (control.nostril_left, 2)):
        for k, strip in grid.strips.items():
            inner[strip] |= k < -3
            around[strip] |= -3 <= k < top
            near[strip] |= k < top
    twin = _face_mirror(quads, mirror2)
    inner |= inner[twin]
    around |= around[twin]
    near |= near[twin]
    wish, front = wished_edge(V[quads].mean(axis=1), control)
    around |= front & ~inner
    once = ((length > 1.4 * wish) & ~inner) | around
    twice = (length > 2.7 * wish) & ~inner & ~near
    twice = _without_fray(twice | twice[twin], quads) & ~near
    once = _without_fray(once | once[twin], quads) | around | twice
    return balanced(first, once, np.repeat(twice, 4))


def _without_fray(marked, quads):
    """Fill faces with three or more marked neighbours, drop those with one or none."""
    m = len(quads)
    half = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, which = np.unique(half, axis=0, return_inverse=True)
    incidence = sp.csr_matrix((np.ones(4 * m), (np.repeat(np.arange(m), 4), which.ravel())))
    neighbours = incidence @ incidence.T - 4 * sp.identity(m)
    for _ in range(4):
        count = neighbours @ marked.astype(float)
        marked = (marked & (count >= 2)) | (count >= 3)
    return marked


def _beyond(control):
    """(m,) bool: quads deeper in the mouth bag or an eye socket than their grids reach."""
    topology = QuadTopology(control.quads)
    deep = np.zeros(len(control.quads), bool)
    for grid in (control.mouth, control.eye_left):
        last = min(grid.rings)
        outside = topology.side_of_loop([int(v) for v in grid.rings[last]], int(grid.rings[0][0]))
        deep |= ~outside
    return deep


def _face_mirror(quads, mirror):
    """(m,) the face on the other side of the mirror plane."""
    order = np.lexsort(np.sort(quads, axis=1).T)
    image = np.lexsort(np.sort(mirror[quads], axis=1).T)
    twin = np.empty(len(quads), int)
    twin[image] = order
    return twin
