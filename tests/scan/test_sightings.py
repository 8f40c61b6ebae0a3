"""Cameras that move with a frame, shading that does not know the triangulation, several textures as one."""

import numpy as np

from facewright.data import Scan
from facewright.mesh.raster import Camera, RayScene
from facewright.mesh.render import sample_texture
from facewright.scan.sightings import TEXTURE_SIDE, cast_pixels, moved_camera, shading_normals, transform, worn_looks


def similarity():
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    T = np.eye(4)
    T[:3, :3] = rotation * np.linalg.det(rotation) * 3.0
    T[:3, 3] = 10, -20, 30
    return T


def test_moved_camera_sees_the_same():
    camera = Camera.looking_at((0, -30, 20), 20, 10, 150, (50, 60))
    T, points = similarity(), np.random.default_rng(1).normal(size=(7, 3)) * 20
    pixels, _ = camera.project(transform(T, points))
    moved, _ = moved_camera(camera, T).project(points)
    assert np.allclose(pixels, moved)


def test_rays_through_pixels_meet_what_is_drawn_there():
    camera = Camera.looking_at((0, 0, 0), 30, 20, 50, (40, 60))
    vertices = np.array([[-30, -20, 5], [30, -20, 0], [0, 30, -5.0]])
    hits = cast_pixels(RayScene(vertices, [[0, 1, 2]]), camera, camera.project(vertices.mean(0)[None])[0])
    assert hits.face[0] == 0 and np.allclose(hits.barycentric[0], 1 / 3, atol=1e-5)
    pixels = np.stack(np.meshgrid(np.arange(60) + 0.5, np.arange(40) + 0.5), -1).reshape(-1, 2)
    scene = RayScene(vertices, [[0, 1, 2]])
    assert np.array_equal(cast_pixels(scene, camera, pixels).face, scene.cast(*camera.rays()).face)


def test_shading_is_smoothed_over_a_reach(ball_scan):
    coarse, fine = ball_scan(None, k=20), ball_scan(None, k=90)
    assert np.array_equal(
        shading_normals(coarse.vertices, coarse.faces), shading_normals(coarse.vertices, coarse.faces)
    )
    rng = np.random.default_rng(0)
    rough = fine.vertices + rng.normal(size=fine.vertices.shape) * 0.3
    truth = fine.vertices / np.linalg.norm(fine.vertices, axis=1, keepdims=True)

    def error(reach):
        cosine = np.einsum("nd,nd->n", shading_normals(rough, fine.faces, reach=reach), truth)
        return np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean()

    assert error(6.0) < 0.6 * error(0.0)


def test_several_textures_become_one_picture():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 3]])
    uv = square[:, :2] * 0.8 + 0.1 + [3, -2]  # far from the unit square, as tiled files have it
    textures = tuple(np.full((8, 8, 3), value, np.uint8) for value in (40, 200))
    looks = worn_looks(Scan(square, faces, uv, faces, textures, [0, 1, -1]))
    colors = sample_texture(looks.texture, looks.uv[looks.uv_faces].mean(axis=1))
    assert np.allclose(colors[:2], [[40] * 3, [200] * 3]) and colors[2, 0] > colors[2, 2] > 100


def test_large_textures_are_averaged():
    image = np.zeros((2 * TEXTURE_SIDE, 64, 3), np.uint8)
    image[::2] = 100
    faces = np.array([[0, 1, 2]])
    scan = Scan(np.eye(3), faces, np.eye(3)[:, :2], faces, (image,), [0])
    assert worn_looks(scan).texture.shape == (TEXTURE_SIDE, 32, 3) and (worn_looks(scan).texture == 50).all()


def test_clay_wears_nothing():
    assert worn_looks(Scan(np.eye(3), [[0, 1, 2]])) is None
    looks = worn_looks(Scan(np.eye(3), [[0, 1, 2]], colors=np.full((3, 3), 0.5)))
    assert np.allclose(looks.colors, 0.2140411)
