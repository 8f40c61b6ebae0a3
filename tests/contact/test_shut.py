"""A slit between two bars is found, however they slide, and shut."""

import numpy as np
import pytest

from facewright.contact.shut import LipSlit


def sheet(y, step, rows=7):
    """Vertices and faces of a flat lip that begins at y and goes up or down in steps."""
    x, row = np.meshgrid(np.arange(-20.0, 21.0), np.arange(rows))
    vertices = np.stack([x, y + step * row, 0 * x], axis=-1).reshape(-1, 3)
    at = np.arange(x.size).reshape(x.shape)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return vertices, faces if step > 0 else faces[:, ::-1]


@pytest.fixture
def slit():
    (upper, faces), (lower, others) = sheet(0.0, 1.0), sheet(0.0, -1.0)
    n, seam = len(upper), np.arange(41)
    V, lower_faces = np.concatenate([upper, lower]), others + n
    everywhere = np.ones(len(V), bool)
    faces = np.concatenate([faces, lower_faces])
    patches = [faces[: len(lower_faces)], lower_faces]
    return V, LipSlit(V, faces, patches, [seam, seam + n], everywhere, everywhere), n


def test_lips_that_touch_have_no_slit(slit):
    V, lips, _ = slit
    assert max(np.abs(gap[1:-1]).max() for gap in lips.gaps(V)) < 1e-9
    assert not lips.shut(V).any()


def test_what_slides_along_stays_shut_and_what_opens_is_shut(slit):
    V, lips, n = slit
    slid = V.copy()
    slid[n:] += [5.0, 0.0, 0.0]
    assert not lips.shut(slid).any()
    ahead = V.copy()
    ahead[n:, 2] += 9.0  # seen from above or below it would be open
    assert 0.2 < max(gap.max() for gap in lips.gaps(ahead)) < 1.0
    assert max(gap[5:-5].max() for gap in lips.gaps(ahead + lips.shut(ahead))) < 0.2
    opened = V.copy()
    opened[n:, 1] -= 2.0 * np.cos(V[n:, 0] * np.pi / 40)
    assert max(gap.max() for gap in lips.gaps(opened)) == pytest.approx(2.0, rel=0.01)
    field = lips.shut(opened)
    inner = np.abs(V[lips.seams[0][1:-1], 0]) < 17
    assert max(gap[inner].max() for gap in lips.gaps(opened + field)) < 0.2
    assert np.abs(field[:, [0, 2]]).max() < 1e-9


def test_a_slit_of_the_neutral_may_stay():
    upper, faces = sheet(1.0, 1.0)
    lower, others = sheet(0.0, -1.0)
    V, n, seam = np.concatenate([upper, lower]), len(upper), np.arange(41)
    everywhere, both = np.ones(2 * n, bool), np.concatenate([faces, others + n])
    lips = LipSlit(V, both, [faces, others + n], [seam, seam + n], everywhere, everywhere)
    assert not lips.shut(V).any()


def test_next_to_a_corner_nothing_is_a_slit(slit):
    V, lips, n = slit
    opened = V.copy()
    opened[n:, 1] -= 0.5
    for gap in lips.gaps(opened):
        assert np.isneginf(gap[[0, -1]]).all()
        assert np.isfinite(gap[1:-1]).all()


def test_lips_that_a_pose_crowds_into_a_corner_have_no_slit_there(slit):
    V, lips, n = slit
    crowded = V.copy()
    near = V[:, 0] > 14.0
    crowded[near, 0] = 19.5 + (V[near, 0] - 14.0) / 12.0
    crowded[near & (np.arange(len(V)) >= n), 1] -= 1.0
    for gap in lips.gaps(crowded):
        assert np.isneginf(gap[V[1:40, 0] > 14.0]).all()
    assert not lips.shut(crowded).any()


def test_lips_that_cover_each_other_are_drawn_apart_but_for_what_is_meant(slit):
    V, lips, n = slit
    lapped = V.copy()
    lapped[n:, 1] += 1.0
    moved = lapped + lips.shut(lapped, lifted=True)
    gap = np.concatenate([gap[5:-5] for gap in lips.gaps(moved)])
    assert np.abs(gap + lips.options.lap_mm).max() < 0.15
