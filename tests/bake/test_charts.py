import numpy as np
import pytest

from facewright.bake.charts import SEAM_MM, find_cuts, find_tears, guarded_edges
from facewright.bake.sample import ScanLooks
from facewright.data import Scan

N, SIZE, PIXELS = 16, 80.0, 200  # a sheet of 16 x 16 squares of 5 mm


def colors(points):
    """A smooth sRGB colour of points (n, 2) of the sheet."""
    return np.stack([120 + points[:, 0], 100 + 0.5 * points[:, 1], np.full(len(points), 90.0)], axis=1)


@pytest.fixture(scope="module")
def atlas(sheet):
    """A function: the Scan of a sheet whose island (one square) and right half lie apart in the picture.

    gutter: the colours go on beyond each chart, else all else is black; wrong: what is added to the island's colours.
    """
    vertices, faces = sheet(N + 1, SIZE)
    middle = vertices[faces].mean(axis=1)[:, :2]
    island = (np.abs(middle - [27.5, 42.5]) < 2.5).all(axis=1)
    kind = np.where(island, 2, (middle[:, 0] > 40).astype(int))
    place = np.array([[5.0, 10.0], [60.0, 10.0], [120.0, 120.0]])  # mm in a picture of 200 mm

    def make(gutter=True, wrong=0.0):
        corners = vertices[faces][..., :2] + place[kind][:, None]
        rows, columns = np.indices((PIXELS, PIXELS))
        pixels = np.stack([columns + 0.5, PIXELS - rows - 0.5], axis=-1).reshape(-1, 2)
        image = np.zeros((len(pixels), 3))
        for chart in range(3):
            low, high = (f(corners[kind == chart].reshape(-1, 2), axis=0) for f in (np.min, np.max))
            reach = 4.0 if gutter else 0.0
            inside = ((pixels > low - reach) & (pixels < high + reach)).all(axis=1)
            image[inside] = colors(pixels[inside] - place[chart]) + (wrong if chart == 2 else 0.0)
        image = np.rint(image).astype(np.uint8).reshape(PIXELS, PIXELS, 3)
        scan = Scan(
            vertices, faces, corners.reshape(-1, 2) / PIXELS, np.arange(corners.size // 2).reshape(-1, 3), (image,)
        )
        return scan, island, kind

    return make


def test_cuts_run_between_charts(atlas):
    scan, _, kind = atlas()
    cuts = find_cuts(ScanLooks(scan))
    ends = [kind[side // 3] for side in (cuts.here, cuts.there)]
    assert (ends[0] != ends[1]).all() and len(cuts.here) == N + 4
    assert len(np.unique(cuts.chart)) == 3


def test_samples_keep_off_a_ground_but_not_off_gutters(atlas):
    for gutter in (True, False):
        scan, _, _ = atlas(gutter)
        looks = ScanLooks(scan)
        cuts = find_cuts(looks)
        guarded, steps = guarded_edges(looks, cuts)
        along = np.concatenate([cuts.here, cuts.there])
        assert guarded.ravel()[along].mean() == (0.0 if gutter else 1.0)
        assert steps.max() < (1.0 if gutter else 3.0)
        assert guarded.sum() >= 4 * N - 1, "the sheet's border is guarded as before"
        tears = find_tears(scan, cuts, steps)
        assert not tears.islands.any() and not tears.heights.any()


def test_an_island_of_another_colour_is_torn_with_its_edges(atlas):
    scan, island, _ = atlas(wrong=40.0)
    looks = ScanLooks(scan)
    cuts = find_cuts(looks)
    tears = find_tears(scan, cuts, guarded_edges(looks, cuts)[1])
    np.testing.assert_array_equal(tears.islands, island)
    faces = np.arange(len(scan.faces))
    for height, beside in ((0.5 * SEAM_MM, True), (1.5 * SEAM_MM, False)):
        for edge in range(3):
            torn = tears.heights[:, edge] > 0
            assert torn.sum() >= 1
            barycentric = np.full((len(faces), 3), 0.0)
            away = height / np.maximum(tears.heights[:, edge], 1e-9)
            barycentric[:, (edge + 2) % 3] = away
            barycentric[:, edge] = barycentric[:, (edge + 1) % 3] = 0.5 * (1 - away)
            lone = torn & ((tears.heights > 0).sum(axis=1) == 1)
            assert (tears.beside(faces[lone], barycentric[lone]) == beside).all()
    whole = ~(tears.heights > 0).any(axis=1)
    assert not tears.beside(faces[whole], np.full((whole.sum(), 3), 1 / 3)).any()


def test_without_a_texture_nothing_is_cut(sheet):
    vertices, faces = sheet(4)
    looks = ScanLooks(Scan(vertices, faces))
    cuts = find_cuts(looks)
    guarded, steps = guarded_edges(looks, cuts)
    tears = find_tears(looks.scan, cuts, steps)
    assert not len(cuts.here) and not tears.islands.any() and not tears.heights.any() and len(guarded) == len(faces)
