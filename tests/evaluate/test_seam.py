"""The crease between two made lips is found where it was put."""

import numpy as np
import pytest

from facewright.evaluate import seam

WIDTH = 50.0


def lips(place, overhang=0.0, slit=0.0, step=0.25):
    """Two bulging lips that meet at height place(x), on an arched jaw: vertices (n, 3), faces (m, 3)."""
    x, t = np.meshgrid(np.arange(-35, 35.01, step), np.linspace(-16, 16, 257), indexing="ij")
    y = t + place(x)
    bulge = 4.0 * (1 - np.exp(-np.abs(t) / 1.2)) * np.exp(-np.abs(t) / 9.0)
    z = 60.0 - x**2 / 60.0 + bulge + overhang * (t > 0) - slit * (np.abs(t) < 0.1)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    grid = np.arange(x.size).reshape(x.shape)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    quads = np.stack([a, b, c, d], axis=2).reshape(-1, 4)
    return vertices, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def corners(vertices, place):
    ends = []
    for x in (-WIDTH / 2, WIDTH / 2):
        ends.append([x, float(place(np.array(x))), 60.0 - x**2 / 60.0])
    return np.array(ends)


def bow(x):
    return 1.5 * np.cos(np.pi * x / WIDTH)


def true_line():
    x = np.linspace(-WIDTH / 2, WIDTH / 2, 80)
    return np.stack([x, bow(x), 60.0 - x**2 / 60.0], axis=1)


@pytest.mark.parametrize(("overhang", "slit"), [(0.0, 0.0), (0.8, 0.0), (0.0, 12.0)])
def test_crease_is_found_to_a_seventh_of_a_millimetre(overhang, slit):
    vertices, faces = lips(bow, overhang, slit)
    crease = seam.find_crease(vertices, faces, *corners(vertices, bow))
    assert crease.sure.mean() > 0.95
    assert np.nanpercentile(seam.seam_offsets_mm(crease, true_line()), 95) < 0.15


def test_rough_corners_do_not_matter():
    vertices, faces = lips(bow)
    right, left = corners(vertices, bow)
    crease = seam.find_crease(vertices, faces, right + [1.0, 2.0, 1.0], left + [-0.5, -2.0, 0.0])
    assert np.nanpercentile(seam.seam_offsets_mm(crease, true_line()), 95) < 0.15


def test_an_offset_seam_is_told_by_how_much():
    vertices, faces = lips(bow)
    crease = seam.find_crease(vertices, faces, *corners(vertices, bow))
    x = np.linspace(-WIDTH / 2, WIDTH / 2, 40)
    line = np.stack([x, bow(x) + 1.0, 60.0 - x**2 / 60.0], axis=1)
    offsets = seam.seam_offsets_mm(crease, line)
    assert np.nanmedian(offsets) == pytest.approx(1.0, abs=0.15)


def test_depth_between_the_lips_is_no_offset():
    vertices, faces = lips(bow)
    crease = seam.find_crease(vertices, faces, *corners(vertices, bow))
    deeper = crease.points - 2.0 * crease.outward
    assert np.nanmax(seam.seam_offsets_mm(crease, deeper)) < 0.2


def test_smooth_skin_has_no_sure_crease():
    vertices, faces = lips(bow)
    flat = vertices.copy()
    flat[:, 2] = 60.0 - flat[:, 0] ** 2 / 60.0
    crease = seam.find_crease(flat, faces, *corners(vertices, bow))
    assert not crease.sure.any()


def test_in_a_wide_trough_the_dark_line_decides():
    vertices, faces = lips(bow)
    t = vertices[:, 1] - bow(vertices[:, 0])
    trough = vertices.copy()
    walls = 0.8 * np.clip(np.abs(t - 0.6) - 1.5, 0.0, 4.0)
    trough[:, 2] = 60.0 - vertices[:, 0] ** 2 / 60.0 + walls
    dark = np.where(np.abs(t) < 0.25, 0.2, 0.8)

    def brightness(at, barycentric):
        return (dark[faces[at]] * barycentric).sum(axis=1)

    ends = corners(vertices, bow)
    by_shape = seam.seam_offsets_mm(seam.find_crease(trough, faces, *ends), true_line())
    by_light = seam.seam_offsets_mm(seam.find_crease(trough, faces, *ends, brightness=brightness), true_line())
    assert np.nanmedian(by_shape) > 0.4  # the middle of the trough
    assert np.nanpercentile(by_light, 95) < 0.2
