import numpy as np

from facewright.bake.mirror import mirrored_corner_uv
from facewright.bake.texels import at_corners, build_texels

# Two quads left and right of x = 0 and a triangle that has no twin.
POINTS = np.array([[-1, 0], [0, 0], [1, 0], [-1, 1], [0, 1], [1, 1], [0, 2], [-1, 2]], float)
MIRROR = np.array([2, 1, 0, 5, 4, 3, 6, 7])
POLYGONS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, -1]])
FACES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7]])  # both quads cut the same way: not mirrored


def test_corners_go_to_their_twins_whatever_the_diagonal():
    uv = POINTS / 4 + 0.3
    result = mirrored_corner_uv(FACES, POLYGONS, POLYGONS, uv, MIRROR)
    np.testing.assert_allclose(result[:4], uv[MIRROR[FACES[:4]]])
    assert np.isnan(result[4]).all()


def test_a_whole_chart_is_reflected(ball_face):
    template = ball_face.template
    corners = mirrored_corner_uv(template.faces, template.polygons, template.uv_polygons, template.uv, template.mirror)
    texels = build_texels(template.uv, template.uv_faces, 64)
    own = at_corners(template.uv[template.uv_faces], texels.face, texels.barycentric)
    inner = np.abs(own - 0.5).max(axis=1) < 0.45  # the rim's vertices have two places in the chart
    other = at_corners(corners, texels.face, texels.barycentric)
    np.testing.assert_allclose(other[inner], (own * [-1, 1] + [1, 0])[inner], atol=1e-5)
