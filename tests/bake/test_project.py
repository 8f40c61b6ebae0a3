import numpy as np
import pytest

from facewright.bake.project import project_to_scan
from facewright.bake.texels import build_texels
from facewright.data import Scan
from facewright.mesh.normals import vertex_normals


@pytest.fixture(scope="module")
def ball(ball_face):
    template = ball_face.template
    texels = build_texels(template.uv, template.uv_faces, 96)
    normals = vertex_normals(template.vertices, template.faces)

    def project(scan, max_distance_mm=3.0, wanted=None):
        wanted = np.ones(len(texels), bool) if wanted is None else wanted
        return project_to_scan(scan, template.vertices, template.faces, normals, texels, wanted, max_distance_mm)

    return project


def test_every_texel_meets_a_scan_inside_or_outside(ball, ball_scan):
    for radius in (79.3, 80.0, 80.9):
        hits = ball(ball_scan(None, radius=radius))
        assert (hits.face >= 0).all()
        np.testing.assert_allclose(hits.barycentric.sum(axis=1), 1.0, atol=1e-5)
        # The template's facets lie up to 0.4 mm inside the ball.
        assert np.abs(hits.offset - (radius - 80)).max() < 0.5


def test_too_far_away_is_not_seen(ball, ball_scan):
    assert (ball(ball_scan(None, radius=84.0)).face < 0).all()
    assert (ball(ball_scan(None, radius=84.0), max_distance_mm=6.0).face >= 0).all()


def test_a_surface_that_faces_away_is_passed_over(ball, ball_scan):
    outside, inside = ball_scan(None, radius=80.6), ball_scan(None, radius=79.3)
    n = len(outside.vertices)
    both = Scan(np.vstack([outside.vertices, inside.vertices]), np.vstack([outside.faces, inside.faces[:, ::-1] + n]))
    hits = ball(both)
    assert (hits.face >= 0).all() and (hits.face < len(outside.faces)).all()


def test_only_the_wanted_texels_look(ball, ball_scan):
    wanted = np.zeros(9216, bool)
    wanted[::2] = True
    hits = ball(ball_scan(None), wanted=wanted)
    np.testing.assert_array_equal(hits.face >= 0, wanted)
    assert (ball(ball_scan(None), wanted=wanted & False).face < 0).all()
