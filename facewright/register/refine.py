"""The model's fit made finer by a Gaussian process: what the identity modes cannot say, told from what they can.

The displacement of the template in its own frame is a Gaussian process with the covariance

    K(x, y) = (1 - share) C(x, y) + share C(x, y) k(x, y) + fine^2 k(x, y) I + similarity

with C = sum_i b_i(x) b_i(y)' of the identity modes and k(x, y) = exp(-|x - y|^2 / (2 length^2)): the same variation,
allowed to differ from place to place, and a little that is like no mode (Luethi, Gerig, Jud and Vetter, Gaussian
process morphable models, 2018, sections 3.2 and 3.4). A surface is only seen along its normal: how far a vertex slid
along it the prior decides. It is not cut to some modes: for a thousand points of the surface the exact posterior is a
system of a thousand equations.

Share and lengths were first chosen on training data alone, true normals given. hm08, the prior built without one group
of its training modifiers, 16 persons made of that group: sliding in the face 0.64 mm with fine = 0, 0.59 with 1.0, 0.58
with 1.5. ICT, the prior built from half of its 20 modes, 8 persons made of all: 0.70 with fine = 0, 0.56 with 1.0.

The result lies between the process and the localised modes that it starts from (localize.py), for neither is known to
be the true prior. Sliding of the model on six heads a template with known truth, modes, process, 0.7 of the way: hm08
0.98, 0.81, 0.82; ICT 0.83, 0.87, 0.81 mm. Landmarks are left to the modes: as observations of the process they made it
worse (hm08 0.86, 0.83 without). A share of 0 is worse (1.01), one of 0.4 no better; 100 observations instead of 300
worse (0.95); more rounds, more samples, the scalp of a bald head as data: no gain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from facewright.mesh.laplacian import lumped_mass
from facewright.mesh.normals import vertex_normals
from facewright.register.model import sample_rows

SHARE, FINE_MM, LENGTH_MM = 0.2, 1.5, 25.0
SIMILARITY_MM = 30.0
SAMPLES, ROUNDS = 900, 5
_PIECE = 256  # rows of a kernel at a time
REACH_MM, TAU_MM = 6.0, 2.0
SIGMA_MM, N_EFFECTIVE, N_FACETS = 0.5, 600.0, 200.0
"""What the process cannot explain, and how many independent observations a scan counts as, and one of facets."""
BELIEF = 0.6
"""Of the two priors, the process and the localised modes before it, neither is known to be the true one."""


@dataclass(frozen=True)
class _Sites:
    """Places where the process is asked: points (k, 3) mm, modes (i, k, 3)."""

    points: np.ndarray
    modes: np.ndarray


def refine_model(model, mean, basis, faces, weights, rules, target, finely=True):
    """The ModelFit with vertices and rest told anew, see above; all else is kept as it was found.

    model ModelFit; the rest as for fit_model, with basis (i, n, 3) the template's own; finely: the scan has no facets
    """
    frame = _Frame(model.T)
    sampled = sample_rows(weights, SAMPLES)
    areas = lumped_mass(mean, faces)[sampled] * weights[sampled]
    areas *= (N_EFFECTIVE if finely else N_FACETS) / SIGMA_MM**2 / areas.sum()
    normals = vertex_normals(model.vertices, faces)[sampled]
    sites = _Sites(mean[sampled], basis[:, sampled])
    covariance = _covariance(sites)
    there = frame.inward(model.vertices[sampled])
    rest = sites.points + there - frame.inward(model.rest[sampled])
    for _ in range(ROUNDS):
        found = target.match(frame.outward(there), normals, max_distance=REACH_MM, tau=TAU_MM)
        height = np.einsum("kc,kc->k", normals, found.points - frame.outward(there))
        belief = areas * found.weights * rules.believe(sampled[:, None], height, found)
        seen = np.flatnonzero(belief > 1e-3 * areas)
        directions = frame.turned_inward(found.normals[seen])
        heights = np.einsum("kc,kc->k", directions, frame.inward(found.points[seen]) - rest[seen])
        along = _along(covariance, seen, directions)
        system = sum(along[:, 3 * seen + axis] * directions[:, axis] for axis in range(3))
        system[np.diag_indices(len(system))] += 1.0 / belief[seen]
        solution = scipy.linalg.solve(system, heights, assume_a="pos", overwrite_a=True, check_finite=False)
        there = rest + (along.T @ solution).reshape(-1, 3)
    forces = np.zeros((len(there), 3))
    forces[seen] = solution[:, None] * directions
    displacement = _displacement(mean, basis, sites, forces)
    gained = BELIEF * (frame.outward(mean + displacement) - model.rest)
    return replace(model, rest=model.rest + gained, vertices=model.vertices + gained)


class _Frame:
    """The similarity between the template's frame and the scan's."""

    def __init__(self, T):
        self.scale = np.cbrt(np.linalg.det(T[:3, :3]))
        self.R, self.t = T[:3, :3] / self.scale, T[:3, 3]

    def inward(self, points):
        return (points - self.t) @ self.R / self.scale

    def outward(self, points):
        return self.scale * points @ self.R.T + self.t

    def turned_inward(self, directions):
        return directions @ self.R


def _kernel(a, b):
    """(j, k) of points a (j, 3) and b (k, 3), in single precision: the exponentials take the time."""
    a, b = (points.astype(np.float32) / np.float32(LENGTH_MM) for points in (a, b))
    # -|a - b|^2 / 2 as one product; by pieces that the processor's cache holds, which takes half the time.
    one_a, one_b = (np.ones((len(points), 1), np.float32) for points in (a, b))
    squares_a, squares_b = (-0.5 * (points**2).sum(axis=1, keepdims=True) for points in (a, b))
    left, right = np.hstack([a, squares_a, one_a]), np.hstack([b, one_b, squares_b]).T
    result = np.empty((len(a), len(b)), np.float32)
    for start in range(0, len(a), _PIECE):
        piece = result[start : start + _PIECE]
        np.matmul(left[start : start + _PIECE], right, out=piece)
        np.exp(np.minimum(piece, 0.0, out=piece), out=piece)
    return result


def _similarity(points):
    """(7, k, 3) the small similarities, SIMILARITY_MM for a point a head's radius away."""
    axes = np.eye(3)
    moves = [np.broadcast_to(axis, points.shape) for axis in axes]
    turns = [np.cross(axis, points) / 100.0 for axis in axes]
    return SIMILARITY_MM * np.stack([*moves, *turns, points / 100.0])


def _covariance(sites):
    """(3k, 3k) of the displacements at k sites."""
    k = len(sites.points)
    flat = sites.modes.reshape(len(sites.modes), -1)
    near = _kernel(sites.points, sites.points)
    K = (flat.T @ flat).reshape(k, 3, k, 3)
    K *= (1.0 - SHARE + SHARE * near)[:, None, :, None]
    for axis in range(3):
        K[:, axis, :, axis] += FINE_MM**2 * near
    similar = _similarity(sites.points).reshape(7, -1)
    K = K.reshape(3 * k, 3 * k)
    K += similar.T @ similar
    return K


def _along(K, sites, directions):
    """(s, c) rows of K (3k, c) at sites (s,), summed along their directions (s, 3)."""
    return sum(directions[:, axis, None] * K[3 * sites + axis] for axis in range(3))


def _displacement(points, basis, sites, forces):
    """(n, 3) the posterior at points (n, 3) with modes (i, n, 3), by what forces (k, 3) the sites were moved."""
    shares = np.einsum("ikc,kc->ik", sites.modes, forces)  # (i, k)
    near = _kernel(points, sites.points)
    local = SHARE * (near @ shares.T.astype(np.float32)) + (1.0 - SHARE) * shares.sum(axis=1)  # (n, i)
    result = np.einsum("ni,inc->nc", local, basis, optimize=True)
    result += near @ (FINE_MM**2 * forces).astype(np.float32)
    similar = np.einsum("gkc,kc->g", _similarity(sites.points), forces)
    return result + np.tensordot(similar, _similarity(points), 1)
