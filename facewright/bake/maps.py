"""Albedo, normal and coverage maps in the template's layout, baked from a scan through a fitted head.

Texels of the outer skin look at the scan from face.fit, the surface that lies on it. Inner mouth, eye sockets, nostril
insides and what the scan does not show are filled (bake/fill.py), and so are rims of nostrils (bake/nostrils.py) and
what is torn in the scan's own picture (bake/charts.py). Light that is baked into a scan's colours stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from facewright.bake.charts import find_cuts, find_tears, guarded_edges
from facewright.bake.fill import feather, hair_stains, solve_fill, surface_distance
from facewright.bake.grain import grain, grain_strength
from facewright.bake.mirror import mirrored_corner_uv
from facewright.bake.nostrils import around_nostrils, darkened, hole_rims, nostril_light
from facewright.bake.project import project_to_scan
from facewright.bake.pyramid import push_pull
from facewright.bake.sample import ScanLooks, sample_pixels
from facewright.bake.texels import (
    at_corners,
    at_points,
    build_texels,
    dots,
    gather_at_vertices,
    in_chunks,
    texel_densities,
    unit_rows,
)
from facewright.mesh.closest import Surface
from facewright.mesh.normals import vertex_normals
from facewright.mesh.render import LUMA, linear_to_srgb
from facewright.mesh.tangents import corner_tangents, to_tangent_space

SEEN, FILLED, INSIDE = 255, 128, 0
HAIR_EDGE_MM = 6.0
# Beside hair, what has less than so much of the skin's brightness is a strand.
STRANDS_MM, STRAND_SHARE, STRAND_ROUNDS = 15.0, 0.9, 2
BROWS_MM = 32.0  # from eyes, lips and nostrils
SPECK_MM = 6.0
HAIR_TEXEL_MM = 2.0  # hair's colour is that of a lock, not of a strand
DETAIL_STRIDE = 31
DEFAULT_SKIN = (0.60, 0.42, 0.34)


@dataclass(frozen=True)
class BakeOptions:
    """size             side of the square maps in texels
    max_distance_mm  how far the scan may lie from the fit to be seen; less where the fit is close
    """

    size: int = 2048
    max_distance_mm: float = 3.0


@dataclass(frozen=True)
class _Skin:
    """The skin part of a face: V (n, 3) fit, F (m, 3), UV (t, 2), FT (m, 3), outer_faces (m,), observed (n,),
    hair (n,): hidden by it."""

    V: np.ndarray
    neutral: np.ndarray
    F: np.ndarray
    UV: np.ndarray
    FT: np.ndarray
    outer_faces: np.ndarray
    outer: np.ndarray
    observed: np.ndarray
    hair: np.ndarray


def bake(scan, face, options=None, jobs=1):
    """Maps of the scan's looks in the layout of the face's template.

    scan     data.Scan in our frame: textured, with vertex colours, or clay
    face     data.Face whose fit lies on the scan
    options  BakeOptions; jobs is the number of threads, which changes no texel
    returns  dict of (size, size, ...) uint8, row 0 at v = 1:
             albedo (3 channels) sRGB, the scan's colours as they are; normal (3) linear, tangent space, +Y, frame by
             MikkTSpace on face.fit with area-weighted vertex normals; coverage 255 seen by the scan, 128 filled from
             the other side or the surroundings, 0 inside (mouth, sockets, nostrils) and outside the charts
    """
    options = options or BakeOptions()
    skin = _skin_of(face)
    texels = build_texels(skin.UV, skin.FT, options.size, jobs)
    can_see = skin.outer_faces[texels.face]
    wanted = can_see & _observed(skin, texels, jobs)
    rays = vertex_normals(skin.V, skin.F[skin.outer_faces])
    hits = project_to_scan(scan, skin.V, skin.F, rays, texels, wanted, options.max_distance_mm, jobs)
    colors, colored, beside, bends, met = _look(scan, skin, texels, hits, options.size, jobs)

    has_color = bool(colored.any())
    colored, fill, rims = _filled(scan, face, skin, texels, colors, colored, can_see & ~beside, jobs)
    geometry_share = gather_at_vertices(np.empty((len(texels), 0)), met, can_see, texels, skin.F, len(skin.V), jobs)[1]
    shown, mirror = np.where(rims, 0.0, geometry_share), face.template.mirror[: len(skin.V)]
    geometry_weight = feather(skin.V, skin.F, skin.outer, shown, mirror)

    albedo = _compose_albedo(face, skin, texels, colors, colored, fill, jobs)
    normal = _compose_normal(skin, texels, bends, met, geometry_weight, jobs)
    weight = fill.weight if has_color else geometry_weight
    coverage = _coverage(skin, texels, colored if has_color else met, weight, can_see, jobs)
    return {"albedo": albedo, "normal": normal, "coverage": coverage}


def describe_maps(face, maps):
    """dict of numbers for a manifest: size, texel density in region `face` (texels per mm), shares of the skin."""
    skin = _skin_of(face)
    size = maps["albedo"].shape[0]
    density = texel_densities(skin.neutral, skin.F, skin.UV, skin.FT, size)
    front = face.regions["face"][skin.F].all(axis=1) if "face" in face.regions else skin.outer_faces
    coverage = maps["coverage"]
    return {
        "size": size,
        "texels_per_mm_face_median": round(float(np.median(density[front])), 3) if front.any() else None,
        "texels_per_mm_face_p5": round(float(np.percentile(density[front], 5)), 3) if front.any() else None,
        "outer_skin_seen_share": round(float((coverage == SEEN).sum() / max((coverage > 0).sum(), 1)), 4),
    }


def _skin_of(face):
    template = face.template
    n = template.skin.vertices[1]
    F = template.faces[template.skin.face_slice]
    mask = face.regions["outer"][:n]
    outer_faces = mask[F].all(axis=1)
    outer = np.zeros(n, bool)
    outer[F[outer_faces].ravel()] = True
    FT = template.uv_faces[template.skin.face_slice]
    observed = _without_specks(face.fit[:n], F, face.observed[:n] | ~outer)
    hair = face.regions.get("hidden", np.zeros(n, bool))[:n] & ~observed
    # Where hair begins its colour already lies on the skin.
    observed &= surface_distance(face.fit[:n], F, hair, HAIR_EDGE_MM) >= HAIR_EDGE_MM
    return _Skin(face.fit[:n], face.vertices[:n], F, template.uv, FT, outer_faces, outer, observed, hair)


def _hair_colors(scan, skin):
    """(h, 3) sRGB of the scan beside each vertex that hair hides; black without colours."""
    looks = ScanLooks(scan, with_normals=False)
    found = Surface(scan.vertices, scan.faces).closest(skin.V[skin.hair])
    return looks.colors(found.faces, found.barycentric.astype(np.float32), np.full(len(found.faces), HAIR_TEXEL_MM))[0]


def _without_specks(V, F, observed):
    """(n,) bool: observed, but for holes narrower than twice SPECK_MM. A fit that was led by lines or stiff there lies
    on the scan all the same, and rays find out whether it does.
    """
    core = ~observed & (surface_distance(V, F, observed, SPECK_MM) >= SPECK_MM)
    return observed | (surface_distance(V, F, core, SPECK_MM) >= SPECK_MM)


def _default_skin(template):
    """(3,) sRGB 0..255: the colour of the skin's material."""
    material = template.materials.get(template.skin.material, {})
    return linear_to_srgb(np.array(material.get("color", DEFAULT_SKIN), float)) * 255.0


def _observed(skin, texels, jobs):
    """(k,) bool: the fit follows the scan at the texel."""
    observed = skin.observed.astype(np.float32)

    def work(piece):
        return at_points(observed, skin.F, texels.face[piece], texels.barycentric[piece]) >= 0.5

    return _joined(in_chunks(work, len(texels), jobs), (0,), bool)


def _look(scan, skin, texels, hits, size, jobs):
    """What the texels see: colours (k, 3) float32, colored (k,), beside (k,) a tear in the scan's picture and so not
    colored, x and y of tangent-space normals (k, 2), met (k,)."""
    looks = ScanLooks(scan)
    cuts = find_cuts(looks)
    guarded, steps = guarded_edges(looks, cuts)
    tears = find_tears(looks.scan, cuts, steps)
    if len(cuts.here):
        looks.guard(guarded)
    texel_mm = (1.0 / np.maximum(texel_densities(skin.V, skin.F, skin.UV, skin.FT, size), 1e-6)).astype(np.float32)
    normals = vertex_normals(skin.V, skin.F)
    tangents, signs = corner_tangents(skin.V, skin.F, normals, skin.UV, skin.FT)
    tangents, signs = tangents.astype(np.float32), signs.astype(np.float32)
    k = len(texels)
    colors, colored = np.zeros((k, 3), np.float32), np.zeros(k, bool)
    bends, met, beside = np.zeros((k, 2), np.float32), hits.face >= 0, np.zeros(k, bool)
    seen = np.flatnonzero(met)

    def work(piece):
        at = seen[piece]
        face, barycentric, on_scan = texels.face[at], texels.barycentric[at], hits.face[at]
        spacing = texel_mm[face]
        colors[at], known = looks.colors(on_scan, hits.barycentric[at], spacing)
        beside[at] = known & tears.beside(on_scan, hits.barycentric[at])
        colored[at] = known & ~tears.islands[on_scan] & ~beside[at]
        normal = unit_rows(at_points(normals, skin.F, face, barycentric))
        tangent = unit_rows(at_corners(tangents, face, barycentric))
        direction = looks.normals(on_scan, hits.barycentric[at], spacing)
        bend = to_tangent_space(direction, normal, tangent, signs[face])
        bend[:, 2] = np.maximum(bend[:, 2], 0.1)  # a normal map cannot turn a surface away from the viewer
        bends[at] = unit_rows(bend)[:, :2]

    in_chunks(work, len(seen), jobs)
    return colors, colored, beside, bends, met


def _filled(scan, face, skin, texels, colors, colored, can_see, jobs):
    """(k,) bool of the texels whose colour is the skin's, not that of hair on it, the Fill for the others, and (n,)
    bool of the rims of nostrils that are filled too."""
    n = len(skin.V)
    regions = {name: mask[:n] for name, mask in face.regions.items()}
    means, share = gather_at_vertices(colors, colored, can_see, texels, skin.F, n, jobs)
    bare = ~_bearded(skin.neutral, regions)
    stains = hair_stains(skin.V, skin.F, means, share, skin.hair, _hair_colors(scan, skin), bare)
    nostrils, mirror = regions.get("nostrils", np.zeros(n, bool)), face.template.mirror[:n]
    light = nostril_light(skin.neutral, skin.F, nostrils)
    rims = hole_rims(skin, texels, colors, colored, means, share, nostrils, light)
    rims |= rims[mirror]

    def solved():
        known, default = np.where(stains | rims, 0.0, share), _default_skin(face.template)
        return solve_fill(skin.neutral, skin.F, regions, mirror, skin.outer, means, known, default)

    fill = solved()
    beside = bare & (surface_distance(skin.V, skin.F, skin.hair | stains, STRANDS_MM) < STRANDS_MM)
    for _ in range(STRAND_ROUNDS):  # what strands have darkened hides others
        strands = colored & _strands(skin, texels, colors, beside, fill, jobs)
        if not strands.any():
            break
        colored = colored & ~strands
        means, share = gather_at_vertices(colors, colored, can_see, texels, skin.F, n, jobs)
        fill = solved()
    detail = np.where(around_nostrils(skin.neutral, skin.F, nostrils), 0.0, fill.detail)
    return colored, replace(fill, color=darkened(fill.color, light), detail=detail), rims


def _bearded(V, regions):
    """(n,) bool of a neutral (n, 3): where brows, lashes and beards grow, which stay."""
    none = np.zeros(len(V), bool)
    features = np.any([regions.get(name, none) for name in ("eyes", "lips", "nostrils")], axis=0)
    if not features.any():
        return regions.get("face", none)
    near = cKDTree(V[features]).query(V)[0] < BROWS_MM
    return regions["face"] & (near | (V[:, 1] < V[regions["eyes"], 1].mean()))


def _strands(skin, texels, colors, beside, fill, jobs):
    """(k,) bool: texels of vertices beside hair (n,) that are much darker than the skin there: single strands of it,
    which the colours of vertices do not tell."""
    share = beside.astype(np.float32)

    def work(piece):
        face, barycentric = texels.face[piece], texels.barycentric[piece]
        odd = np.zeros(len(face), bool)
        at = np.flatnonzero(at_points(share, skin.F, face, barycentric) > 0)
        usual = at_points(fill.color, skin.F, face[at], barycentric[at]) @ LUMA
        odd[at] = colors[piece][at] @ LUMA < STRAND_SHARE * usual
        return odd

    return _joined(in_chunks(work, len(texels), jobs), (0,), bool)


def _compose_albedo(face, skin, texels, colors, colored, fill, jobs):
    """(size, size, 3) uint8: the scan's colours, the fill where it has none, gutters."""
    template, n = face.template, len(skin.V)
    bare = ~_bearded(skin.neutral, {name: mask[:n] for name, mask in face.regions.items()})
    seen = _spread(texels, colors, colored)
    corner_uv = mirrored_corner_uv(skin.F, template.polygons, template.uv_polygons, template.uv, template.mirror)
    mirrored_face = np.isfinite(corner_uv).all(axis=(1, 2))
    size = texels.size
    result = np.empty((len(texels), 3), np.float32)
    strength = grain_strength(_details(skin, texels, colors, colored & bare[skin.F].all(axis=1)[texels.face], fill))
    strength = strength.astype(np.float32)
    rough, here = bool(strength.any()), skin.outer_faces
    known = np.column_stack([fill.color, fill.own, fill.weight, fill.detail])

    def work(piece):
        face, barycentric = texels.face[piece], texels.barycentric[piece]
        values = at_points(known, skin.F, face, barycentric)
        filled, own = values[:, :3], seen[texels.index[piece]] - values[:, 3:6]
        # Faces behind a rim may lie in another chart: what was spread there from seen texels is of other skin.
        weight, detail = values[:, 6:7] * here[face, None], values[:, 7] * here[face]
        at = np.flatnonzero((weight[:, 0] < 1) & (detail > 0) & mirrored_face[face])
        uv = at_corners(corner_uv, face[at], barycentric[at])
        other = sample_pixels(seen.reshape(size, size, 3), uv.astype(np.float64) * size)
        other -= at_points(fill.mirrored, skin.F, face[at], barycentric[at])
        filled[at] += (detail[at, None] * (1 - weight[at])) * other
        at = np.flatnonzero((weight[:, 0] < 1) & (detail < 1) & here[face] & rough)
        share = np.sqrt(1 - np.square(weight[at, 0])) * (1 - detail[at])
        filled[at] += (share * grain(at_points(skin.neutral, skin.F, face[at], barycentric[at])))[:, None] * strength
        result[piece] = filled + weight * own

    in_chunks(work, len(texels), jobs)
    image = _spread(texels, result, np.ones(len(texels), bool), gutters=True)
    return _bytes(image).reshape(size, size, 3)


def _details(skin, texels, colors, chosen, fill):
    """(j, 3) differences of some of the chosen texels (k,) from the scan's low-pass colour, where it is fully seen."""
    at = np.flatnonzero(chosen & (fill.weight == 1)[skin.F].all(axis=1)[texels.face])[::DETAIL_STRIDE]
    return colors[at] - at_points(fill.own, skin.F, texels.face[at], texels.barycentric[at])


def _compose_normal(skin, texels, bends, met, weight, jobs):
    """(size, size, 3) uint8: tangent-space normals, flat where the scan shows nothing."""
    seen = _spread(texels, bends, met)
    result = np.empty((len(texels), 2), np.float32)

    def work(piece):
        share = at_points(weight, skin.F, texels.face[piece], texels.barycentric[piece])
        share = share * skin.outer_faces[texels.face[piece]]
        result[piece] = seen[texels.index[piece]] * share[:, None]

    in_chunks(work, len(texels), jobs)
    xy = _spread(texels, result, np.ones(len(texels), bool), gutters=True)
    image = np.empty((len(xy), 3), np.uint8)

    def encode(piece):
        z = np.sqrt(np.maximum(1.0 - dots(xy[piece], xy[piece]), 0.0))
        image[piece] = _bytes(np.column_stack([xy[piece], z]) * 127.0 + 128.0)

    in_chunks(encode, len(xy), jobs)
    return image.reshape(texels.size, texels.size, 3)


def _coverage(skin, texels, seen, weight, can_see, jobs):
    """(size, size) uint8 of SEEN, FILLED and INSIDE."""
    result = np.full(texels.size**2, INSIDE, np.uint8)

    def work(piece):
        share = at_points(weight, skin.F, texels.face[piece], texels.barycentric[piece])
        direct = seen[piece] & (share > 0.5)
        result[texels.index[piece]] = np.where(direct, SEEN, np.where(can_see[piece], FILLED, INSIDE))

    in_chunks(work, len(texels), jobs)
    return result.reshape(texels.size, texels.size)


def _spread(texels, values, valid, gutters=False):
    """(size * size, c) float32: values (k, c) of the valid texels at their places, the other texels filled in between
    them, and with gutters what lies outside the charts too.
    """
    size, channels = texels.size, values.shape[1]
    image = np.zeros((size * size, channels), np.float32)
    weights, wanted = np.zeros(size * size, np.float32), np.full(size * size, gutters)
    at = texels.index[valid]
    image[at], weights[at], wanted[texels.index] = values[valid], 1.0, True
    square = (size, size)
    filled = push_pull(image.reshape(*square, channels), weights.reshape(square), wanted.reshape(square))
    return filled.reshape(-1, channels)


def _bytes(image):
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _joined(parts, empty_shape, dtype):
    return np.concatenate(parts) if parts else np.empty(empty_shape, dtype)
