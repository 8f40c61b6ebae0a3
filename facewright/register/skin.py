"""The skin of a template prepared for fitting: what may be drawn to the scan, how stiff each part is, feature lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import dilate
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.normals import vertex_normals
from facewright.register.correspond import Matches
from facewright.register.lines import arc_fractions, resample_line
from facewright.register.nonrigid import ElasticSkin, Rows

# How far each region may be from the model before the scan there is taken for hair, cloth or a hole, mm; how much
# stiffer than the face it is; and how much its data counts.
REGION_RULES = {
    "scalp": (8.0, 3.0, 0.5),
    "neck": (8.0, 3.0, 0.5),
    "ear_left": (5.0, 8.0, 0.3),
    "ear_right": (5.0, 8.0, 0.3),
}


@dataclass(frozen=True)
class SkinRules:
    """Per skin vertex: trust (n,) 0..1 of data, stiffness (n,), reach (n,) mm."""

    trust: np.ndarray
    stiffness: np.ndarray
    reach: np.ndarray


def skin_rules(template):
    """SkinRules of a template's skin vertices (the first part)."""
    stop = template.skin.vertices[1]
    regions = {name: mask[:stop] for name, mask in template.regions.items()}
    faces = template.faces[template.skin.face_slice]
    trust = (regions["outer"] & ~dilate(regions["nostrils"], faces, 1)).astype(float)
    # The rims of the openings turn inward where a scan has only a filled bump: they are led by their lines.
    for name in ("socket_left", "socket_right", "mouth_interior"):
        trust[dilate(regions[name], faces, 1)] = 0.0
    stiffness, reach = np.ones(stop), np.full(stop, np.inf)
    for name, (limit, factor, share) in REGION_RULES.items():
        mask = regions.get(name, np.zeros(stop, bool)) & ~regions["face"]
        trust[mask] *= share
        stiffness[mask] = factor
        reach[mask] = limit
    return SkinRules(trust, stiffness, reach)


def line_rows(line, points, weight, n):
    """Rows that draw the vertices of a line (k,) to a polyline on the scan (p, 3) by arc length."""
    return lambda vertices: Rows(
        sp.csr_matrix((np.ones(len(line)), (np.arange(len(line)), line)), shape=(len(line), n)),
        resample_line(points, arc_fractions(vertices[line])),
        np.full(len(line), weight),
    )


def contact_rows(upper, lower, weight, n):
    """Rows that draw paired vertices (k,), (k,) together, as closed lips are."""
    k = len(upper)
    rows = np.concatenate([np.arange(k), np.arange(k)])
    matrix = sp.csr_matrix((np.repeat([1.0, -1.0], k), (rows, np.concatenate([upper, lower]))), shape=(k, n))
    return Rows(matrix, np.zeros((k, 3)), np.full(k, weight))


def fit_skin(start, faces, target, rules, leading, levels, samples=20000):
    """Coarse to fine non-rigid fit.

    start (n, 3) the model's skin, faces (m, 3), target correspond.Target, rules SkinRules
    leading: functions of the current vertices (n, 3) that return Rows (feature lines, contact)
    levels: tuple of (w_bend, w_stretch, tau_mm, reach_mm)
    returns vertices (n, 3) and the Matches of the last level
    """
    skin = ElasticSkin(start, faces, rules.stiffness)
    points, point_normals = target.samples(samples)
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
            _pull_back(vertices, faces, normals, points, point_normals, rules, reach, tau, share),
            *(rule(vertices) for rule in leading),
        ]
        displacement = skin.solve(rows, w_bend, w_stretch, 1e-4, start=displacement)
    return start + displacement, matches


def _matches(target, vertices, normals, rules, reach, tau):
    found = target.match(vertices, normals, max_distance=reach, tau=tau)
    weights = found.weights * rules.trust * (found.distance <= rules.reach)
    return Matches(found.points, found.normals, weights, found.distance)


def _pull_back(vertices, faces, normals, points, point_normals, rules, reach, tau, share):
    """Rows from scan samples to the template, so that hollows that no vertex looks into are reached too."""
    nearest = Surface(vertices, faces).closest(points)
    corners = faces[nearest.faces]
    trust = interpolate(rules.trust, faces, nearest.faces, nearest.barycentric)
    trust = np.where(rules.trust[corners].min(axis=1) > 0, trust, 0.0)
    limit = np.minimum(rules.reach[corners].min(axis=1), reach)
    agree = np.einsum("kc,kc->k", interpolate(normals, faces, nearest.faces, nearest.barycentric), point_normals)
    weights = trust * (nearest.distance <= limit) * (agree > 0.5)
    weights = weights * (tau**2 / (tau**2 + nearest.distance**2)) ** 2 * share
    keep = np.flatnonzero(weights > 1e-6)
    rows = np.repeat(np.arange(len(keep)), 3)
    matrix = sp.csr_matrix(
        (nearest.barycentric[keep].ravel(), (rows, corners[keep].ravel())), shape=(len(keep), len(vertices))
    )
    return Rows(matrix, points[keep], weights[keep], point_normals[keep])
