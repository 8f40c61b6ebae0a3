"""The scanner's surface is the head's outside without openings, and its triangles are its own."""

import numpy as np
import pytest

from facewright.evaluate import scanner
from facewright.mesh.adjacency import border_loops, half_edges
from facewright.mesh.closest import Surface
from facewright.template.store import read_template


@pytest.fixture(scope="module")
def template():
    return read_template("hm08")


@pytest.fixture(scope="module")
def surface(template):
    return scanner.scanner_surface(template, template.vertices)


def test_only_the_neck_is_open(template, surface):
    V, F, _ = surface
    loops = border_loops(F)
    assert len(loops) == 1
    assert V[loops[0], 1].max() < template.vertices[template.lines["lip_seam_upper"], 1].min()


def test_every_edge_has_two_faces_that_agree(surface):
    _, F, _ = surface
    edges = half_edges(F)
    assert len(np.unique(edges, axis=0)) == len(edges)


def test_the_outer_skin_is_untouched(template, surface):
    V, F, _ = surface
    outer = template.vertices[template.regions["face"]]
    assert Surface(V, F).closest(outer).distance.max() < 1e-3


def test_the_eyes_bulge_between_the_lids(template, surface):
    V, F, eye = surface
    for name in ("eye_left", "eye_right"):
        center, radius = scanner.eyeball(template.vertices[template.part(name).vertex_slice])
        bump = V[F[eye]].reshape(-1, 3)
        mine = bump[np.linalg.norm(bump - center, axis=1) < 2 * radius]
        assert len(mine)
        top = mine[:, 2].max() - center[2]
        assert radius < top < radius + 2.5


def test_remeshing_keeps_the_surface_and_no_vertex(surface):
    V, F, _ = surface
    points, faces = scanner.remesh(V, F, 12000, np.random.default_rng(0))
    assert abs(len(faces) - 12000) < 200
    assert Surface(V, F).closest(points).distance.max() < 1e-6
    assert Surface(points, faces).closest(V).distance.mean() < 0.15
    pairs = np.linalg.norm(points[:, None] - V[None, ::50], axis=2)
    assert (pairs.min(axis=0) < 1e-6).mean() < 0.02
    assert scanner.flipped(points, faces, Surface(V, F)).mean() < 0.01


def test_an_eyeball_without_its_front_is_measured_all_the_same():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(4000, 3))
    points = 12.0 * points / np.linalg.norm(points, axis=1, keepdims=True) + [31.0, 1.0, -2.0]
    center, radius = scanner.eyeball(points[points[:, 2] < 6.0])
    assert radius == pytest.approx(12.0, abs=0.1)
    assert np.allclose(center, [31, 1, -2], atol=0.1)
