import numpy as np
import pytest

from facewright.bake.maps import FILLED, INSIDE, SEEN, BakeOptions, bake, describe_maps
from facewright.bake.texels import at_corners, at_points, build_texels
from facewright.data import Face, Scan
from facewright.mesh.normals import normalized, vertex_normals
from facewright.mesh.tangents import corner_tangents, from_tangent_space

SIZE = BakeOptions(size=256)


def color(directions):
    """A smooth sRGB colour 0..1 of directions (n, 3), the same on both sides."""
    x, y, z = np.abs(directions[:, 0]), directions[:, 1], directions[:, 2]
    return np.stack([0.6 + 0.2 * np.sin(3 * y), 0.45 + 0.2 * x, 0.4 + 0.15 * np.cos(4 * z)], axis=1)


@pytest.fixture(scope="module")
def texels(ball_face):
    template = ball_face.template
    return build_texels(template.uv, template.uv_faces, SIZE.size)


def at(maps, name, texels):
    return maps[name].reshape(SIZE.size**2, -1)[texels.index].astype(float)


def directions_of(texels, face):
    template = face.template
    points = at_points(template.vertices, template.faces, texels.face, texels.barycentric)
    return normalized(points.astype(float))


def test_the_scans_colours_arrive(ball_face, ball_scan, texels):
    maps = bake(ball_scan(color), ball_face, SIZE)
    assert maps["albedo"].shape == (256, 256, 3) and all(image.dtype == np.uint8 for image in maps.values())
    coverage = at(maps, "coverage", texels)[:, 0]
    inside = ~ball_face.regions["outer"][ball_face.template.faces].all(axis=1)[texels.face]
    np.testing.assert_array_equal(coverage == INSIDE, inside)
    assert (coverage[~inside] == SEEN).all()
    error = np.abs(at(maps, "albedo", texels) - 255 * color(directions_of(texels, ball_face)))[~inside]
    assert error.mean() < 1.0 and error.max() < 4.0
    assert at(maps, "albedo", texels)[inside].min(axis=0)[0] < 80, "the mouth is dark"
    assert describe_maps(ball_face, maps)["outer_skin_seen_share"] == 1.0


def test_the_scans_normals_arrive(ball_face, ball_scan, texels):
    """The normal map, read the way a viewer reads it, gives the ball's own normals on the faceted head."""
    maps = bake(ball_scan(None), ball_face, SIZE)
    template = ball_face.template
    normals = vertex_normals(template.vertices, template.faces)
    tangents, signs = corner_tangents(template.vertices, template.faces, normals, template.uv, template.uv_faces)
    normal = normalized(at_points(normals, template.faces, texels.face, texels.barycentric).astype(float))
    tangent = normalized(at_corners(tangents, texels.face, texels.barycentric).astype(float))
    read = from_tangent_space((at(maps, "normal", texels) - 128) / 127, normal, tangent, signs[texels.face])
    seen = at(maps, "coverage", texels)[:, 0] == SEEN
    angle = np.degrees(np.arccos(np.clip((read * directions_of(texels, ball_face)).sum(1), -1, 1)))
    assert angle[seen].mean() < 0.4 and np.percentile(angle[seen], 99) < 1.0
    np.testing.assert_array_equal(at(maps, "normal", texels)[~seen].min(axis=0) > 100, True)


def test_its_own_texture_and_normal_map_come_back(ball_face):
    """A scan with the head's mesh and UVs: baking copies its images texel by texel."""
    template = ball_face.template
    rows, columns = np.indices((256, 256))
    image = np.stack([rows, columns, (rows + columns) // 2], axis=-1).astype(np.uint8)
    bent = np.stack([0.3 * np.sin(rows / 9), 0.3 * np.cos(columns / 7), np.ones((256, 256))], axis=-1)
    bumps = np.rint(normalized(bent) * 127 + 128).astype(np.uint8)
    scan = Scan(template.vertices, template.faces, template.uv, template.uv_faces, (image,), normal_map=bumps)
    maps = bake(scan, ball_face, SIZE)
    own = maps["coverage"] == SEEN
    own[[0, 1, -2, -1]], own[:, [0, 1, -2, -1]] = False, False  # along the seam samples are moved inwards
    assert np.abs(maps["albedo"].astype(int) - image)[own].max() <= 1
    difference = np.abs(maps["normal"].astype(int) - bumps)[own]
    assert difference.mean() < 0.6 and np.percentile(difference, 99) <= 2


def test_a_hole_repeats_the_other_side(ball_face, ball_scan, texels):
    hole = normalized(np.array([[0.6, 0.2, 0.7]]))[0]
    maps = bake(ball_scan(color, keep=lambda d: d @ hole < 0.93), ball_face, SIZE)
    directions = directions_of(texels, ball_face)
    missing = directions @ hole > 0.94
    assert (at(maps, "coverage", texels)[missing, 0] == FILLED).all()
    error = np.abs(at(maps, "albedo", texels) - 255 * color(directions))
    assert error[missing].mean() < 2.0
    away = (directions @ hole < 0.8) & (at(maps, "coverage", texels)[:, 0] != INSIDE)
    assert (at(maps, "coverage", texels)[away, 0] == SEEN).all() and error[away].max() < 4.0
    np.testing.assert_allclose(
        at(maps, "normal", texels)[missing], np.tile([128, 128, 255], (missing.sum(), 1)), atol=1
    )


def test_what_neither_side_shows_is_smooth_and_between_its_borders(ball_face, ball_scan, texels):
    maps = bake(ball_scan(color, keep=lambda d: d[:, 2] > -0.3), ball_face, SIZE)
    behind = directions_of(texels, ball_face)[:, 2] < -0.5
    assert (at(maps, "coverage", texels)[behind, 0] == FILLED).all()
    albedo = at(maps, "albedo", texels)
    assert np.abs(albedo[behind] - np.median(albedo, axis=0)).max() < 80
    grid = np.abs(np.diff(maps["albedo"].astype(int), axis=0)).max(axis=2)[:40]
    assert grid.max() < 12, "no step at the border"


def test_what_the_fit_does_not_follow_is_not_read(ball_face, ball_scan, texels):
    observed = ball_face.template.vertices[:, 1] < 30
    face = Face(**{**vars(ball_face), "observed": observed})
    maps = bake(ball_scan(color), face, SIZE)
    high = directions_of(texels, ball_face)[:, 1] > 0.5
    assert (at(maps, "coverage", texels)[high, 0] == FILLED).all()


def test_strands_beside_hair_are_not_read_but_brows_are(ball_face, ball_scan, texels):
    def strand(directions):
        return (np.abs(directions[:, 0]) < 0.02) & (directions[:, 1] > 0.34) & (directions[:, 1] < 0.38)

    def hair_on_skin(directions):
        return np.where((strand(directions) | (directions[:, 1] > 0.5))[:, None], 0.15, [[0.7, 0.5, 0.4]])

    high = ball_face.template.vertices[:, 1] > 40
    regions = ball_face.regions | {"hidden": high}
    face = Face(**{**vars(ball_face), "observed": ~high, "regions": regions})
    maps = bake(ball_scan(hair_on_skin), face, SIZE)
    directions = directions_of(texels, ball_face)
    beside = strand(directions)
    light = at(maps, "albedo", texels)[:, 0] / (255 * 0.7)
    assert light[beside & (directions[:, 2] < 0.2)].min() > 0.8
    assert light[beside & (directions[:, 2] > 0.3)].min() < 0.6, "in the face it may be a brow"


def test_a_scan_without_colour_gives_the_materials(ball_face, ball_scan, texels):
    maps = bake(ball_scan(None), ball_face, SIZE)
    seen = at(maps, "coverage", texels)[:, 0] == SEEN
    assert seen.mean() > 0.9
    skin = at(maps, "albedo", texels)[seen]
    np.testing.assert_allclose(skin, np.tile([203, 174, 158], (len(skin), 1)), atol=2)


def test_threads_change_nothing_and_inputs_stay(ball_face, ball_scan):
    scan = ball_scan(color, keep=lambda d: d[:, 0] < 0.8)
    before = scan.vertices.copy()
    one, two = (bake(scan, ball_face, BakeOptions(size=600), jobs=jobs) for jobs in (1, 2))
    for name in one:
        np.testing.assert_array_equal(one[name], two[name])
    np.testing.assert_array_equal(scan.vertices, before)


def test_a_hole_that_the_scan_shows_beside_the_nostril_is_filled(ball_face, ball_scan, texels, monkeypatch):
    monkeypatch.setattr("facewright.bake.nostrils.AROUND_MM", 15.0)  # two of the ball's long edges
    nostrils = ball_face.regions["mouth_interior"]
    eyes = np.abs(ball_face.vertices[:, 1] - 30) < 5
    regions = ball_face.regions | {"nostrils": nostrils, "mouth_interior": nostrils & False, "eyes": eyes}
    face = Face(**{**vars(ball_face), "regions": regions})

    def at_hole(directions, mm):
        return (np.linalg.norm(80 * directions[:, :2] - [0, -35], axis=1) < mm) & (directions[:, 2] > 0)

    maps = bake(ball_scan(lambda d: np.where(at_hole(d, 17.0)[:, None], 0.1, [[0.7, 0.5, 0.4]])), face, SIZE)
    directions, coverage = directions_of(texels, face), at(maps, "coverage", texels)[:, 0]
    light = at(maps, "albedo", texels)[:, 0] / (255 * 0.7)
    rim = at_hole(directions, 17.0) & (coverage != INSIDE)
    assert (coverage[rim] == FILLED).mean() > 0.95
    assert np.percentile(light[rim], 5) > 0.8
    deep = at_hole(directions, 6.0)
    assert light[deep].max() < 0.6 and (coverage[deep] == INSIDE).all()
    assert (coverage[~at_hole(directions, 38.0)] == SEEN).all()
