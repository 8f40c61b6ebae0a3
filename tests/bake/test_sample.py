import numpy as np

from facewright.bake.sample import ScanLooks, sample_pixels
from facewright.bake.texels import build_texels
from facewright.data import Scan
from facewright.mesh.render import sample_texture

POINTS = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
SQUARE_UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


def spots(k, seed=0):
    """k random hits on the two faces."""
    rng = np.random.default_rng(seed)
    barycentric = rng.dirichlet([1, 1, 1], k).astype(np.float32)
    return rng.integers(0, 2, k).astype(np.int32), barycentric


def test_bilinear_agrees_with_the_renderer():
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    uv = rng.uniform(0.05, 0.95, (200, 2))
    np.testing.assert_allclose(sample_pixels(image, uv * [30, 20]), sample_texture(image, uv), atol=1e-3)


def test_texture_vertex_colour_and_clay():
    image = np.zeros((16, 16, 3), np.uint8)
    image[:8] = 200  # the upper half
    face, barycentric = spots(300)
    height = (barycentric[..., None] * POINTS[FACES[face]]).sum(axis=1)[:, 1]
    looks = ScanLooks(Scan(POINTS, FACES, SQUARE_UV, FACES, (image,)))
    colors, seen = looks.colors(face, barycentric, np.full(300, 0.6, np.float32))
    assert seen.all() and (colors[height > 6] == 200).all() and (colors[height < 4] == 0).all()

    by_height = ScanLooks(Scan(POINTS, FACES, colors=np.repeat(POINTS[:, 1:2] / 10, 3, axis=1)))
    colors, seen = by_height.colors(face, barycentric, np.ones(300, np.float32))
    np.testing.assert_allclose(colors, np.repeat(height[:, None] * 25.5, 3, axis=1), atol=1e-3)
    clay = ScanLooks(Scan(POINTS, FACES))
    assert not clay.has_color and not clay.colors(face, barycentric, np.ones(300))[1].any()


def test_each_face_has_its_own_texture_or_none():
    red, blue = np.full((4, 4, 3), (255, 0, 0), np.uint8), np.full((8, 8, 3), (0, 0, 255), np.uint8)
    face, barycentric = spots(100)
    looks = ScanLooks(Scan(POINTS, FACES, SQUARE_UV, FACES, (red, blue), np.array([1, 0])))
    colors, seen = looks.colors(face, barycentric, np.ones(100, np.float32))
    assert seen.all() and (colors[face == 0] == (0, 0, 255)).all() and (colors[face == 1] == (255, 0, 0)).all()
    looks = ScanLooks(Scan(POINTS, FACES, SQUARE_UV, FACES, (red,), np.array([-1, 0])))
    np.testing.assert_array_equal(looks.colors(face, barycentric, np.ones(100))[1], face == 1)


def test_a_fine_texture_is_averaged():
    checks = (np.indices((256, 256)).sum(axis=0) % 2 * 254).astype(np.uint8)
    looks = ScanLooks(Scan(POINTS, FACES, SQUARE_UV, FACES, (np.repeat(checks[..., None], 3, axis=2),)))
    face, barycentric = spots(100)
    colors, _ = looks.colors(face, barycentric, np.full(100, 10 / 32, np.float32))
    np.testing.assert_allclose(colors, 127, atol=1)


def test_nothing_bleeds_in_across_a_seam():
    # Two charts on a magenta ground, at places that split texels.
    image = np.full((64, 64, 3), (255, 0, 255), np.uint8)
    uv = np.array([[0.1, 0.1], [0.45, 0.1], [0.45, 0.9], [0.55, 0.13], [0.87, 0.92], [0.55, 0.92]])
    uv_faces = np.array([[0, 1, 2], [3, 4, 5]])
    image.reshape(-1, 3)[build_texels(uv, uv_faces, 64).index] = (0, 128, 0)
    face, barycentric = spots(4000)
    spacing = np.full(4000, 0.4, np.float32)
    looks = ScanLooks(Scan(POINTS, FACES, uv, uv_faces, (image,)))
    assert (looks.colors(face, barycentric, spacing)[0][:, 0] < 1).mean() > 0.99, "all but the sharp tips"
    looks.seam_corners = np.zeros_like(looks.seams)
    assert (looks.colors(face, barycentric, spacing)[0][:, 0] < 1).mean() < 0.97


def test_repeated_uvs_make_no_seams():
    uv, uv_faces = SQUARE_UV[FACES].reshape(-1, 2), np.arange(6).reshape(2, 3)
    image = np.zeros((4, 4, 3), np.uint8)
    looks = ScanLooks(Scan(POINTS, FACES, uv, uv_faces, (image,)))
    np.testing.assert_array_equal(looks.seams, [[True, True, False], [False, True, True]])


def test_normals_of_the_mesh_and_of_its_map():
    face, barycentric = spots(50)
    spacing = np.ones(50, np.float32)
    looks = ScanLooks(Scan(POINTS, FACES))
    np.testing.assert_allclose(looks.normals(face, barycentric, spacing), np.tile([0, 0, 1.0], (50, 1)), atol=1e-6)
    tilted = np.full((4, 4, 3), (128, 218, 218), np.uint8)
    mapped = ScanLooks(Scan(POINTS, FACES, SQUARE_UV, FACES, normal_map=tilted))
    expected = np.array([0, 0.5**0.5, 0.5**0.5])
    np.testing.assert_allclose(mapped.normals(face, barycentric, spacing), np.tile(expected, (50, 1)), atol=0.01)
