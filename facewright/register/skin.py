"""The skin of a template prepared for fitting: what may be drawn to the scan, how stiff each part is, feature lines."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import dilate
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.facing import folded_faces
from facewright.mesh.normals import normalized, vertex_normals
from facewright.register.nonrigid import ElasticSkin, Rows

# Regions away from the features: how far inside the model the scan may lie before it is taken for a hole, how far
# outside before it is taken for hair or cloth (mm), how much stiffer than the face they are, what their data counts.
REGION_RULES = {
    "scalp": (10.0, 4.0, 3.0, 0.5),
    "neck": (8.0, 3.0, 3.0, 0.5),
    "ear_left": (5.0, 5.0, 6.0, 0.5),
    "ear_right": (5.0, 5.0, 6.0, 0.5),
}
# Hair may begin this far from eyes, lips and nostrils.
HAIR_FROM_MM = 32.0
# Rough surface there is not believed: hair and cloth scatter the normals this much more than the same scan's skin.
SKIN_RATIO, HAIR_RATIO = 1.2, 1.5
# So many folded faces are a hairline that the skin has climbed, and what lies so near is not believed.
WELT_FACES, WELT_MM = 10, 12.0
# A bald scalp is smoother than a face (0.4 of its roughness on a clean scan), a combed one as rough or rougher.
BALD_RATIO = 0.75
# The face is held to the model against data of one per mm2: bending and data leave it free to slide as a whole. Less so
# near eyes and lips, whose lines lead it, and hardly outside, where a model may be too small by more than is believed.
# Mean error of the face on ten heads a template with known truth, held by 0.0001, 0.001, 0.003, 0.01: hm08 0.90, 0.81,
# 0.78, 0.78; ICT 0.78, 0.78, 0.79, 0.80 mm.
HOLD, HELD_FROM_MM, LEAST_HELD, LOOSE = 3e-3, 15.0, 0.3, 1e-4


@dataclass(frozen=True)
class SkinRules:
    """Per skin vertex: trust (n,) 0..1 of data, stiffness (n,), inward and outward reach (n,) mm.

    hairy (n,) bool: hair may cover it, which the relief tells; curtained (n,) bool: hair may cover it or hang before
    it, which the colour tells: bearded cheeks are as rough, and a throat in the shade of its chin is as dark
    hold (n,): how much it is held to the model, against data of one per mm2
    """

    trust: np.ndarray
    stiffness: np.ndarray
    inward: np.ndarray
    outward: np.ndarray
    hairy: np.ndarray
    curtained: np.ndarray
    hold: np.ndarray

    def believe(self, rows, height, found):
        """(k,) factor in 0..1 for data at vertices rows (k, c): hair, cloth and holes are not believed.

        height (k,) mm of the scan above the template there, found correspond.Matches or Samples of it; with several
        vertices a row (a face's corners) the strictest counts
        """
        smooth = np.clip((HAIR_RATIO - found.roughness) / (HAIR_RATIO - SKIN_RATIO), 0.0, 1.0)
        inside = (height <= self.outward[rows].min(axis=1)) & (height >= -self.inward[rows].min(axis=1))
        hairy, curtained = self.hairy[rows].any(axis=1), self.curtained[rows].any(axis=1)
        return inside * np.where(hairy, smooth, 1.0) * np.where(curtained, np.clip(1.0 - found.hair, 0.0, 1.0), 1.0)


def skin_rules(template):
    """SkinRules of a template's skin vertices (the first part)."""
    stop = template.skin.vertices[1]
    regions = {name: mask[:stop] for name, mask in template.regions.items()}
    faces = template.faces[template.skin.face_slice]
    trust = (regions["outer"] & ~dilate(regions["nostrils"], faces, 1)).astype(float)
    # The rims of the openings turn inward where a scan has only a filled bump: they are led by their lines.
    for name in ("socket_left", "socket_right", "mouth_interior"):
        trust[dilate(regions[name], faces, 1)] = 0.0
    stiffness, inward, outward = np.ones(stop), np.full(stop, np.inf), np.full(stop, np.inf)
    for name, (deep, high, factor, share) in REGION_RULES.items():
        mask = regions.get(name, np.zeros(stop, bool)) & ~regions["face"]
        trust[mask] *= share
        stiffness[mask] = factor
        inward[mask], outward[mask] = deep, high
    vertices = template.vertices[:stop]
    features = regions["eyes"] | regions["lips"] | regions["nostrils"]
    away = cKDTree(vertices[features]).query(vertices)[0] > HAIR_FROM_MM
    above = vertices[:, 1] > vertices[regions["eyes"], 1].mean()
    ears = regions["ear_left"] | regions["ear_right"]
    hairy = regions["outer"] & away & (above | ~regions["face"]) & ~ears
    outward[hairy & regions["face"]] = 5.0
    curtained = regions["outer"] & away & ~ears & (vertices[:, 1] > vertices[regions["lips"], 1].mean())
    led, outside = (
        np.minimum(cKDTree(vertices[mask]).query(vertices)[0] / HELD_FROM_MM, 1.0)
        for mask in (regions["eyes"] | regions["lips"], regions["outer"] & ~regions["face"])
    )
    hold = np.maximum(HOLD * np.maximum(led, LEAST_HELD) * outside, LOOSE)
    return SkinRules(trust, stiffness, inward, outward, hairy, curtained, hold)


def without_hair(rules, template, vertices, target):
    """(SkinRules, bald): the scalp's data are believed only on a head whose scalp is as smooth as its skin.

    Hair lies close to the head and a few millimetres over it: where it is combed no vertex of it looks wrong by itself,
    and a scalp that follows it drags the forehead up by 5 mm. A bald one is believed however far it lies from the
    model, which a face says little about. vertices (n, 3): the model fitted to the face.
    """
    stop = template.skin.vertices[1]
    scalp = template.regions["scalp"][:stop] & template.regions["outer"][:stop]
    normals = vertex_normals(vertices[:stop], template.faces[template.skin.face_slice])
    found = target.match(vertices[:stop][scalp], normals[scalp], max_distance=15.0)
    seen = found.weights > 0
    bald = bool(seen.mean() > 0.3 and np.median(found.roughness[seen]) < BALD_RATIO)
    if not bald:
        return replace(rules, trust=np.where(scalp, 0.0, rules.trust)), bald
    inward, outward = (np.where(scalp, np.inf, reach) for reach in (rules.inward, rules.outward))
    return replace(rules, inward=inward, outward=outward), bald


def welts(template, skin, faces, surface, hairy):
    """(n,) bool: hairy skin (n, 3) around faces of the face that a fit has folded: there it climbs a hairline.

    Hair that is smooth, as in clay, is told from skin by nothing but its edge. faces (m, 3), surface the scan's
    mesh.closest.Surface, hairy (n,) bool as in SkinRules
    """
    mask = hairy & template.regions["face"][: len(skin)]
    folded = folded_faces(surface, skin, faces, mask[faces].all(axis=1))
    if len(folded) < WELT_FACES:
        return np.zeros(len(skin), bool)
    return hairy & (cKDTree(skin[faces[folded]].mean(axis=1)).query(skin)[0] < WELT_MM)


def line_rows(line, crease, weights, n):
    """Function of the current vertices: Rows that draw a line's vertices (k,) onto a crease, free to slide along it.

    crease lines.Crease, weights (p,) along it. Pairing by arc length was tried: where a crease ends is hard to tell,
    and on heads with known truth it stretched the mouth by 3 mm at each corner (lips 1.8 mm off, 0.4 without).
    """
    points = crease.points
    forward, across = _frames(crease)
    tree = cKDTree(points)
    matrix = sp.csr_matrix((np.ones(len(line)), (np.arange(len(line)), line)), shape=(len(line), n))

    def rows(vertices):
        nearest = tree.query(vertices[line])[1]
        beyond = (nearest == 0) | (nearest == len(points) - 1)
        pull = np.where(beyond, 0.0, weights[nearest])
        return [
            Rows(matrix, points[nearest], pull, across[nearest]),
            Rows(matrix, points[nearest], 0.25 * pull, forward[nearest]),
        ]

    return rows


def border_rows(line, border, weight, slack_mm, n):
    """Function of the current vertices: Rows that draw a line's vertices (k,) across to a border, by what is beyond.

    border lids.Border; slack_mm: how far beside it they may lie. It says nothing of depth: held to the scan's there,
    the skin around the eyes of five heads with known truth was 0.42 mm off, 0.32 without, 0.34 without any border.
    """
    points, across = border.points, _frames(border)[1]
    tree = cKDTree(points)
    matrix = sp.csr_matrix((np.ones(len(line)), (np.arange(len(line)), line)), shape=(len(line), n))

    def rows(vertices):
        nearest = tree.query(vertices[line])[1]
        inside = (nearest > 0) & (nearest < len(points) - 1)
        direction = across[nearest]
        aside = np.einsum("kc,kc->k", direction, vertices[line] - points[nearest])
        targets = points[nearest] + np.clip(aside, -slack_mm, slack_mm)[:, None] * direction
        return [Rows(matrix, targets, weight * inside, direction)]

    return rows


def aside_rows(vertices, points, forward, weight, slack_mm, n):
    """Function of the current vertices: Rows that draw vertices (k,) across a view to points (k, 3), by what is beyond.

    forward (3,) to the viewer; slack_mm: how far beside them they may lie
    """
    matrix = sp.csr_matrix((np.ones(len(vertices)), (np.arange(len(vertices)), vertices)), shape=(len(vertices), n))

    def rows(current):
        here = current[vertices]
        gap = points - here
        gap -= (gap @ forward)[:, None] * forward
        length = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
        share = np.clip(1.0 - slack_mm / length, 0.0, 1.0)
        return [Rows(matrix, here + share[:, None] * gap, np.full(len(vertices), weight))]

    return rows


def _frames(curve):
    """forward (p, 3) and across (p, 3) at the points of a lines.Crease or lids.Border."""
    tangents = normalized(np.gradient(curve.points, axis=0))
    forward = np.broadcast_to(curve.forward, curve.points.shape)
    return forward, normalized(np.cross(forward, tangents))


def contact_rows(upper, lower, offsets, weight, n):
    """Rows that keep paired vertices (k,), (k,) at offsets (k, 3) mm, upper minus lower: closed lips, shut lids."""
    k = len(upper)
    rows = np.concatenate([np.arange(k), np.arange(k)])
    matrix = sp.csr_matrix((np.repeat([1.0, -1.0], k), (rows, np.concatenate([upper, lower]))), shape=(k, n))
    return Rows(matrix, offsets, np.full(k, weight))


def fit_skin(start, faces, target, rules, leading, levels, samples=20000):
    """Coarse to fine non-rigid fit.

    start (n, 3) the model's skin, faces (m, 3), target correspond.Target, rules SkinRules
    leading: functions of the current vertices (n, 3) that return lists of Rows (feature lines, contact)
    levels: tuple of (w_bend, w_stretch, tau_mm, reach_mm)
    returns vertices (n, 3) and the Matches of the last level
    """
    skin = ElasticSkin(start, faces, rules.stiffness)
    seen = target.samples(samples)
    share = skin.mass.sum() / samples
    displacement = np.zeros_like(start)
    n = len(start)
    identity = sp.identity(n, format="csr")
    matches = None
    for w_bend, w_stretch, tau, reach in levels:
        vertices = start + displacement
        normals = vertex_normals(vertices, faces)
        matches = _matches(target, vertices, normals, rules, reach, tau)
        rows = [
            Rows(identity, matches.points, matches.weights * skin.mass, matches.normals),
            _pull_back(vertices, faces, normals, seen, rules, reach, tau, share),
            *(row for rule in leading for row in rule(vertices)),
        ]
        displacement = skin.solve(rows, w_bend, w_stretch, rules.hold, start=displacement)
    return start + displacement, matches


def _matches(target, vertices, normals, rules, reach, tau):
    found = target.match(vertices, normals, max_distance=reach, tau=tau)
    height = np.einsum("kc,kc->k", normals, found.points - vertices)
    itself = np.arange(len(vertices))[:, None]
    weights = found.weights * rules.trust * rules.believe(itself, height, found)
    return replace(found, weights=weights)


def _pull_back(vertices, faces, normals, samples, rules, reach, tau, share):
    """Rows from scan samples to the template, so that hollows that no vertex looks into are reached too."""
    nearest = Surface(vertices, faces).closest(samples.points)
    corners = faces[nearest.faces]
    trust = interpolate(rules.trust, faces, nearest.faces, nearest.barycentric)
    trust = np.where(rules.trust[corners].min(axis=1) > 0, trust, 0.0)
    smooth_normals = interpolate(normals, faces, nearest.faces, nearest.barycentric)
    height = np.einsum("kc,kc->k", smooth_normals, samples.points - nearest.points)
    agree = np.einsum("kc,kc->k", smooth_normals, samples.normals) > 0.5
    weights = trust * agree * (nearest.distance <= reach)
    weights *= rules.believe(corners, height, samples)
    weights = weights * (tau**2 / (tau**2 + nearest.distance**2)) ** 2 * share
    keep = np.flatnonzero(weights > 1e-6)
    rows = np.repeat(np.arange(len(keep)), 3)
    matrix = sp.csr_matrix(
        (nearest.barycentric[keep].ravel(), (rows, corners[keep].ravel())), shape=(len(keep), len(vertices))
    )
    return Rows(matrix, samples.points[keep], weights[keep], samples.normals[keep])
