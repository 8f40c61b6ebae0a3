"""The generated test sets: same bytes every time, noise of the size asked for, wrinkles that expressions share."""

import numpy as np

from facewright.compress.masks import covered_texels
from facewright.compress.synthetic import expression_set


def test_a_set_is_the_same_every_time_and_another_with_another_seed():
    one, again, other = expression_set(64, 3), expression_set(64, 3), expression_set(64, 3, seed=1)
    assert all((a == b).all() for a, b in zip(one.textures, again.textures))
    assert (one.neutral != other.neutral).any()


def test_noise_is_what_was_asked_for():
    made = expression_set(128, 2, noise=3.0)
    left = made.textures[0][made.covered] - made.truth[0][made.covered]
    assert 2.8 < left.std() < 3.2 and abs(left.mean()) < 0.1
    assert (expression_set(64, 1, noise=0.0).textures[0] == np.rint(expression_set(64, 1).truth[0])).mean() > 0.999


def test_the_mesh_covers_what_the_set_says():
    made = expression_set((60, 90), 1)
    covered = covered_texels(made.mesh.uv, made.mesh.uv_faces, 60, 90)
    assert (covered != made.covered).mean() < 0.02


def test_wrinkles_are_local_and_shared():
    made = expression_set(128, 30, noise=0.0)
    x = np.stack(made.truth) - made.truth[0]
    local = np.linalg.matrix_rank(x[:, 60:68, 60:68].reshape(30, -1), tol=5.0)
    whole = np.linalg.matrix_rank(x.reshape(30, -1), tol=5.0)
    assert local < 12 < whole
