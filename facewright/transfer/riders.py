"""What rides on the lids: lashes, tear film, caruncle and the soft strips between lid and eyeball.

A lid is a shell that turns about the eyeball. So each vertex of such a part hangs on a point of the skin, its root (its
own nearest point, or for a lash the root of its card), in a frame of the root's direction from the eye's centre and the
margin's direction there. Roots are points of triangles: under any mix of targets they stay on the skin exactly, only
what stands off them turns with the lid. Strips that lie on the eyeball are kept off its cornea, wherever it looks.

A part is attached so by `attach = "lid_left"` or `"lid_right"` (docs/template.md).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from facewright.mesh.adjacency import unique_edges, vertex_components
from facewright.mesh.closest import Surface, interpolate
from facewright.solve.procrustes import best_rotation
from facewright.transfer.eyeball import carried_eyeball, measure_eyeball

SIDES = ("left", "right")
_ROOT_MM = 0.25  # vertices this near to the skin are roots
_CLEAR_MM = 0.05  # of what stands off the eyeball, at least
_LIES_MM = 0.3  # what is nearer than this lies on the eyeball and stays as near
_NEAR_MM = 30.0  # skin this far from the eye's centre can carry roots


def lid_parts(template, side):
    """The parts that ride on the lids of one side."""
    return [part for part in template.parts if part.attach == f"lid_{side}"]


class LidRiders:
    """The riding parts of one side on any head of a template's topology.

    index (r,) the template's vertices that ride; root_faces (r,), root_barycentric (r, 3) their roots on the skin
    carriers (c,) vertices of the skin that these, and the directions there, depend on
    """

    def __init__(self, template, side):
        self.template, self.side = template, side
        self.parts = lid_parts(template, side)
        self.index = np.concatenate([np.arange(*part.vertices) for part in self.parts] or [np.empty(0, int)])
        if not len(self.index):
            return
        ball = measure_eyeball(template, side)
        points = template.vertices[self.index]
        self.root_faces, self.root_barycentric = self._roots(points, ball)
        self.before, self.after = self._margin_beside(template)
        self.carriers = np.unique(np.concatenate([template.faces[self.root_faces].ravel(), self.before, self.after]))
        root, frames = self._frames(template.vertices, ball)
        self._offset = np.einsum("rij,rj->ri", frames, points - root)
        gap = ball.gap(points)
        stands_off = np.linalg.norm(points - root, axis=1) > _ROOT_MM
        self._clear = np.where(gap > 0, np.minimum(gap, _CLEAR_MM), -np.inf)
        self._lies = (gap > 0) & (gap < _LIES_MM) & stands_off
        self._gap = gap
        # What lies between lids and eyeball goes back with it: shut lids would have it before them.
        lashes = np.repeat(
            [part.name.startswith("lashes") for part in self.parts],
            [part.vertices[1] - part.vertices[0] for part in self.parts],
        )
        self._most = np.where(~lashes & stands_off & (gap > 0), gap, np.inf)
        self._rest_radius = ball.radius

    def placed(self, vertices, ball):
        """(r, 3) the riders on a head (n, 3) with an Eyeball."""
        root, frames = self._frames(vertices, ball)
        points = root + np.einsum("rij,ri->rj", frames, self._offset) * (ball.radius / self._rest_radius)
        gap = np.where(self._lies, self._gap, np.clip(ball.gap(points), self._clear, self._most))
        held = gap != ball.gap(points)
        points[held] = ball.pushed_to(points[held], gap[held])
        return points

    def _frames(self, vertices, ball):
        """Roots (r, 3) and frames (r, 3, 3), rows: along the margin, away from the eye's centre, across the margin."""
        root = interpolate(vertices, self.template.faces, self.root_faces, self.root_barycentric)
        away = _unit(root - ball.center)
        along = vertices[self.after] - vertices[self.before]
        along = _unit(along - (along * away).sum(axis=1, keepdims=True) * away)
        return root, np.stack([along, away, np.cross(along, away)], axis=1)

    def _roots(self, points, ball):
        """Faces of the template and barycentric coordinates of each rider's root."""
        template = self.template
        F = template.faces[template.skin.face_slice]
        near = np.flatnonzero(np.linalg.norm(template.vertices[F[:, 0]] - ball.center, axis=1) < _NEAR_MM)
        found = Surface(template.vertices, F[near]).closest(points)
        place = np.full(len(template.vertices), -1)
        place[self.index] = np.arange(len(self.index))
        faces = place[np.concatenate([template.faces[part.face_slice] for part in self.parts])]
        carrier = _carriers(points, faces, found.distance)
        return template.skin.faces[0] + near[found.faces[carrier]], found.barycentric[carrier]

    def _margin_beside(self, template):
        """(r,), (r,) the margin vertices before and after the one nearest to each root."""
        chains = [np.asarray(template.lines[f"lid_{lid}_{self.side}"]) for lid in ("upper", "lower")]
        margin = np.concatenate(chains)
        before = np.concatenate([np.append(chain[0], chain[:-1]) for chain in chains])
        after = np.concatenate([np.append(chain[1:], chain[-1]) for chain in chains])
        root = interpolate(template.vertices, template.faces, self.root_faces, self.root_barycentric)
        # The canthi are in both chains: which of the two is found must not differ from left to right.
        once = np.unique(margin, return_index=True)[1]
        nearest = once[cKDTree(template.vertices[margin[once]]).query(root)[1]]
        return before[nearest], after[nearest]


def ride_on_lids(face, deltas, names, correctives=None):
    """Deltas (t, n, 3) of all targets of a Face with those of its lid parts made anew from the skin's and the eyes'.

    deltas t of (n, 3), names (t,); correctives as in data.Rig: such a target is what its pose lacks when the drivers
    are added up
    """
    result = np.array(deltas)
    for side in SIDES:
        riders = LidRiders(face.template, side)
        if not len(riders.index):
            continue
        ball = carried_eyeball(face.template, face.vertices, side)
        rest = riders.placed(face.vertices, ball)
        eye = face.template.part(f"eye_{side}").vertex_slice
        carriers = np.concatenate([riders.carriers, np.arange(eye.start, eye.stop)])
        for number, name in enumerate(names):
            drivers = [names.index(driver) for driver in (correctives or {}).get(name, ())]
            together = [deltas[target] for target in (number, *drivers)]
            moved = rest
            if any(delta[carriers].any() for delta in together):
                pose = sum(together)
                moved = riders.placed(face.vertices + pose, _moved(ball, face.vertices[eye], pose[eye]))
            result[number, riders.index] = moved - rest - sum(result[driver, riders.index] for driver in drivers)
    return result


def _moved(ball, points, delta):
    """The Eyeball when its mesh's points (k, 3) move by delta (k, 3)."""
    if not delta.any():
        return ball
    R, middle = best_rotation(points, points + delta), points.mean(axis=0)
    return replace(ball.turned(R), center=middle + delta.mean(axis=0) + R @ (ball.center - middle))


def _carriers(points, faces, distance):
    """(r,) the vertex whose root each vertex takes: itself near the skin, else the nearest such along the edges.

    points (r, 3), faces (m, 3), distance (r,) mm from the skin; a piece with no vertex near the skin takes its nearest
    """
    n = len(points)
    piece = vertex_components(faces, n)
    least = np.full(piece.max() + 1, np.inf)
    np.minimum.at(least, piece, distance)
    roots = np.flatnonzero(distance <= np.maximum(_ROOT_MM, least[piece] + 1e-9))
    edges = unique_edges(faces)
    length = np.maximum(np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1), 1e-9)
    graph = sp.coo_matrix((length, edges.T), shape=(n, n)).tocsr()
    return dijkstra(graph, directed=False, indices=roots, min_only=True, return_predecessors=True)[2]


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
