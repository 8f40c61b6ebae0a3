"""Cleaning: what is broken is mended, what is whole is left, and nothing moves."""

import numpy as np
import pytest

from facewright.data import Scan
from facewright.errors import InputError
from facewright.mesh.normals import face_normals
from facewright.scan import clean_scan
from facewright.scan.clean import far_components, inward_faces, turn_faces


def ball(k=12, radius=1.0, center=(0, 0, 0)):
    """A closed ball of about 2 k^2 triangles, wound outward."""
    theta, phi = np.linspace(0, np.pi, k + 1)[1:-1], np.arange(2 * k) * np.pi / k
    ring = np.stack([np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi))], -1)
    z = np.broadcast_to(np.cos(theta)[:, None, None], (*ring.shape[:2], 1))
    vertices = np.vstack([np.concatenate([ring, z], -1).reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    w, n = 2 * k, 2 * k * (k - 1)
    faces = []
    for i in range(k - 2):
        for j in range(w):
            a, b, c, d = i * w + j, i * w + (j + 1) % w, (i + 1) * w + (j + 1) % w, (i + 1) * w + j
            faces += [[a, d, c], [a, c, b]]
    faces += [[n, j, (j + 1) % w] for j in range(w)]
    faces += [[n + 1, n - w + (j + 1) % w, n - w + j] for j in range(w)]
    return vertices * radius + center, np.array(faces)


def joined(*meshes):
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    faces = [faces + offset for (_, faces), offset in zip(meshes, offsets)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def outward(scan, center=(0, 0, 0)):
    centers = scan.vertices[scan.faces].mean(axis=1)
    return np.einsum("md,md->m", face_normals(scan.vertices, scan.faces), centers - center) > 0


def test_a_clean_scan_is_left_as_it_is():
    vertices, faces = ball()
    scan, stats = clean_scan(Scan(vertices, faces))
    assert np.array_equal(scan.vertices, vertices) and np.array_equal(scan.faces, faces)
    assert stats["closed"] and stats["components"] == 1 and scan.notes == ()
    assert not any(stats[key] for key in ("welded", "degenerate", "duplicate", "crumbs", "turned", "holes"))


def test_faces_of_their_own_points_are_joined():
    vertices, faces = ball()
    uv = np.random.default_rng(0).random((3 * len(faces), 2))
    soup = np.arange(3 * len(faces)).reshape(-1, 3)
    nudge = np.random.default_rng(1).uniform(-1e-8, 1e-8, (len(soup) * 3, 3))
    colors = vertices[faces].reshape(-1, 3) / 2 + 0.5
    for points in (vertices[faces].reshape(-1, 3), vertices[faces].reshape(-1, 3) + nudge):
        scan, stats = clean_scan(Scan(points, soup, uv=uv, uv_faces=soup, colors=colors))
        assert len(scan.vertices) == len(vertices) and stats["closed"]
        assert np.isin(scan.vertices, points).all()
        assert np.allclose(scan.vertices[scan.faces], vertices[faces], atol=1e-7)
        assert np.array_equal(scan.uv[scan.uv_faces], uv[soup])
        assert np.allclose(scan.colors, scan.vertices / 2 + 0.5, atol=1e-7)


def test_degenerate_and_duplicate_faces_go():
    vertices, faces = ball()
    bad = [[0, 0, 1], [5, 9, 5], *faces[:3, [1, 2, 0]], *faces[4:6, ::-1]]
    scan, stats = clean_scan(Scan(np.vstack([vertices, [[9, 9, 9]]]), np.concatenate([faces, bad])))
    assert np.array_equal(scan.faces, faces) and len(scan.vertices) == len(vertices)
    assert stats["degenerate"] == 2 and stats["duplicate"] == 5


def test_crumbs_go_and_parts_stay():
    head, eye, crumb = ball(), ball(6, 0.15, (0.5, 0, 0)), ball(4, 0.03, (2, 0, 0))
    scan, stats = clean_scan(Scan(*joined(head, eye, crumb, ball(4, 0.02, (0, 2, 0)))))
    assert len(scan.faces) == len(head[1]) + len(eye[1])
    assert stats["crumbs"] == 2 and "2 floating crumbs" in scan.notes[0]


def test_cards_that_hang_on_an_edge_go():
    vertices, faces = ball()
    a, b = faces[0, :2]
    tip = 1.2 * vertices[[a, b]].mean(axis=0)
    fin = [[a, b, len(vertices)], [b, len(vertices) + 1, len(vertices)]]
    scan, stats = clean_scan(Scan(np.concatenate([vertices, [tip, 1.1 * tip]]), np.concatenate([faces, fin])))
    assert np.array_equal(scan.faces, faces) and stats["crumbs"] == 1 and stats["closed"]


@pytest.mark.parametrize("closed", [True, False])
def test_inside_out_and_mixed_winding(closed):
    vertices, faces = ball()
    if not closed:
        faces = faces[vertices[faces].mean(axis=1)[:, 2] > -0.3]
    rng = np.random.default_rng(2)
    for flipped in (np.ones(len(faces), bool), rng.random(len(faces)) < 0.5, np.arange(len(faces)) < 9):
        scan = turn_faces(Scan(vertices, faces, uv=vertices[:, :2], uv_faces=faces), flipped)
        scan, stats = clean_scan(scan)
        assert outward(scan).all()
        assert np.array_equal(scan.vertices[scan.faces][..., :2], scan.uv[scan.uv_faces])
        assert stats["turned"] == flipped.sum() and stats["closed"] == closed and len(scan.notes) == 1


def test_a_shallow_mask_looks_away_from_its_hollow():
    vertices, faces = ball(30)
    faces = faces[vertices[faces].mean(axis=1)[:, 2] > 0.6]
    assert not inward_faces(vertices, faces).any()
    assert inward_faces(vertices, faces[:, ::-1]).all()


def test_what_is_hidden_inside_goes_by_its_volume():
    vertices, faces = joined(ball(), ball(8, 0.3))
    inner = np.arange(len(faces)) >= len(ball()[1])
    scan, _ = clean_scan(turn_faces(Scan(vertices, faces), inner))
    assert outward(scan).all()


def test_turning_does_not_hang_on_unit_place_or_orientation():
    vertices, faces = ball()
    faces = np.where((np.arange(len(faces)) % 7 == 0)[:, None], faces[:, ::-1], faces)
    expected = inward_faces(vertices, faces)
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    for scale in (1e-3, 1e4):
        assert np.array_equal(inward_faces(scale * vertices @ rotation.T + 40 * scale, faces), expected)


def test_holes_are_counted():
    vertices, faces = ball()
    centers = vertices[faces].mean(axis=1)
    lone = np.linalg.norm(centers - [1, 0, 0], axis=1).argmin()
    _, stats = clean_scan(Scan(vertices, faces[(centers[:, 2] < 0.9) & (np.arange(len(faces)) != lone)]))
    assert len(stats["holes"]) == 2 and min(stats["holes"]) == 3 and not stats["closed"]


def test_nothing_left():
    with pytest.raises(InputError, match="no face with any area"):
        clean_scan(Scan(np.zeros((3, 3)), [[0, 1, 2]], name="point"))


def test_any_mesh_can_be_cleaned():
    rng = np.random.default_rng(4)
    for _ in range(40):
        scan = Scan(rng.normal(size=(12, 3)).round(1), rng.integers(0, 12, (rng.integers(1, 60), 3)))
        try:
            cleaned, _ = clean_scan(scan)
        except InputError:
            continue
        again, stats = clean_scan(cleaned)
        assert len(again.faces) == len(cleaned.faces) and stats["duplicate"] == stats["degenerate"] == 0


def test_far_pieces():
    scan = Scan(*joined(ball(), ball(6, 1, (10, 0, 0))))
    far = far_components(scan, np.array([[0, 0, 1.0]]), reach=3.0)
    assert np.array_equal(far, np.arange(len(scan.faces)) >= len(ball()[1]))
    assert not far_components(Scan(*ball()), np.array([[99.0, 0, 0]]), reach=3.0).any()
