import numpy as np

from facewright.mesh.normals import normalized, vertex_normals
from facewright.mesh.tangents import corner_tangents, from_tangent_space, to_tangent_space

SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UP = np.tile([0.0, 0.0, 1.0], (4, 1))


def test_a_plain_square_points_along_u():
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    tangents, sign = corner_tangents(SQUARE, FACES, UP, uv, FACES)
    np.testing.assert_allclose(tangents, np.broadcast_to([1.0, 0, 0], tangents.shape), atol=1e-12)
    assert (sign == 1).all()


def test_turned_uvs_turn_the_tangent():
    uv = np.array([[0, 0], [0, 1], [-1, 1], [-1, 0]], float)  # u runs down, v to the right
    tangents, sign = corner_tangents(SQUARE, FACES, UP, uv, FACES)
    np.testing.assert_allclose(tangents, np.broadcast_to([0, -1.0, 0], tangents.shape), atol=1e-12)
    assert (sign == 1).all()


def test_mirrored_uvs_have_the_other_sign_and_do_not_mix_with_their_neighbours():
    uv = np.array([[0, 0], [-1, 0], [-1, 1], [0, 1]], float)
    tangents, sign = corner_tangents(SQUARE, FACES, UP, uv, FACES)
    np.testing.assert_allclose(tangents, np.broadcast_to([-1.0, 0, 0], tangents.shape), atol=1e-12)
    assert (sign == -1).all()
    bitangent = np.cross(UP[0], tangents[0, 0]) * sign[0]
    np.testing.assert_allclose(bitangent, [0, 1, 0], atol=1e-12)  # towards growing v all the same


def test_corners_are_weighted_by_their_angle():
    # Two faces that share vertex 0 with angles of 90 and 45 degrees and dP/du along x and along y.
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uv = np.array([[0, 0], [1, 0], [0, 1], [1, 0], [1, 1]], float)
    uv_faces = np.array([[0, 1, 2], [0, 3, 4]])  # in the second face u grows along (0, 1, 0)
    tangents, _ = corner_tangents(points, faces, UP, uv, uv_faces)
    expected = normalized(np.array([np.pi / 2, np.pi / 4, 0.0]))
    np.testing.assert_allclose(tangents[0, 0], expected, atol=1e-12)
    np.testing.assert_allclose(tangents[1, 0], expected, atol=1e-12)
    np.testing.assert_allclose(tangents[0, 1], [1, 0, 0], atol=1e-12)


def test_tangents_are_unit_perpendicular_and_finite_even_without_uv_area(ball_face):
    template = ball_face.template
    normals = vertex_normals(template.vertices, template.faces)
    uv = template.uv.copy()
    uv[template.uv_faces[:50]] = 0.25
    tangents, _ = corner_tangents(template.vertices, template.faces, normals, uv, template.uv_faces)
    np.testing.assert_allclose(np.linalg.norm(tangents, axis=-1), 1.0, atol=1e-9)
    assert np.abs((tangents * normals[template.faces]).sum(-1)).max() < 1e-9


def test_tangent_space_and_back():
    rng = np.random.default_rng(0)
    normals, directions = normalized(rng.normal(size=(2, 50, 3)))
    tangents = normalized(np.cross(normals, rng.normal(size=(50, 3))) + 0.2 * normals)  # as interpolation bends them
    sign = np.where(rng.random(50) < 0.5, -1.0, 1.0)
    coefficients = to_tangent_space(directions, normals, tangents, sign)
    np.testing.assert_allclose(from_tangent_space(coefficients, normals, tangents, sign), directions, atol=1e-9)
    np.testing.assert_allclose(to_tangent_space(normals, normals, tangents, sign)[:, :2], 0, atol=1e-12)
