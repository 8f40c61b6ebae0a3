"""Fixtures shared by all tests."""

from pathlib import Path

import numpy as np
import pytest

from facewright import data


@pytest.fixture(scope="session")
def shared():
    """The folder of real scans beside the project; tests that need it are skipped where it is missing."""
    folder = Path(__file__).resolve().parents[2] / "shared"
    if not (folder / "data").is_dir():
        pytest.skip("needs the real scans in ../shared, which only the project's own machines have")
    return folder


@pytest.fixture
def small_rig():
    """A rig of a moving skin with a UV seam, a mirrored UV and a lone vertex, and a tooth that never moves."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    vertices = np.stack([x * 10 + y / 3, y * 10, np.cos(x) / 7], axis=-1).reshape(-1, 3)
    vertices = np.vstack([vertices, [[5, 5, -20]]])
    polygons = np.array([[i + j * 4, i + 1 + j * 4, i + 5 + j * 4, i + 4 + j * 4] for j in range(2) for i in range(3)])
    uv = np.vstack([vertices[:12, :2] / 40 + 0.05, vertices[[2, 6, 10], :2] / 40 + 0.1])
    uv_polygons = polygons.copy()
    uv_polygons[[2, 5]] = [[12, 3, 7, 13], [13, 7, 11, 14]]
    uv[[3, 7, 11], 0] = uv[12:, 0] - 0.2
    polygons = np.vstack([polygons[:-1], np.append(polygons[-1, :3], -1)])
    uv_polygons = np.vstack([uv_polygons[:-1], np.append(uv_polygons[-1, :3], -1)])
    deltas = rng.normal(size=(3, 13, 3)) * [[[4]], [[0]], [[1]]]
    deltas[2, :6] = 0
    weights = rng.random((13, 5))
    weights /= weights.sum(axis=1, keepdims=True)
    grey = data.Material("skin", (0.5, 0.4, 0.3), albedo="albedo", normal="normal")
    skin = data.Mesh(
        "skin",
        vertices,
        triangles(polygons),
        polygons,
        uv,
        triangles(uv_polygons),
        uv_polygons,
        grey,
        weights,
        deltas,
    )
    quad = np.array([[0, 1, 2, 3]])
    corners = np.array([[0, 0, 0], [3, 0, 0], [3, 9, 0.1], [0, 9, 0]], float)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    enamel = data.Material("teeth", (0.9, 0.9, 0.8), 0.3, alpha=0.5, double_sided=True)
    jaw = np.eye(5)[[2, 2, 2, 2]]
    tooth = data.Mesh("tooth", corners, triangles(quad), quad, square, triangles(quad), quad, enamel, jaw)
    joints = np.array([[0, -90, -40], [0, -20, -40], [0, -30, -10.1], [31, 0, -12], [-31, 0, -12]])
    skeleton = data.Skeleton(("neck", "head", "jaw", "eye_left", "eye_right"), (-1, 0, 1, 1, 1), joints)
    image = rng.integers(0, 255, (8, 8, 3)).astype(np.uint8)
    return data.Rig(
        (skin, tooth),
        ("jawOpen", "mouthClose", "tongueOut"),
        skeleton,
        {"albedo": image, "normal": np.roll(image, 1, 0)},
        {"face": np.arange(13) < 7},
        {"lips": np.array([3, 1, 2])},
        {"copyright": "nobody", "credits": ["made for tests"], "T_rig_to_scan": np.eye(4).tolist(), "depth_mm": 1 / 3},
        {"jawOpen": {0.5: "mouthClose"}},
        {"tongueOut": ("jawOpen", "mouthClose")},
    )


def triangles(polygons):
    """Polygons (p, 4), -1 padded, as triangles."""
    return np.vstack([polygons[:, :3], polygons[polygons[:, 3] >= 0][:, [0, 2, 3]]])
