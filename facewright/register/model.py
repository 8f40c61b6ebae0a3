"""Similarity, identity and a little expression of a template fitted to a scan by Gauss-Newton with priors.

Minimises   1/sigma^2 sum_i a_i rho(n_i . (x_i - p_i))  +  sum_l w_l |x_l - q_l|^2  +  |alpha|^2 + |eps/sigma_e|^2
over x = s R (mean + B alpha + E eps) + t, with a_i vertex areas (summing to n_effective), p_i nearest scan points and
q_l landmarks. The landmarks lead at first and fade: their bias (1 to 3 mm) must not bend the shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.spatial.transform import Rotation

from facewright.mesh.laplacian import lumped_mass
from facewright.mesh.normals import vertex_normals

SAMPLES = 3000


@dataclass(frozen=True)
class ModelOptions:
    """sigma_mm: what the identity modes cannot explain; n_effective: independent observations that the scan counts as.

    iterations of the surface stage, the first with coarse_modes, the last fine_iterations with all modes, fine_sigma_mm
    and fine_n_effective; landmark_sigma_mm: how well a landmark is placed; landmark_floor: the share
    of their pull that landmarks keep to the end (0.05, 0.3 and 1 tried: lips of ICT heads 2.1, 1.6, 1.1 mm, but the
    face of hm08 heads 0.85, 0.90, 0.99)
    """

    sigma_mm: float = 0.7
    n_effective: float = 100.0
    fine_sigma_mm: float = 0.5
    fine_n_effective: float = 300.0
    iterations: int = 20
    fine_iterations: int = 6
    coarse_modes: int = 150
    landmark_sigma_mm: float = 2.0
    landmark_floor: float = 0.2


@dataclass(frozen=True)
class ModelFit:
    """vertices (n, 3) and the same at rest (n, 3); alpha (i,) identity in standard deviations; expression (e,).

    T (4, 4) similarity, rms mm. A refined fit (refine.py) has new vertices and rest; alpha, T and rms are the model's.
    """

    vertices: np.ndarray
    rest: np.ndarray
    alpha: np.ndarray
    expression: np.ndarray
    T: np.ndarray
    rms: float


@dataclass(frozen=True)
class Expressions:
    """What the face may wear: deltas (e, n, 3) at weight 1, expected (e,) weights and how far they may stray (e,)."""

    deltas: np.ndarray
    expected: np.ndarray
    std: np.ndarray


def fit_model(mean, basis, expressions, faces, weights, rules, target, landmarks, options, doubt):
    """Fit the model to a scan.

    mean (n, 3), basis localize.LocalizedBasis, expressions Expressions, faces (m, 3)
    weights (n,) trust in each vertex, 0 leaves it out; rules: skin.SkinRules; target: correspond.Target
    landmarks: points (l, 3) on the scan, scipy sparse (l, n) that takes template vertices to them, weights (l,)
    doubt: function of the vertices (n, 3) that the coarse modes found -> (n,) bool: left out by the fine ones
    returns ModelFit
    """
    landmark_points, landmark_rows, landmark_weights = landmarks
    coarse = basis.first(options.coarse_modes)
    state = _State(mean, coarse, expressions)
    deltas = expressions.deltas
    sampled = sample_rows(weights, SAMPLES)
    areas = lumped_mass(mean, faces)[sampled] * weights[sampled]
    areas /= areas.sum()
    skin = slice(0, faces.max() + 1)  # what else the head has is asked for at the end
    information = options.n_effective / options.sigma_mm**2
    landmark_model = _project(landmark_rows, mean, coarse, deltas)
    modes = basis.at(sampled)  # of which the coarse ones are the first
    linear = _by_axis(modes[: len(coarse)], deltas[:, sampled])
    _follow(state, landmark_model, landmark_points, landmark_weights, options)
    for iteration in range(options.iterations):
        if iteration == options.iterations - options.fine_iterations:
            areas *= ~doubt(state.vertices())[sampled]
            state.refine(basis)
            information = options.fine_n_effective / options.fine_sigma_mm**2
            landmark_model = _project(landmark_rows, mean, basis, deltas)
            linear = _by_axis(modes, deltas[:, sampled])
        progress = iteration / max(1, options.iterations - 1)
        vertices = state.vertices(skin)
        normals = vertex_normals(vertices, faces)
        reach = 25.0 * (1 - progress) + 6.0
        matches = target.match(vertices[sampled], normals[sampled], max_distance=reach, tau=max(2.0, reach / 3))
        rows = state.normal_rows(vertices[sampled], matches.normals, linear)
        residuals = np.einsum("kc,kc->k", matches.normals, vertices[sampled] - matches.points)
        height = np.einsum("kc,kc->k", normals[sampled], matches.points - vertices[sampled])
        # Heights mean little while the model is still far off.
        height = height if progress > 0.5 else np.zeros_like(height)
        belief = matches.weights * rules.believe(sampled[:, None], height, matches)
        surface = (rows, residuals, information * areas * belief)
        rows, residuals, row_weights = _landmark_rows(state, landmark_model, landmark_points, landmark_weights)
        fading = (1 - progress) ** 2 + options.landmark_floor
        landmarks = (rows, residuals, fading * row_weights / options.landmark_sigma_mm**2)
        state.step([surface, landmarks])
    vertices = state.vertices()
    matches = target.match(vertices[sampled], vertex_normals(vertices, faces)[sampled], max_distance=6.0)
    rms = float(np.sqrt(np.average(matches.distance**2, weights=areas * matches.weights + 1e-12)))
    return ModelFit(vertices, state.rest(vertices), state.alpha, state.expression, state.T(), rms)


def fit_landmarks(mean, basis, expressions, landmarks, options):
    """As fit_model, but by the landmarks alone, which takes a tenth of a second; rms is theirs."""
    points, matrix, weights = landmarks
    state = _State(mean, basis, expressions)
    _follow(state, _project(matrix, mean, basis, expressions.deltas), points, weights, options)
    vertices = state.vertices()
    rms = float(np.sqrt(np.mean(np.sum((matrix @ vertices - points) ** 2, axis=1))))
    return ModelFit(vertices, state.rest(vertices), state.alpha, state.expression, state.T(), rms)


def _follow(state, landmark_model, points, weights, options):
    """Let the landmarks lead the state to where they find it."""
    for _ in range(8):
        rows, residuals, row_weights = _landmark_rows(state, landmark_model, points, weights)
        state.step([(rows, residuals, row_weights / options.landmark_sigma_mm**2)])


def sample_rows(weights, count):
    """Indices of trusted vertices (weights (n,) above 0), thinned evenly to about count."""
    rows = np.flatnonzero(weights > 0)
    return rows[:: max(1, len(rows) // count)]


def _by_axis(modes, deltas):
    """(3, k, i + e) of modes (i, k, 3) and the deltas (e, k, 3) of expressions."""
    return np.concatenate([modes, deltas]).transpose(2, 1, 0).copy()


def _project(matrix, mean, basis, expressions):
    """Mean (l, 3), basis (i, l, 3) and expressions (e, l, 3) at points that a matrix (l, n) takes from the vertices."""
    rows = np.unique(matrix.indices)
    matrix = matrix[:, rows]
    modes, shapes = basis.at(rows), expressions[:, rows]
    return (
        matrix @ mean[rows],
        np.stack([matrix @ mode for mode in modes]) if len(modes) else np.zeros((0, matrix.shape[0], 3)),
        np.stack([matrix @ shape for shape in shapes]) if len(shapes) else np.zeros((0, matrix.shape[0], 3)),
    )


def _landmark_rows(state, landmark_model, points, weights):
    mean, basis, expressions = landmark_model
    positions = state.placed(mean + np.tensordot(state.alpha, basis, 1), expressions)
    jacobian = state.jacobian(mean, basis, expressions)
    rows = jacobian.reshape(-1, jacobian.shape[2])  # (3l, p)
    distance = np.linalg.norm(positions - points, axis=1)
    robust = (25.0 / (25.0 + distance**2)) ** 2 * weights
    return rows, (positions - points).ravel(), np.repeat(robust, 3)


class _State:
    """The parameters, and the geometry and its derivative for any rows of the model."""

    def __init__(self, mean, basis, expressions):
        self.mean, self.basis, self.expressions = mean, basis, expressions.deltas
        self.expected, self.std = expressions.expected, expressions.std
        self.alpha = np.zeros(len(basis))
        self.expression = expressions.expected.astype(float).copy()
        self.R, self.s, self.t = np.eye(3), 1.0, np.zeros(3)

    def refine(self, basis):
        """Go on with more modes, of which the present ones are the first."""
        self.alpha = np.concatenate([self.alpha, np.zeros(len(basis) - len(self.alpha))])
        self.basis = basis

    def T(self):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.s * self.R, self.t
        return T

    def placed(self, shape, expressions):
        """Points (k, 3) of the person at rest with the expressions (e, k, 3) put on, where the scan has them."""
        return self.s * (shape + np.tensordot(self.expression, expressions, 1)) @ self.R.T + self.t

    def vertices(self, rows=slice(None)):
        return self.placed(self.mean[rows] + self.basis.along(self.alpha, rows), self.expressions[:, rows])

    def rest(self, vertices):
        """The person's vertices (n, 3) with the expressions taken off."""
        return vertices - np.tensordot(self.expression, self.expressions, 1) @ (self.s * self.R.T)

    def jacobian(self, mean, basis, expressions):
        """(k, 3, p): columns are identity, expression, rotation (3), log scale, translation (3)."""
        positions = self.placed(mean + np.tensordot(self.alpha, basis, 1), expressions)
        linear = np.concatenate([basis, expressions]) @ (self.s * self.R.T)  # (i + e, k, 3)
        arm = positions - self.t
        k = len(mean)
        cross = np.zeros((k, 3, 3))  # d(w x arm)/dw = -[arm]_x
        cross[:, 0, 1], cross[:, 0, 2] = arm[:, 2], -arm[:, 1]
        cross[:, 1, 0], cross[:, 1, 2] = -arm[:, 2], arm[:, 0]
        cross[:, 2, 0], cross[:, 2, 1] = arm[:, 1], -arm[:, 0]
        eye = np.broadcast_to(np.eye(3), (k, 3, 3))
        return np.concatenate([linear.transpose(1, 2, 0), cross, arm[:, :, None], eye], axis=2)

    def normal_rows(self, positions, normals, linear):
        """(k, p) the jacobian of positions (k, 3) along normals (k, 3); linear (3, k, i + e) basis and expressions.

        The same as the jacobian's product with the normals, without its (k, 3, p) array.
        """
        turned = normals @ (self.s * self.R)
        shape = sum(turned[:, axis, None] * linear[axis] for axis in range(3))
        arm = positions - self.t
        size = np.einsum("kc,kc->k", arm, normals)[:, None]
        return np.concatenate([shape, np.cross(arm, normals), size, normals], axis=1)

    def step(self, terms):
        """One Gauss-Newton step on weighted rows, with the priors."""
        n_identity, n_expression = len(self.alpha), len(self.expression)
        p = n_identity + n_expression + 7
        A, b = np.zeros((p, p)), np.zeros(p)
        for rows, residuals, weights in terms:
            root = np.sqrt(weights)
            weighted = rows * root[:, None]
            A += weighted.T @ weighted  # of a matrix with itself: half of the work
            b -= weighted.T @ (root * residuals)
        prior = np.concatenate([np.ones(n_identity), self.std**-2, np.full(7, 1e-6)])
        value = np.concatenate([self.alpha, self.expression - self.expected, np.zeros(7)])
        A[np.diag_indices(p)] += prior
        b -= prior * value
        step = scipy.linalg.solve(A, b, assume_a="pos", overwrite_a=True, check_finite=False)
        self.alpha = np.clip(self.alpha + step[:n_identity], -4, 4)
        self.expression = np.clip(self.expression + step[n_identity : n_identity + n_expression], -0.3, 1.1)
        turn = Rotation.from_rotvec(step[-7:-4]).as_matrix()
        self.R = turn @ self.R
        self.s *= float(np.exp(step[-4]))
        self.t = self.t + step[-3:]
