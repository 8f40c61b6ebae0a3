"""The embedded sample is small, whole, and what its script makes."""

import numpy as np
import pytest

from facewright.mesh.closest import Surface
from facewright.mesh.raster import raster_uv
from facewright.read import read_scan
from facewright.sample import FOLDER, charts, sample_path, truth_path
from facewright.template.store import read_template


@pytest.fixture(scope="module")
def scan():
    return read_scan(sample_path())


def test_files_are_small(scan):
    names = ("head.obj", "head.mtl", "albedo.jpg")
    assert sum((FOLDER / name).stat().st_size for name in names) < 3_000_000
    assert scan.has_texture
    assert scan.textures[0].shape == (1024, 1024, 3)


def test_truth_fits_the_template_and_the_scan(scan):
    template = read_template("hm08")
    with np.load(truth_path(), allow_pickle=False) as truth:
        assert str(truth["topology_id"]) == template.info["topology_id"], "run python -m facewright.sample.make"
        vertices = truth["vertices"].astype(float)
    face = template.regions["face"] & ~template.regions["nostrils"]
    distance = Surface(scan.vertices, scan.faces).closest(vertices[face]).distance
    assert np.median(distance) * 10.0 < 0.3  # centimetres


def test_every_face_has_its_own_place_in_the_texture():
    x, y = np.meshgrid(np.linspace(0, 2 * np.pi, 41)[:-1], np.linspace(0.02, np.pi - 0.02, 30))
    ball = 40.0 * np.stack([np.sin(y) * np.sin(x), np.cos(y), np.sin(y) * np.cos(x)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(29), np.arange(40), indexing="ij")
    a, b = (i * 40 + j).ravel(), (i * 40 + (j + 1) % 40).ravel()
    faces = np.vstack([np.stack([a, a + 40, b + 40], axis=1), np.stack([a, b + 40, b], axis=1)])
    uv, uv_faces = charts.layout(ball, faces)
    assert uv.min() >= 0 and uv.max() <= 1
    face, _ = raster_uv(uv, uv_faces, 1024)
    texels = np.bincount(face[face >= 0], minlength=len(faces))
    corners = uv[uv_faces]
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    area = np.abs(np.linalg.det(sides)) / 2 * 1024**2
    large = area > 20
    assert large.mean() > 0.9
    assert (texels[large] > 0.6 * area[large]).all()  # no other face lies on top
