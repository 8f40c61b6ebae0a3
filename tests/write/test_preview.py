from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from facewright import data
from facewright.write import preview
from facewright.write.preview import draw_close_ups, preview_sheet, write_preview


def ball_rig(face, names=("jawOpen", "mouthClose", "tongueOut")):
    """A Rig of the ball with a few bulges for shapes and an eye that never moves."""
    template = face.template
    rng = np.random.default_rng(0)
    skin = data.Mesh(
        "skin",
        face.vertices,
        template.faces,
        template.polygons,
        template.uv,
        template.uv_faces,
        template.uv_polygons,
        data.Material("skin", albedo="albedo", normal="normal"),
        template.skin_weights,
        np.stack([face.vertices * 0.05 * (i + 1) for i in range(len(names))]),
    )
    eye = data.Mesh(
        "eye",
        face.vertices * 0.15 + [20, 20, 70],
        template.faces,
        template.polygons,
        template.uv,
        template.uv_faces,
        template.uv_polygons,
        data.Material("eye", (0.9, 0.9, 0.9), 0.1),
        template.skin_weights,
    )
    maps = {
        "albedo": rng.integers(90, 200, (32, 32, 3)).astype(np.uint8),
        "normal": np.full((32, 32, 3), (128, 128, 255), np.uint8),
    }
    regions = dict(face.regions)
    return data.Rig((skin, eye), names, template.skeleton, maps, regions, {}, {"template": "ball", "name": "a ball"})


@pytest.fixture(scope="module")
def sheet(ball_face, ball_scan):
    return preview_sheet(ball_rig(ball_face), ball_scan(None), ball_face)


def test_the_sheet_is_wide_and_shows_something(sheet):
    assert sheet.dtype == np.uint8 and sheet.shape[1] == 1864 and sheet.shape[0] > 1500
    assert (sheet.reshape(-1, 3).max(axis=1) > 100).mean() > 0.1


def test_close_ups_drawn_beside_the_rest_are_the_same(sheet, ball_face, ball_scan):
    rig = ball_rig(ball_face)
    again = preview_sheet(rig, ball_scan(None), ball_face, closer=lambda: draw_close_ups(rig))
    np.testing.assert_array_equal(again, sheet)


def test_the_words_on_the_sheet(ball_face, ball_scan, monkeypatch):
    words = []
    monkeypatch.setattr(preview, "compose_sheet", lambda *given: words.append(given))
    rig = ball_rig(ball_face)
    preview_sheet(rig, ball_scan(None), ball_face, title="anna/head.obj")
    preview_sheet(replace(rig, in_betweens={"jawOpen": {0.5: "tongueOut"}}), ball_scan(None), ball_face)
    (title, plain, sections), (_, full, _) = words
    assert title == "anna/head.obj" and plain.endswith(", 3 shapes")
    assert full.endswith(", 2 shapes (and 1 halves, in-betweens and correctives)")
    shapes = next(section for section in sections if section.heading.startswith("Shapes"))
    assert [cell.caption for cell in shapes.rows[0]] == ["neutral", "jawOpen", "mouthClose (jaw open)", "tongueOut"]


def test_textured_scans_of_two_images_and_coloured_ones(ball_face, ball_scan, tmp_path):
    template = ball_face.template
    red, blue = np.full((8, 8, 3), (200, 30, 30), np.uint8), np.full((8, 8, 3), (30, 30, 200), np.uint8)
    number = np.arange(len(template.faces)) % 3 - 1  # a third has no texture at all
    scan = data.Scan(template.vertices, template.faces, template.uv, template.uv_faces, (red, blue), number)
    write_preview(ball_rig(ball_face), scan, ball_face, tmp_path / "preview.png")
    picture = np.asarray(Image.open(tmp_path / "preview.png")).astype(int)
    front = picture[150:500, 40:330]
    assert ((front[..., 0] - front[..., 2]) > 80).any() and ((front[..., 2] - front[..., 0]) > 80).any()

    coloured = ball_scan(lambda d: np.tile([0.1, 0.8, 0.1], (len(d), 1)))
    picture = preview_sheet(ball_rig(ball_face), coloured, ball_face).astype(int)
    front = picture[150:500, 40:330]
    assert ((front[..., 1] - front[..., 0]) > 80).mean() > 0.3
