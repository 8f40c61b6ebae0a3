"""The picture of landmarks shows what they mark."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from facewright.data import Landmarks
from facewright.mesh.raster import Camera
from facewright.write.landmarks import CENTER, HALF_HEIGHT_MM, POINT, SIZE, draw_landmarks


@pytest.mark.parametrize("names", [{"mp4": "nose_tip"}, None])
def test_a_point_is_ringed_and_stays_visible(ball_scan, tmp_path, names):
    scan = ball_scan(None)
    face = np.linalg.norm(scan.vertices[scan.faces].mean(axis=1) - [0.0, 0.0, 80.0], axis=1).argmin()
    marks = Landmarks(("mp4",), np.array([face]), np.full((1, 3), 1 / 3), np.ones(1))
    pictures = []
    for weight in (0.0, 1.0):
        draw_landmarks(tmp_path / "points.png", scan, replace(marks, weights=np.array([weight])), names)
        pictures.append(np.asarray(Image.open(tmp_path / "points.png")).astype(int))
    bare, drawn = (picture[:, SIZE[1] : 2 * SIZE[1]] for picture in pictures)
    pixel, _ = Camera.looking_at(CENTER, 0, 0, HALF_HEIGHT_MM, SIZE).project(marks.positions(scan.vertices, scan.faces))
    x, y = pixel[0].round().astype(int)
    assert (drawn[y, x] == bare[y, x]).all()
    yellow = np.argwhere((drawn == POINT).all(axis=2))
    assert len(yellow) > 8 and np.linalg.norm(yellow - [y, x], axis=1).max() < 9
