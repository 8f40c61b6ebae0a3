"""Ears larger, smaller and elsewhere than the model's are found as a whole; what hides them leaves them alone."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from facewright.mesh.laplacian import uniform_laplacian
from facewright.mesh.normals import vertex_normals
from facewright.register.correspond import Target
from facewright.register.ears import EarOptions, ear_motion, hidden_ears
from facewright.solve.quadratic import Factorization


@pytest.fixture(scope="module")
def head(hm08):
    n = hm08.skin.vertices[1]
    ears = [hm08.regions[f"ear_{side}"][:n] for side in ("left", "right")]
    return hm08.vertices[:n], hm08.faces[hm08.skin.face_slice], ears


def with_other_ears(V, ears, scale, shift):
    """Vertices whose ears are scaled about their own centre (by one factor or one an axis) and shifted outwards, the
    head around following.
    """
    moved = V.copy()
    for ear, sign in zip(ears, (1.0, -1.0)):
        center = V[ear].mean(axis=0)
        share = np.clip(1.0 - cKDTree(V[ear]).query(V)[0] / 15.0, 0.0, 1.0)[:, None]
        moved += share * ((np.array(scale) - 1.0) * (V - center) + np.array(shift) * [sign, 1.0, 1.0])
    return moved


def without_ear(V, F, ear):
    """Vertices of a skin whose ear (n,) bool is a membrane over the hole that it would leave."""
    head, rows = V.copy(), uniform_laplacian(F, len(V)).tocsr()[np.flatnonzero(ear)]
    head[ear] = Factorization(rows[:, ear]).solve(-(rows[:, ~ear] @ V[~ear]))
    return head


def with_tufts(V, F, ears, ball_scan):
    """The Target of a skin with a tuft as large as an ear, standing out beside each of its ears."""
    tufts, faces = V.copy(), [F]
    for ear in ears:
        tuft, sign = ball_scan(None, k=12, radius=18.0), np.sign(V[ear, 0].mean())
        faces.append(tuft.faces + len(tufts))
        tufts = np.concatenate(
            [tufts, tuft.vertices * [0.5, 1.4, 1.0] + V[ear].mean(axis=0) + [sign * 4.0, 24.0, -14.0]]
        )
    return Target(tufts, np.concatenate(faces))


@pytest.mark.parametrize(
    "scale, shift",
    [(1.3, (0.0, 3.0, -2.0)), (0.8, (0.0, -2.0, 0.0)), (1.0, (0.0, 7.0, -5.0)), (1.0, (0.0, -12.0, 8.0))],
)
def test_other_ears_are_found(head, scale, shift):
    V, F, ears = head
    scan = with_other_ears(V, ears, scale, shift)
    moved = V + ear_motion(V, F, ears, Target(scan, F))
    for ear in ears:
        before, after = (np.linalg.norm((x - scan)[ear], axis=1).mean() for x in (V, moved))
        assert after < 0.4 * before


def test_ears_are_found_whose_backs_no_scanner_saw(head):
    V, F, ears = head
    scan = with_other_ears(V, ears, 1.0, (0.0, 12.0, -9.0))
    normals = vertex_normals(scan, F)
    unseen = np.any(ears, axis=0) & (normals[:, 0] * np.sign(V[:, 0]) < 0.0)
    moved = V + ear_motion(V, F, ears, Target(scan, F[~unseen[F].any(axis=1)]))
    for ear in ears:
        before, after = (np.linalg.norm((x - scan)[ear], axis=1).mean() for x in (V, moved))
        assert after < 0.4 * before


def test_an_ear_beside_hair_is_found(head, ball_scan):
    V, F, ears = head
    scan = with_other_ears(V, ears, 1.0, (0.0, 12.0, -9.0))
    target = with_tufts(scan, F, ears, ball_scan)
    moved = V + ear_motion(V, F, ears, target)
    for ear in ears:
        before, after = (np.linalg.norm((x - scan)[ear], axis=1).mean() for x in (V, moved))
        assert after < 0.4 * before


def test_narrow_ears_of_a_child_are_found(head):
    V, F, ears = head
    scan = with_other_ears(V, ears, (1.0, 0.95, 0.7), (0.0, 4.0, 3.0))
    target = Target(scan, F)
    moved = V + ear_motion(V, F, ears, target)
    scaled_only = V + ear_motion(V, F, ears, target, EarOptions(hold=1e6))
    for ear in ears:
        before, scaled, after = (np.linalg.norm((x - scan)[ear], axis=1).mean() for x in (V, scaled_only, moved))
        assert after < 0.4 * before
        assert after < 0.8 * scaled
    assert not hidden_ears(moved, F, ears, target).any()


def test_what_shows_no_ear_hides_it(head):
    V, F, (left, right) = head
    bare = without_ear(V, F, left)
    hidden = hidden_ears(V, F, (left, right), Target(bare, F))
    np.testing.assert_array_equal(hidden, left)


def test_ears_that_fit_and_ears_that_are_hidden_stay(head):
    V, F, ears = head
    assert not ear_motion(V, F, ears, Target(V, F)).any()
    bare = V.copy()
    for ear in ears:
        bare = without_ear(bare, F, ear)
    assert not ear_motion(V, F, ears, Target(bare, F)).any()


def test_hair_beside_an_ear_that_fits_does_not_lead_it_away(head, ball_scan):
    V, F, ears = head
    target = with_tufts(V, F, ears, ball_scan)
    assert not ear_motion(V, F, ears, target).any()
