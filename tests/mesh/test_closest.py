import numpy as np

from facewright.mesh.closest import Surface, barycentric_coordinates, interpolate


def random_triangles(k, rng):
    return rng.normal(size=(k, 3, 3))


def test_barycentric_coordinates_give_the_point_back():
    rng = np.random.default_rng(0)
    triangles = random_triangles(200, rng)
    weights = rng.dirichlet([1, 1, 1], 200)
    points = np.einsum("kc,kcd->kd", weights, triangles)
    assert np.allclose(barycentric_coordinates(points, triangles), weights, atol=1e-9)


def test_a_degenerate_triangle_gives_its_first_corner():
    triangle = np.zeros((1, 3, 3))
    assert np.array_equal(barycentric_coordinates(np.zeros((1, 3)), triangle), [[1.0, 0.0, 0.0]])


def test_the_nearest_point_is_no_farther_than_a_dense_search():
    rng = np.random.default_rng(1)
    V = rng.normal(size=(30, 3))
    F = rng.integers(0, 30, size=(40, 3))
    F = F[(F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 0] != F[:, 2])]
    queries = rng.normal(size=(25, 3)) * 2
    found = Surface(V, F).closest(queries)
    assert np.allclose(np.linalg.norm(found.points - queries, axis=1), found.distance)
    assert np.allclose(interpolate(V, F, found.faces, found.barycentric), found.points, atol=1e-9)
    samples = rng.dirichlet([1, 1, 1], 400)
    for query, distance in zip(queries, found.distance):
        points = np.einsum("sc,fcd->fsd", samples, V[F]).reshape(-1, 3)
        assert distance <= np.linalg.norm(points - query, axis=1).min() + 1e-9
