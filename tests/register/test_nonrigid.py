import numpy as np
import pytest
import scipy.sparse as sp

from facewright.mesh.laplacian import clamped_laplacian
from facewright.register.nonrigid import ElasticSkin, Rows


@pytest.fixture(scope="module")
def sheet():
    k = 24
    x, y = np.meshgrid(np.linspace(-30, 30, k), np.linspace(-30, 30, k))
    V = np.stack([x.ravel(), y.ravel(), 4 * np.sin(x.ravel() / 15)], axis=1)
    i = np.arange(k * k).reshape(k, k)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    return V, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def dense_solution(skin, rows, w_bend, w_stretch, w_hold):
    n = len(skin.vertices)
    shared = (w_bend * skin.bending + w_stretch * skin.stretching + w_hold * sp.diags(skin.mass)).toarray()
    A, b = np.kron(shared, np.eye(3)), np.zeros(3 * n)
    for term in rows:
        residual = term.targets - term.matrix @ skin.vertices
        for r in range(term.matrix.shape[0]):
            m = term.matrix[r].toarray()[0]
            directions = np.eye(3) if term.normals is None else term.normals[r : r + 1]
            for normal in directions:
                row = np.kron(m, normal)
                A += term.weights[r] * np.outer(row, row)
                b += term.weights[r] * row * (normal @ residual[r])
    return np.linalg.solve(A, b).reshape(n, 3)


def test_agrees_with_a_dense_solve(sheet):
    V, F = sheet
    skin = ElasticSkin(V, F)
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    picks = rng.choice(len(V), 40, replace=False)
    matrix = sp.csr_matrix((np.ones(40), (np.arange(40), picks)), shape=(40, len(V)))
    plane = Rows(matrix, V[picks] + rng.normal(size=(40, 3)), rng.random(40), normals)
    point = Rows(matrix[:5], V[picks[:5]] + 1.0, np.full(5, 2.0))
    got = skin.solve((plane, point), 1.0, 0.2, 1e-3, tolerance=1e-9, max_iterations=500)
    assert np.allclose(got, dense_solution(skin, (plane, point), 1.0, 0.2, 1e-3), atol=1e-5)


def test_a_translation_costs_nothing(sheet):
    V, F = sheet
    skin = ElasticSkin(V, F)
    target = V + [1.0, -2.0, 3.0]
    rows = (Rows(sp.identity(len(V), format="csr"), target, np.ones(len(V))),)
    assert np.allclose(skin.solve(rows, 10.0, 1.0, 0.0, tolerance=1e-10), [1.0, -2.0, 3.0], atol=1e-6)


def test_the_laplacian_knows_constants_and_stays_positive(sheet):
    L = clamped_laplacian(*sheet)
    assert abs(L @ np.ones(L.shape[0])).max() < 1e-9
    assert np.linalg.eigvalsh(L.toarray()).min() > -1e-9
