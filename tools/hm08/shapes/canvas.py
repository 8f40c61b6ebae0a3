"""Where a shape is sketched: named places on the skin, sections of the lips, and the smooth field through them.

A sketch says how far a few places go; the skin between them goes with the least bending (bi-Laplacian with a reach,
after thin plates).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.laplacian import lumped_mass
from facewright.mesh.raster import RayScene
from facewright.solve.quadratic import Factorization
from hm08.regions import geodesic
from hm08.shapes.lips import lip_sections

POINT_WEIGHT, LID_WEIGHT, DEEP_WEIGHT = 0.6, 0.4, 0.02
DEEP_MM = 14.0  # of the mouth's inside from the seam: rests on the bones
SOCKET_MM = 5.0


class Canvas:
    """The skin of a Head as something to sketch on.

    head Head; regions name -> (n,) bool; places name -> (x, y) mm as seen from the front
    """

    def __init__(self, head, regions, places):
        self.head, self.regions = head, regions
        self.V, self.F, self.mirror = head.V, head.F, head.mirror
        n = len(self.V)
        self.mass = sp.diags(lumped_mass(self.V, self.F))
        margin = np.concatenate([head.lines["lid_upper_left"], head.lines["lid_lower_left"]])
        sockets = regions["socket_left"] | regions["socket_right"]
        seam = np.concatenate([head.lines["lip_seam_upper"], head.lines["lip_seam_lower"]])
        self.from_seam = geodesic(self.V, self.F, seam)
        from_lids = geodesic(self.V, self.F, np.concatenate([margin, self.mirror[margin]]))
        ears = regions["ear_left"] | regions["ear_right"]
        self.still = regions["skull"] | ears | (sockets & (from_lids > SOCKET_MM))
        self.deep = regions["mouth_interior"] & (self.from_seam > DEEP_MM)
        self.free = np.flatnonzero(~self.still)
        self.section = lip_sections(head)
        self.places = self._find(places)
        self.n = n

    def _find(self, places):
        """name -> vertex (k,) and barycentric (k,) rows on both sides, as sparse (n,) rows: left, right."""
        outer = self.regions["outer"][self.F].all(axis=1)
        faces = self.F[outer]
        scene = RayScene(self.V, faces)
        points = np.array([[x, y, 300.0] for x, y in places.values()])
        hits = scene.cast(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)))
        return {name: (faces[f], b) for name, f, b in zip(places, hits.face, hits.barycentric)}

    def place(self, name):
        """(3,) mm of a named place."""
        corners, shares = self.places[name]
        return shares @ self.V[corners]

    def off_middle(self, name):
        """Whether a place has a twin on the other side."""
        return abs(self.place(name)[0]) > 1e-6

    def lids(self, lower_deg):
        """[(vertices, displacements, weights)] of the lid margins: still, but the lower turns up about the ball."""
        upper, lower = self.head.lines["lid_upper_left"], self.head.lines["lid_lower_left"][1:-1]
        offset = self.V[lower] - self.head.eye_center
        share = np.linspace(0.0, np.pi, len(lower) + 2)[1:-1]
        angle = -np.radians(lower_deg) * np.sin(share) ** 0.6
        c, s = np.cos(angle), np.sin(angle)
        y, z = offset[:, 1], offset[:, 2]
        moves = np.stack([0 * y, c * y - s * z - y, s * y + c * z - z], axis=1)
        sides = []
        for vertices, move in ((upper, np.zeros((len(upper), 3))), (lower, moves)):
            weights = np.full(len(vertices), LID_WEIGHT)
            sides += [(vertices, move, weights), (self.mirror[vertices], move * [-1, 1, 1], weights)]
        return sides

    def field(self, points, lines=(), reach_mm=45.0):
        """(n, 3) the field with the least bending through a sketch.

        points    [(name, side, (3,) displacement)]; side 1 is the left, -1 the right one's mirrored place
        lines     [(vertices (k,), displacements (k, 3), weights (k,))]
        reach_mm  the field fades over about this distance from the last place
        """
        rows = [self._row(name, side) for name, side, _ in points]
        values = [np.reshape([d for *_, d in points], (-1, 3))]
        weights = [np.full(len(points), POINT_WEIGHT)]
        deep = np.flatnonzero(self.deep)
        rest = (deep, np.zeros((len(deep), 3)), np.full(len(deep), DEEP_WEIGHT))
        for vertices, moves, strength in [*lines, rest]:
            k = len(vertices)
            rows.append(sp.csr_matrix((np.ones(k), (np.arange(k), vertices)), shape=(k, self.n)))
            values.append(moves)
            weights.append(strength)
        return self._solve(sp.vstack(rows).tocsr(), np.concatenate(values), np.concatenate(weights), reach_mm)

    def _row(self, name, side):
        corners, shares = self.places[name]
        corners = corners if side > 0 else self.mirror[corners]
        return sp.csr_matrix((shares, (np.zeros(3, int), corners)), shape=(1, self.n))

    def _solve(self, B, values, weights, reach_mm):
        A = self.head.K + self.mass / reach_mm**4 + B.T @ sp.diags(weights) @ B
        f = self.free
        u = np.zeros((self.n, 3))
        u[f] = Factorization(A.tocsr()[f][:, f]).solve((B.T @ (weights[:, None] * values))[f])
        return u
