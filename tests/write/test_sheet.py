import numpy as np

from facewright.write.sheet import GROUND, MARGIN, Cell, Section, color_bar, compose_sheet


def picture(height, width, tone):
    return np.full((height, width, 3), tone, np.uint8)


def test_pictures_stand_where_they_should_and_nothing_is_cut_off():
    first = Section("One", ((Cell(picture(40, 300, 250), "a"), Cell(picture(40, 300, 200), "b")),), "a note")
    legend = color_bar(np.uint8([[0, 0, 0], [255, 0, 0]]), ("0", "1"), (10, 100))
    second = Section("Two", ((Cell(picture(50, 100, 150)),), (Cell(picture(30, 100, 100)),)), "", legend)
    sheet = compose_sheet("title", "subtitle", (first, second))
    for tone, size in ((250, 40 * 300), (200, 40 * 300), (150, 50 * 100), (100, 30 * 100)):
        rows = np.flatnonzero((sheet == tone).all(axis=2))
        assert len(rows) >= size
    assert np.nonzero((sheet == 250).all(axis=2))[1].min() == MARGIN
    assert np.nonzero((sheet == 150).all(axis=2))[1].min() == MARGIN
    np.testing.assert_array_equal(sheet[-1], np.tile(np.uint8(GROUND), (sheet.shape[1], 1)))
    assert sheet.shape[1] == 608 + 2 * MARGIN


def test_a_scale_runs_through_its_colours():
    colors = np.linspace([0, 0, 0], [200, 100, 50], 11).round().astype(np.uint8)
    bar = color_bar(colors, ("low", "middle", "high"), (12, 220))
    np.testing.assert_array_equal(bar[5, 0], [0, 0, 0])
    np.testing.assert_array_equal(bar[5, -1], [200, 100, 50])
    assert (np.diff(bar[5, :, 0].astype(int)) >= 0).all()
