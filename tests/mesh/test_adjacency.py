import numpy as np

from facewright.mesh.adjacency import border_edges, border_loops, border_vertices, dilate, unique_edges
from facewright.mesh.laplacian import cotangent_laplacian, lumped_mass, uniform_laplacian
from facewright.mesh.normals import face_areas, vertex_normals


def grid(k=6):
    x, y = np.meshgrid(np.arange(k), np.arange(k))
    V = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1).astype(float)
    i = np.arange(k * k).reshape(k, k)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    return V, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_the_border_of_a_sheet_is_one_loop():
    V, F = grid(6)
    loops = border_loops(F)
    assert len(loops) == 1 and len(loops[0]) == 20
    assert border_vertices(F, len(V)).sum() == 20
    assert len(border_edges(F)) == 20


def test_euler_characteristic_of_a_disk():
    V, F = grid(6)
    assert len(V) - len(unique_edges(F)) + len(F) == 1


def test_dilating_one_vertex_gives_its_ring():
    V, F = grid(5)
    mask = np.zeros(len(V), bool)
    mask[12] = True
    assert dilate(mask, F).sum() == 7


def test_laplacians_know_constants_and_mass_is_area():
    V, F = grid(5)
    for L in (uniform_laplacian(F, len(V)), cotangent_laplacian(V, F)):
        assert abs(L @ np.ones(len(V))).max() < 1e-12
        assert np.linalg.eigvalsh(L.toarray()).min() > -1e-9
    assert np.isclose(lumped_mass(V, F).sum(), 16.0)
    assert np.isclose(face_areas(V, F).sum(), 16.0)
    assert np.allclose(vertex_normals(V, F), [0, 0, 1])
