"""Misaligned textures: a known warp is found and undone; wrinkles alone are none."""

import numpy as np
import pytest

from facewright.compress.synthetic import expression_set

cv2 = pytest.importorskip("cv2")
from facewright.compress.align import align_texture, measure_shift  # noqa: E402


@pytest.fixture(scope="module")
def made():
    return expression_set(512, 3)


def warped(image, x, y):
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float32)
    return cv2.remap(image, columns - x, rows - y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def test_aligned_textures_are_left_alone(made):
    for texture in made.textures:
        assert not measure_shift(made.neutral, texture, made.covered).misaligned


def test_a_known_warp_is_found_and_undone(made):
    rows, columns = np.mgrid[:512, :512].astype(np.float32)
    x, y = 3 * np.sin(rows / 80), 2 * np.cos(columns / 100)
    moved = warped(made.textures[1], x, y)
    shift = measure_shift(made.neutral, moved, made.covered)
    assert shift.misaligned
    error = np.hypot(shift.flow[..., 0] - x, shift.flow[..., 1] - y)[made.covered]
    assert np.median(error) < 0.3
    wanted, back = made.textures[1].astype(float), align_texture(moved, shift).astype(float)
    before, after = (np.sqrt(np.mean((image - wanted)[made.covered] ** 2)) for image in (moved, back))
    assert after < 0.5 * before


def test_wrinkles_on_a_surface_without_detail_are_no_shift():
    rng = np.random.default_rng(2)
    y, x = np.mgrid[:200, :300]
    smooth = cv2.GaussianBlur(rng.standard_normal((200, 300)), (0, 0), 9)
    neutral = 32768 + 2000 * smooth / smooth.std()
    covered = np.ones((200, 300), bool)
    for _ in range(4):
        (cy, cx), turn = rng.uniform(50, 150, 2), rng.uniform(0, np.pi)
        bump = np.exp(-((y - cy) ** 2 / 1800 + (x - cx) ** 2 / 3200))
        wrinkled = neutral + 3000 * bump * np.sin(0.4 * (np.cos(turn) * x + np.sin(turn) * y))
        images = (np.rint(image).astype(np.uint16)[:, :, None] for image in (neutral, wrinkled))
        assert not measure_shift(*images, covered).misaligned


def test_nothing_covered_is_no_shift(made):
    assert not measure_shift(made.neutral, made.textures[0], np.zeros((512, 512), bool)).misaligned
