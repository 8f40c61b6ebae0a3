import numpy as np

from facewright.bake.texels import at_corners, at_points, build_texels, gather_at_vertices, in_chunks, texel_densities

UV = np.array([[0, 0], [0.5, 0], [0.5, 1.0], [0, 1.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
POINTS = np.column_stack([UV * [40, 20], np.zeros(4)])  # 20 x 20 mm


def test_texels_cover_the_chart_and_know_where_they_are():
    texels = build_texels(UV, FACES, 64)
    assert len(texels) == 32 * 64
    row, column = np.divmod(texels.index, 64)
    centers = np.stack([(column + 0.5) / 64, 1 - (row + 0.5) / 64], axis=1)
    np.testing.assert_allclose(at_points(UV, FACES, texels.face, texels.barycentric), centers, atol=1e-5)
    np.testing.assert_allclose(at_corners(UV[FACES], texels.face, texels.barycentric), centers, atol=1e-5)
    assert (np.diff(texels.index) > 0).all()


def test_threads_change_nothing():
    one, two = build_texels(UV, FACES, 600, jobs=1), build_texels(UV, FACES, 600, jobs=2)
    np.testing.assert_array_equal(one.index, two.index)
    np.testing.assert_array_equal(one.barycentric, two.barycentric)
    assert in_chunks(lambda piece: piece.start, 10, jobs=2, chunk=4) == [0, 4, 8]


def test_gathering_reproduces_a_constant_and_counts_what_was_seen():
    texels = build_texels(UV, FACES, 64)
    values = np.full((len(texels), 2), (3.0, 7.0))
    upper = at_points(UV, FACES, texels.face, texels.barycentric)[:, 1] > 0.5
    everything = np.ones(len(texels), bool)
    means, share = gather_at_vertices(values, upper, everything, texels, FACES, 5)
    np.testing.assert_allclose(means[:4], np.tile([3.0, 7.0], (4, 1)), rtol=1e-6)
    assert share[2] > 0.6 > 0.4 > share[0]
    np.testing.assert_allclose(share[:4].mean(), 0.5, atol=0.02)
    assert np.isnan(share[4]), "a vertex without texels"


def test_density():
    np.testing.assert_allclose(texel_densities(POINTS, FACES, UV, FACES, 200), np.sqrt(100 * 200 / (20 * 20)))
