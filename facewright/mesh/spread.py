"""A few prescribed displacements spread smoothly over the mesh around them."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from facewright.mesh.laplacian import cotangent_laplacian, lumped_mass
from facewright.solve.quadratic import Factorization

_LEAST_COTANGENT = 0.05  # obtuse corners have negative weights, which would let a field overshoot


def spread_smoothly(V, F, handles, values, free, reach_mm=np.inf):
    """The displacement field with the least bending that takes given values at handles and is 0 outside free.

    Minimises  u^T L M^-1 L u + u^T M u / reach^4  with cotangents floored at 0.05.
    V (n, 3), F (m, 3), handles (h,) vertex indices, values (h, d), free (n,) bool where the field may be other than 0
    reach_mm  the field fades over about this distance; without it a tilt at the handles grows with distance
    returns   (n, d); at the border of free the field and its slope vanish
    """
    return SmoothSpread(V, F, handles, free, reach_mm)(values)


class SmoothSpread:
    """spread_smoothly for many values at the same handles: the system is factored once."""

    def __init__(self, V, F, handles, free, reach_mm=np.inf):
        self.n, self.handles, self.used = len(V), handles, None
        unknown = free.copy()
        unknown[handles] = False
        if not unknown.any():
            return
        near = unknown.copy()
        near[F[unknown[F].any(axis=1)].ravel()] = True
        faces = F[near[F].any(axis=1)]  # two rings: enough for L M^-1 L at the unknowns
        self.used, local = np.unique(faces, return_inverse=True)
        energy = _bending(V[self.used], local.reshape(-1, 3), reach_mm)
        self.at = unknown[self.used]
        rows = energy[self.at]
        self.factor, self.known = Factorization(rows[:, self.at]), rows[:, ~self.at]

    def __call__(self, values):
        """(n, d) for values (h, d) at the handles."""
        field = np.zeros((self.n, values.shape[1]))
        field[self.handles] = values
        if self.used is not None:
            field[self.used[self.at]] = self.factor.solve(-(self.known @ field[self.used[~self.at]]))
        return field


class SoftSpread:
    """Displacements of least bending that follow wishes of some vertices.

    Minimises  sum_i w_i |u_i - d_i|^2 + smooth_mm^4 (u^T L M^-1 L u + u^T M u / reach^4), 0 outside free.
    What a push at one vertex does to all others is solved once, when it first wishes for something; wishes of k
    vertices then cost a dense system of k.
    V (n, 3), F (m, 3), free (n,) bool; reach_mm: the field fades over this distance
    ties    (one (k,), other (k,), strength (k,)): vertices that shall move alike; adds strength |u_one - u_other|^2
    """

    def __init__(self, V, F, free, reach_mm=5.0, ties=None):
        self._free, self._n = np.flatnonzero(free), len(V)
        self._place = np.full(self._n, -1)  # of a vertex among those that are free
        self._place[self._free] = np.arange(len(self._free))
        energy = _bending(V, F, reach_mm)
        if ties is not None:
            energy = energy + _tied(*ties, self._n)
        energy = energy[self._free][:, self._free]
        self._factor = Factorization(energy)
        self._row, self._responses = np.full(self._n, -1), np.zeros((0, len(self._free)))

    def __call__(self, wishes, weights, smooth_mm=1.0):
        """(n, 3) field for wishes (n, 3) with weights (n,); a vertex of weight 0 wishes for nothing.

        smooth_mm  width over which one vertex with w = 1 mm^2 is felt
        """
        field = np.zeros((self._n, 3))
        who = np.flatnonzero((weights > 0) & (self._place >= 0))
        if not len(who):
            return field
        response = self._response(who)
        system = response[:, self._place[who]]
        system[np.diag_indices(len(who))] += smooth_mm**4 / weights[who]
        factor = cho_factor(system, check_finite=False)
        field[self._free] = response.T @ cho_solve(factor, wishes[who], check_finite=False)
        return field

    def _response(self, who):
        """(k, f) what pushes at vertices who (k,) do to all that are free."""
        new = who[self._row[who] < 0]
        if len(new):
            pushes = np.zeros((len(self._free), len(new)))
            pushes[self._place[new], np.arange(len(new))] = 1.0
            self._row[new] = len(self._responses) + np.arange(len(new))
            self._responses = np.concatenate([self._responses, self._factor.solve(pushes).T])
        return self._responses[self._row[who]]


def _bending(V, F, reach_mm):
    """(n, n) csr L M^-1 L + M / reach^4."""
    C = cotangent_laplacian(V, F).tocoo()
    off = C.row != C.col
    weights = np.maximum(-C.data[off], _LEAST_COTANGENT)
    W = sp.coo_matrix((weights, (C.row[off], C.col[off])), shape=C.shape).tocsr()
    L = sp.diags(np.asarray(W.sum(axis=1)).ravel()) - W
    mass = np.maximum(lumped_mass(V, F), 1e-3)
    return (L @ sp.diags(1.0 / mass) @ L + sp.diags(mass / reach_mm**4)).tocsr()


def _tied(one, other, strength, n):
    """(n, n) csr of the energy of ties."""
    k = np.arange(len(one))
    apart = sp.coo_matrix((np.ones(len(one)), (k, one)), shape=(len(one), n)).tocsr()
    apart = apart - sp.coo_matrix((np.ones(len(one)), (k, other)), shape=(len(one), n)).tocsr()
    return (apart.T @ sp.diags(strength) @ apart).tocsr()
