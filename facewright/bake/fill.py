"""What the scan does not show: colours for the rest of the head, solved on its surface.

A low-pass colour x per vertex is known where the scan shows the skin. Elsewhere it minimises

    sum_edges w_ij |(x_i - x_j) - (g_i - g_j)|^2

where g is the mirrored colour if the other side is known at both ends, else 0: a missing cheek repeats the other one's
shading without a step at its border, and what neither side shows is a smooth membrane (Perez, Gangnet and Blake 2003,
on a mesh instead of an image) that forgets the rim over FORGET_MM and becomes the skin's usual colour: else one dark
lock of hair at the rim darkens half a scalp. The mirrored side's detail is added texel by texel. Work in sRGB: steps
that the eye sees as equal count as equal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import dilate, unique_edges
from facewright.mesh.fade import smooth_step
from facewright.mesh.render import LUMA
from facewright.solve.quadratic import Factorization

TRUSTED_MM = 2.0
FEATHER_MM = 5.0
# Towards what neither side shows for more than twice LARGE_MM there is no detail for a long way, and its end would be
# seen. Within the band colours give way to what is around them too, the more the nearer the hole: up to over EASE_MM.
LARGE_MM, BAND_MM, EASE_MM = 8.0, 15.0, 16.0
SHOWN_SHARE = 0.5
# Around hidden hair, what is this far off the skin's brightness (sRGB, in times its usual spread, or as a share of it)
# is hair.
STAIN_MM, STAIN_STEPS, STAIN_SPREADS, STAIN_SHARE = 25.0, 20.0, 3.0, 0.5
# And on bare skin what is darker than so much of the skin around, continued to there: a hairline's shadow.
SHADOW_SHARE = 0.88
# So is what is nearer to the hair's own colour than to the skin's, where the two differ by so many spreads of the skin.
# On dark skin and in a strong light brightness does not tell them apart.
TOLD_APART, HAIR_NEARBY = 3.0, 8
RIDGE = 1e-6
FORGET_MM = 30.0
# The other side is no model for the skin this near to what neither side shows: hair begins there, on each its own way.
LOST_MM = 10.0
# Multiplies the mean skin colour (sRGB): what is found this many mm behind the rim.
INTERIORS = {
    "mouth_interior": ((0.42, 0.20, 0.22), 6.0),
    "socket_left": ((0.72, 0.50, 0.50), 3.0),
    "socket_right": ((0.72, 0.50, 0.50), 3.0),
}


@dataclass(frozen=True)
class Fill:
    """color (n, 3) sRGB 0..255 of every vertex, low-pass; weight (n,) 0..1 of the scan's own detail, feathered;
    own (n, 3) low-pass colour of the scan itself, which that detail is measured from;
    detail (n,) 0..1 weight of the mirrored side's detail; mirrored (n, 3) low-pass colour of the mirrored side, which
    that detail is measured from.
    """

    color: np.ndarray
    weight: np.ndarray
    own: np.ndarray
    detail: np.ndarray
    mirrored: np.ndarray


def surface_distance(V, F, sources, limit):
    """(n,) mm along edges from the nearest source vertex (n,) bool; limit where it is farther or there is none."""
    if not sources.any():
        return np.full(len(V), float(limit))
    distance = dijkstra(
        _length_graph(V, F), directed=False, indices=np.flatnonzero(sources), min_only=True, limit=limit
    )
    return np.minimum(distance, limit)


def feather(V, F, outer, share, mirror):
    """(n,) weight of what the scan shows: 1 inside, falling to 0 over 5 mm towards holes of the scan, 15 mm towards
    large ones that the other side has as well.

    outer (n,) bool: vertices that can be seen; share (n,) of the texels around a vertex that met the scan, NaN where
    it has none; mirror (n,). The rims of mouth and lids are no holes: there the scan's colour is kept to the end.
    """
    holes = outer & (share < SHOWN_SHARE)
    distance = surface_distance(V, F, holes, FEATHER_MM)
    wide = surface_distance(V, F, _large(V, F, holes & holes[mirror]), BAND_MM)
    weight = np.minimum(smooth_step(distance, 1.0, FEATHER_MM), smooth_step(wide, 1.0, BAND_MM))
    return np.where(outer & ~holes, weight, 0.0)


def _large(V, F, holes):
    """(n,) bool: vertices of holes (n,) bool that are wider than twice LARGE_MM."""
    core = holes & (surface_distance(V, F, ~holes, LARGE_MM) >= LARGE_MM)
    return holes & (surface_distance(V, F, core, 2.0 * LARGE_MM) < 2.0 * LARGE_MM)


def hair_stains(V, F, means, share, hidden, hair, bare):
    """(n,) bool: vertices whose colour is that of the hair beside them: strands, a hairline, what shows between curls.

    V (n, 3), F (m, 3) skin; means (n, 3) sRGB and share (n,) as in solve_fill; hidden (n,) bool: hair covers the skin
    hair (h, 3) sRGB: what covers it, for each hidden vertex; bare (n,) bool: where neither brows nor beards grow
    A stain hangs together with skin that is hidden or not shown, so brows and birthmarks stay.
    """
    shown = (share >= SHOWN_SHARE) & ~hidden
    near = surface_distance(V, F, hidden, STAIN_MM) < STAIN_MM
    skin = shown & ~near
    if not (skin.any() and hidden.any()):
        return np.zeros(len(V), bool)
    brightness = means @ LUMA
    usual = np.median(brightness[skin])
    spread = 1.4826 * np.median(np.abs(brightness[skin] - usual))
    limit = min(max(STAIN_STEPS, STAIN_SPREADS * spread), STAIN_SHARE * usual)
    odd = shown & near
    odd[odd] = (np.abs(brightness[odd] - usual) > limit) | _nearer_to_hair(
        means[odd], means[skin], hair[cKDTree(V[hidden]).query(V[odd], min(HAIR_NEARBY, hidden.sum()))[1]]
    )
    odd |= shown & near & bare & (brightness < SHADOW_SHARE * (continued(V, F, means, skin, near) @ LUMA))
    passable, reached = odd | (near & ~shown), hidden
    while True:
        grown = hidden | (dilate(reached, F) & passable)
        if (grown == reached).all():
            # Hair ends somewhere on the faces at the edge of a stain.
            return shown & near & dilate(reached & odd, F)
        reached = grown


def continued(V, F, means, skin, near):
    """(n, 3) sRGB of the skin (n,), continued as a membrane to what is near it (n,); means elsewhere."""
    # Guided by nothing it forgets nothing: the shaded side of a head stays shaded.
    everywhere = np.ones(len(V), bool)
    middle = np.median(means[skin], axis=0)
    return _poisson(V, F, means, skin, near, np.zeros_like(means), everywhere, middle, np.inf)


def _nearer_to_hair(colors, skin, hair):
    """(k,) bool of colours (k, 3) beside hair (k, h, 3), on a head with skin (s, 3), all sRGB; light counts less than
    hue: distances are in spreads of the skin's own colours, which light has spread already.
    """
    logs = [np.log(np.maximum(values, 1.0)) for values in (colors, skin, hair)]
    middle = np.median(logs[1], axis=0)
    around = logs[1] - middle
    near = (around**2).sum(axis=1) <= np.quantile((around**2).sum(axis=1), 0.9)  # lips and brows apart
    spread = around[near].T @ around[near] / near.sum() + 0.03**2 * np.eye(3)
    whiten = np.linalg.inv(np.linalg.cholesky(spread)).T
    here, beside = (
        (logs[0] - middle) @ whiten,
        (np.median(logs[2].reshape(len(colors), -1, 3), axis=1) - middle) @ whiten,
    )
    apart = (beside**2).sum(axis=1)
    along = (here * beside).sum(axis=1)
    return (apart > TOLD_APART**2) & (along > 0.5 * apart)


def solve_fill(V, F, regions, mirror, outer, means, share, default):
    """The Fill of a head.

    V (n, 3) neutral, F (m, 3) skin; regions name -> (n,) bool; mirror (n,); outer (n,) bool
    means (n, 3) sRGB around each vertex and share (n,) of its texels that met the scan (texels.gather_at_vertices)
    default (3,) sRGB, the skin's colour where the scan has none at all
    """
    n = len(V)
    weight = feather(V, F, outer, share, mirror)
    holes = outer & (share < SHOWN_SHARE)
    known = outer & (share >= SHOWN_SHARE) & (surface_distance(V, F, holes, TRUSTED_MM) >= TRUSTED_MM)
    skin = np.median(means[known], axis=0) if known.any() else np.asarray(default, float)
    color = np.where(known[:, None], means, skin)

    wide = surface_distance(V, F, _large(V, F, holes & holes[mirror]), BAND_MM)
    eased = known & (wide < BAND_MM)
    own = np.where((outer & (share >= SHOWN_SHARE))[:, None], means, np.nan)

    twin_known = known[mirror] & outer
    nowhere = outer & ~known & ~twin_known
    twin_known &= surface_distance(V, F, nowhere, LOST_MM) >= LOST_MM
    guide = np.where(twin_known[:, None], means[mirror], 0.0)
    # The skin first, then what lies behind its rims: a dark mouth must not tint a cheek that nobody saw.
    rest = np.where(eased[:, None], means, skin)
    # Guided by the other side nothing is forgotten.
    memory = np.where(twin_known, np.inf, FORGET_MM)
    memory[eased] = np.maximum(EASE_MM * (1.0 - wide[eased] / BAND_MM), 1e-3)
    held = known & ~eased
    color = _poisson(V, F, color, held, outer & ~held, guide, twin_known & ~eased, rest, memory)
    fixed = outer.copy()
    behind = surface_distance(V, F, outer, 20.0)
    for name, (tone, depth) in INTERIORS.items():
        deep = regions.get(name, np.zeros(n, bool)) & ~outer & (behind >= depth)
        color[deep] = skin * tone
        fixed |= deep
    color = _poisson(V, F, color, fixed, ~fixed, guide, np.zeros(n, bool), skin, FORGET_MM)
    # No detail on faces that touch an unknown twin: an edge may be longer than the ramp.
    unknown = dilate(outer & ~twin_known, F)
    detail = np.where(outer, np.clip(surface_distance(V, F, unknown, FEATHER_MM) / FEATHER_MM, 0.0, 1.0), 0.0)
    own = np.where(np.isfinite(own), own, color)
    return Fill(color, weight, own, detail, own[mirror])


def _poisson(V, F, color, held, free, guide, guided, rest, memory):
    """Solve for the colours (n, 3) of the free vertices between the held ones; others take no part.

    guide (n, 3) where guided (n,); memory (n,) or one, mm: what is held is forgotten over it
    rest (3,) or (n, 3): the colour for which it is forgotten
    """
    if not free.any():
        return color
    n = len(V)
    edges = unique_edges(F)
    edges = edges[(held | free)[edges].all(axis=1)]
    length = np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1)
    # 1 / length makes a membrane on meshes of uneven density; cotangents go negative at slivers.
    weights = 1.0 / np.maximum(length, 1e-3)
    ones = np.tile([1.0, -1.0], len(edges))
    difference = sp.csr_matrix((ones, edges.ravel(), np.arange(0, 2 * len(edges) + 1, 2)), shape=(len(edges), n))
    wanted = np.where(guided[edges].all(1)[:, None], difference @ guide, 0.0)
    A = (difference.T @ sp.diags(weights) @ difference).tocsr()
    b = difference.T @ (weights[:, None] * wanted)
    # On an even mesh of spacing h the edges' sum is about 1.5 h times the Laplacian.
    spacing = np.bincount(edges.ravel(), np.repeat(length, 2), n) / np.maximum(
        np.bincount(edges.ravel(), minlength=n), 1
    )
    ridge = RIDGE * max(weights.mean() if len(weights) else 1.0, 1e-9) + 1.5 * spacing / np.square(memory)
    system = A[free][:, free] + sp.diags(ridge[free])
    right = b[free] - A[free][:, held] @ color[held] + (ridge[:, None] * rest)[free]
    result = color.copy()
    result[free] = np.clip(Factorization(system).solve(right), 0.0, 255.0)
    return result


def _length_graph(V, F):
    """(n, n) csr of edge lengths in mm."""
    edges = unique_edges(F)
    length = np.maximum(np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1), 1e-6)
    return sp.coo_matrix((length, (edges[:, 0], edges[:, 1])), shape=(len(V), len(V))).tocsr()
