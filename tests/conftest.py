"""Fixtures shared by all tests."""

from pathlib import Path
from types import SimpleNamespace

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
        {"mouthShrugUpper": ("mouthShrugUpperLeft", "mouthShrugUpperRight")},
        {"lips_open": {"jawOpen": 1.0, "mouthClose": 1.0}},
        {"viseme_aa": {"jawOpen": 0.5}},
    )


def triangles(polygons):
    """Polygons (p, 4), -1 padded, as triangles."""
    return np.vstack([polygons[:, :3], polygons[polygons[:, 3] >= 0][:, [0, 2, 3]]])


@pytest.fixture(scope="session")
def sheet():
    """A function: sheet(n=15, size=14.0), a square sheet of n x n vertices in the xy plane that looks along +Z."""

    def make(n=15, size=14.0):
        x, y = np.meshgrid(np.linspace(0, size, n), np.linspace(0, size, n))
        vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
        grid = np.arange(n * n).reshape(n, n)
        polygons = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4)
        return vertices, triangles(polygons)

    return make


@pytest.fixture(scope="session")
def turn():
    """A function: turn(degrees), the rotation (3, 3) about +Y."""

    def make(degrees):
        angle = np.radians(degrees)
        return np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])

    return make


BALL_RADIUS_MM = 80.0


@pytest.fixture(scope="session")
def ball_face():
    """A Face whose head is a ball of 80 mm: its front lies in the middle of one octahedral chart, and a patch below
    the front pole is the inner mouth. Mirror-exact, 40 x 40 quads, no shapes.
    """
    directions, polygons, uv, uv_polygons = octahedral_sphere(40)
    vertices = BALL_RADIUS_MM * directions
    mirror = np.array([np.abs(vertices - vertex * [-1, 1, 1]).sum(axis=1).argmin() for vertex in vertices])
    inside = (np.linalg.norm(vertices[:, :2] - [0, -35], axis=1) < 14) & (vertices[:, 2] > 0)
    everywhere = np.ones(len(vertices), bool)
    regions = {"skin": everywhere, "outer": ~inside, "mouth_interior": inside, "face": vertices[:, 2] > 20}
    faces, uv_faces = triangles(polygons), triangles(uv_polygons)
    n, m = len(vertices), len(faces)
    template = data.Template(
        vertices=vertices,
        faces=faces,
        polygons=polygons,
        uv=uv,
        uv_faces=uv_faces,
        uv_polygons=uv_polygons,
        mirror=mirror,
        parts=(data.Part("skin", (0, n), (0, m), "skin"),),
        regions=regions,
        lines={},
        landmarks=data.Landmarks((), np.zeros(0), np.zeros((0, 3)), np.zeros(0)),
        shape_names=(),
        deltas=np.zeros((0, n, 3)),
        identity_basis=np.zeros((0, n, 3)),
        openness=np.ones(n),
        skeleton=data.Skeleton(("neck",), (-1,), np.zeros((1, 3))),
        skin_weights=np.ones((n, 1)),
        materials={"skin": {"color": (0.6, 0.42, 0.34), "roughness": 0.6}},
        info={"name": "ball"},
    )
    closed = {"left": False, "right": False}
    return data.Face(template, vertices, vertices, regions, {}, everywhere, {}, closed, {})


def octahedral_sphere(k):
    """A closed sphere of k x k quads as unit vertices (n, 3), quads, their UVs in one square chart and its quads."""
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, k + 1), np.linspace(-1, 1, k + 1)), axis=-1).reshape(-1, 2)
    quads = np.array([[0, 1, k + 2, k + 1]]) + (np.arange(k)[:, None] * (k + 1) + np.arange(k)).reshape(-1, 1)
    # Cut along the octahedron's edges: the other diagonal would leave a triangle without area where they meet the rim.
    same_sign = grid[quads].mean(axis=1).prod(axis=1) > 0
    quads[same_sign] = np.roll(quads[same_sign], 1, axis=1)
    z = 1.0 - np.abs(grid).sum(axis=1)
    folded = (1.0 - np.abs(grid[:, ::-1])) * np.where(grid >= 0, 1.0, -1.0)
    directions = np.column_stack([np.where(z[:, None] >= 0, grid, folded), z])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    _, first, inverse = np.unique(np.round(directions, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    return directions[first], inverse.ravel()[quads], grid / 2 + 0.5, quads


@pytest.fixture(scope="session")
def ball_scan():
    """A function that makes scans of the ball: ball_scan(color, keep=None, k=90, radius=80) -> Scan.

    color  (n, 3) directions -> (n, 3) sRGB 0..1, kept per vertex; None for clay
    keep   (m, 3) directions of face centres -> (m,) bool: what the scan has; None for all of it
    """

    def make(color, keep=None, k=90, radius=BALL_RADIUS_MM):
        directions, quads, _, _ = octahedral_sphere(k)
        a, b = 0.7, 0.4  # turned, so that its triangles have nothing to do with the head's
        directions = directions @ [[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]
        directions = directions @ [[np.cos(b), 0, -np.sin(b)], [0, 1, 0], [np.sin(b), 0, np.cos(b)]]
        faces = triangles(quads)
        if keep is not None:
            centers = directions[faces].mean(axis=1)
            faces = faces[keep(centers / np.linalg.norm(centers, axis=1, keepdims=True))]
        return data.Scan(radius * directions, faces, colors=None if color is None else color(directions))

    return make


@pytest.fixture(scope="session")
def hm08():
    """The shipped template."""
    from facewright.template.store import read_template

    return read_template("hm08")


@pytest.fixture(scope="session")
def hm08_person(hm08):
    """A function: the Face of a person of hm08's identity space, half a standard deviation from the mean per mode."""

    def person(seed):
        weights = np.random.default_rng(seed).standard_normal(len(hm08.identity_basis)) * 0.5
        vertices = hm08.vertices + np.tensordot(weights, hm08.identity_basis, 1)
        seen = np.ones(len(vertices), bool)
        return data.Face(
            hm08, vertices, vertices, hm08.regions, hm08.lines, seen, {}, {"left": False, "right": False}, {}
        )

    return person


@pytest.fixture(scope="session")
def sample_job(tmp_path_factory):
    """The main job on the embedded sample, run once with one thread: its folder, options and report.

    Whoever wants to change something in the folder makes a copy of it.
    """
    from facewright.pipeline import JobOptions, rig_job
    from facewright.sample import sample_path

    folder = tmp_path_factory.mktemp("sample") / "result"
    options = JobOptions(texture_size=256, jobs=1)
    report = rig_job(sample_path(), folder, options)
    return SimpleNamespace(folder=folder, options=options, report=report)
