"""Put the parts of a head together: which polygons of a source mesh belong to which part, in which order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facewright.data import Part
from facewright.errors import InputError
from facewright.mesh.normals import normalized
from facewright.mesh.polygons import polygon_centers
from facewright.template.atlas import Chart, banded_uv, in_unit_square, islands_with, pack_charts, uv_islands, welded_uv


@dataclass(frozen=True)
class Assembly:
    """The parts of a head put together.

    vertices (n, 3) mm; origin (n,) the source vertex of each
    polygons, uv_polygons (p, 4) into vertices and into uv (t, 2), part after part
    """

    vertices: np.ndarray
    origin: np.ndarray
    polygons: np.ndarray
    uv: np.ndarray
    uv_polygons: np.ndarray
    parts: tuple[Part, ...]

    def part(self, name):
        """The Part of a name; InputError if the description made none."""
        for part in self.parts:
            if part.name == name:
                return part
        raise InputError(f"template description: there must be a part {name!r}")

    @property
    def groups(self):
        """(n,) number of each vertex's part, and of that part's twin on the other side."""
        names = [part.name for part in self.parts]
        twins = [_twin_name(name) for name in names]
        size = [part.vertices[1] - part.vertices[0] for part in self.parts]
        number = {name: index for index, name in enumerate(names)}
        return np.repeat(np.arange(len(names)), size), np.repeat([number[twin] for twin in twins], size)

    @property
    def skin_polygons(self):
        """Slice of the skin's polygons."""
        triangles = np.where(self.polygons[:, 3] < 0, 1, 2).cumsum()
        return slice(0, int(np.searchsorted(triangles, self.parts[0].faces[1]) + 1))


def _twin_name(name):
    for ours, theirs in (("_left", "_right"), ("_right", "_left")):
        if name.endswith(ours):
            return name[: -len(ours)] + theirs
    return name


def assemble(description, mesh, unit, source_shapes):
    """The Assembly of a source ObjMesh; each [[parts]] entry takes what entries before it have left.

    source_shapes name -> (n, 3) mm, for entries that pick by motion
    """
    vertices = mesh.vertices * unit
    left = np.ones(len(mesh.polygons), bool)
    pieces = []
    for entry in description["parts"]:
        mine = left & _picked(entry, vertices, mesh.polygons, mesh.uv_polygons, source_shapes)
        if not mine.any():
            raise InputError(f"template description: part {entry['name']!r} picks no polygon of the source")
        left &= ~mine
        charts = description.get("atlas") if entry is description["parts"][0] else None
        piece = _piece(vertices, mesh.polygons[mine], mesh.uv, mesh.uv_polygons[mine], charts)
        if "uv_bands" in entry:
            piece = (*piece[:2], banded_uv(piece[2], entry["uv_bands"]), piece[3])
        pieces.append(piece)
    return _joined(description["parts"], vertices, pieces)


def _picked(entry, vertices, polygons, uv_polygons, source_shapes):
    """(p,) bool: polygons that an entry's keys pick, together."""
    picked = np.ones(len(polygons), bool)
    corners = np.where(polygons < 0, polygons[:, [0]], polygons)
    if "vertices" in entry:
        start, stop = entry["vertices"]
        picked &= ((corners >= start) & (corners < stop)).all(axis=1)
    if "islands" in entry:
        picked &= islands_with(polygons, uv_islands(uv_polygons), entry["islands"])
    if "moved_by" in entry:
        moving = np.linalg.norm(source_shapes[entry["moved_by"]], axis=1) > float(entry.get("moved_mm", 1.0))
        picked &= moving[corners].any(axis=1)
    for key in ("facing_deg", "not_facing_deg"):
        if key in entry:
            center, axis = _gaze(vertices[np.unique(corners[picked])])
            away = normalized(polygon_centers(vertices, polygons) - center)
            picked &= (away @ axis > np.cos(np.radians(entry[key]))) == (key == "facing_deg")
    return picked


def _gaze(points):
    """Centre (3,) of an eyeball and the unit direction of its cornea: where it bulges, else straight ahead."""
    center, radius = fit_sphere(points)
    away = points - center
    bulge = away[np.linalg.norm(away, axis=1) > 1.05 * radius]
    return center, normalized(bulge.mean(axis=0)) if len(bulge) else np.array([0.0, 0.0, 1.0])


def fit_sphere(points, rounds=5):
    """Centre (3,) and radius of the sphere that most points lie on; a bulge (a cornea) is left out by trimming."""
    keep = np.ones(len(points), bool)
    for _ in range(rounds):
        A = np.column_stack([2 * points[keep], np.ones(keep.sum())])
        solution = np.linalg.lstsq(A, (points[keep] ** 2).sum(axis=1), rcond=None)[0]
        center = solution[:3]
        radius = float(np.sqrt(solution[3] + center @ center))
        error = np.abs(np.linalg.norm(points - center, axis=1) - radius)
        keep = error <= max(np.percentile(error, 80), 1e-6)
    return center, radius


def _piece(vertices, polygons, uv, uv_polygons, charts):
    """origin (k,), polygons, uv, uv_polygons of one part, numbered from 0."""
    real = polygons >= 0
    origin, inverse = np.unique(polygons[real], return_inverse=True)
    own = np.full_like(polygons, -1)
    own[real] = inverse
    used, inverse = np.unique(uv_polygons[real], return_inverse=True)
    own_uv = np.full_like(uv_polygons, -1)
    own_uv[real] = inverse
    placed = uv[used]
    if charts:
        place = {int(source): index for index, source in enumerate(origin)}
        options = [
            Chart(tuple(place[v] for v in c["islands"]), tuple(c["box"]), c.get("half", ""), c.get("turn", 0))
            for c in charts
        ]
        placed, own_uv = pack_charts(vertices[origin], own, placed, own_uv, options)
    else:
        placed = in_unit_square(placed)
    return origin, own, *welded_uv(placed, own_uv, own)


def _joined(entries, vertices, pieces):
    """The Assembly of parts' pieces."""
    parts, polygons, uv_polygons = [], [], []
    n = t = m = 0
    for entry, (origin, own, placed, own_uv) in zip(entries, pieces):
        faces = int(np.where(own[:, 3] < 0, 1, 2).sum())
        material = entry.get("material", entry["name"])
        parts.append(Part(entry["name"], (n, n + len(origin)), (m, m + faces), material, entry.get("attach", "skin")))
        polygons.append(np.where(own < 0, -1, own + n))
        uv_polygons.append(np.where(own_uv < 0, -1, own_uv + t))
        n, t, m = n + len(origin), t + len(placed), m + faces
    origin = np.concatenate([piece[0] for piece in pieces])
    return Assembly(
        vertices=vertices[origin],
        origin=origin,
        polygons=np.vstack(polygons),
        uv=np.vstack([piece[2] for piece in pieces]),
        uv_polygons=np.vstack(uv_polygons),
        parts=tuple(parts),
    )
