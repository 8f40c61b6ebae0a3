"""Deformation transfer: exact onto itself, indifferent to rigid motion and reflection, and right by a dense oracle."""

import numpy as np
import pytest

from facewright.transfer.deformation import (
    DeformationTransfer,
    Links,
    deformation_transfer,
    nearest_links,
)

MIRROR = np.array([-1.0, 1.0, 1.0])


def sheet(rows=9, columns=11):
    """A curved sheet of triangles, 20 mm wide, without symmetry."""
    x, y = np.meshgrid(np.linspace(-10, 10, columns), np.linspace(-8, 8, rows))
    z = 5 * np.exp(-((x - 2) ** 2 + y**2) / 40) + 0.1 * x * y / 8
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def rotation(axis, degrees):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.cross(np.eye(3), axis)
    angle = np.radians(degrees)
    return np.eye(3) - np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def heads():
    """A source, a target of another shape and size, faces, held vertices and two large shapes."""
    source, faces = sheet()
    x, y, z = source.T
    target = np.stack([1.3 * x + 0.2 * y, 1.1 * y + 0.3 * np.sin(x / 3), 1.5 * z + 0.02 * x**2], axis=1)
    fixed = y < -7
    height = np.clip(y + 7, 0, None)[:, None] / 15
    bend = (source - [0, -7, 0]) @ rotation([1, 0.2, 0], 35).T + [0, -7, 0] - source
    deltas = np.stack([height * bend, height**2 * np.stack([np.sin(y), np.cos(x / 2), x / 4], axis=1)])
    deltas[:, fixed] = 0
    return source, target, faces, fixed, deltas


def test_onto_itself_is_exact():
    source, _, faces, fixed, deltas = heads()
    assert np.abs(deformation_transfer(source, source, faces, deltas, fixed=fixed) - deltas).max() < 1e-8


def test_inputs_are_not_changed_and_the_held_vertices_stay():
    source, target, faces, fixed, deltas = heads()
    before = source.copy(), target.copy(), deltas.copy()
    result = deformation_transfer(source, target, faces, deltas, fixed=fixed)
    assert all(np.array_equal(a, b) for a, b in zip(before, (source, target, deltas)))
    assert not result[:, fixed].any() and result[:, ~fixed].any()


@pytest.mark.parametrize("head", ["source", "target"])
def test_rigid_motion_commutes(head):
    source, target, faces, fixed, deltas = heads()
    result = deformation_transfer(source, target, faces, deltas, fixed=fixed)
    R, t = rotation([1, 2, 3], 130), np.array([100.0, -40, 7])
    if head == "source":
        moved = deformation_transfer(source @ R.T + t, target, faces, deltas @ R.T, fixed=fixed)
        assert np.abs(moved - result).max() < 1e-8
    else:
        moved = deformation_transfer(source, target @ R.T + t, faces, deltas, fixed=fixed)
        assert np.abs(moved - result @ R.T).max() < 1e-8


def test_a_mirrored_head_gives_the_mirrored_rig():
    source, target, faces, fixed, deltas = heads()
    result = deformation_transfer(source, target, faces, deltas, fixed=fixed)
    mirrored = deformation_transfer(
        source * MIRROR, target * MIRROR, faces[:, ::-1].copy(), deltas * MIRROR, fixed=fixed
    )
    assert np.abs(mirrored - result * MIRROR).max() < 1e-8


def test_left_stays_left():
    source, target, faces, _, _ = heads()
    left = (source[:, 0] > 4) & (np.abs(source[:, 1]) < 5)
    deltas = np.where(left[:, None], [0.0, 0, 3], 0.0)[None]
    result = deformation_transfer(source, target, faces, deltas)
    moved = np.linalg.norm(result[0], axis=1) > 0.5
    assert moved.any() and (source[moved, 0] > 0).all()


def test_size_scales_the_motion():
    source, target, faces, fixed, deltas = heads()
    result = deformation_transfer(source, target, faces, deltas, fixed=fixed)
    assert np.allclose(deformation_transfer(source, 2 * target, faces, deltas, fixed=fixed), 2 * result, atol=1e-9)
    assert np.allclose(deformation_transfer(3 * source, target, faces, 3 * deltas, fixed=fixed), result, atol=1e-9)


def test_an_affine_motion_stays_that_affine_motion():
    """Whatever the triangles: if every source triangle shears alike, so does the target."""
    source, target, faces, _, _ = heads()
    source, target = source * [1, 1, 0], target * [1, 1, 0]
    fixed = np.arange(len(source)) == 0
    A = np.array([[0.1, 0.2, 0], [-0.05, -0.1, 0], [0, 0, 0]])
    transfer = DeformationTransfer(source, target, faces, fixed=fixed)
    R = transfer.rotation
    result = transfer.transfer(((source - source[0]) @ A.T)[None])[0]
    assert np.allclose(result, (target - target[0]) @ (R @ A @ R.T).T, atol=1e-9)


def dense_oracle(source, target, faces, fixed, delta):
    """The same energy by dense least squares over explicit edge vectors, source already aligned with target."""
    n, rows, rhs = len(source), [], []
    for a, b, c in faces:
        frames = []
        for V in (source, source + delta):
            e1, e2 = V[b] - V[a], V[c] - V[a]
            normal = np.cross(e1, e2)
            frames.append(np.stack([e1, e2, normal / np.linalg.norm(normal)], axis=1))
        S = frames[1] @ np.linalg.inv(frames[0])
        for i, j, k in ((a, b, c), (b, c, a), (c, a, b)):
            u, v = target[i] - target[k], target[j] - target[k]
            weight = 0.5 * (u @ v) / np.linalg.norm(np.cross(u, v))
            rows.append((i, j, weight))
            rhs.append((S - np.eye(3)) @ (target[j] - target[i]))
    A, B = np.zeros((n, n)), np.zeros((n, 3))
    for (i, j, weight), wanted in zip(rows, rhs):
        A[[i, j], [i, j]] += weight
        A[i, j] -= weight
        A[j, i] -= weight
        B[j] += weight * wanted
        B[i] -= weight * wanted
    result = np.zeros((n, 3))
    free = ~fixed
    result[free] = np.linalg.solve(A[np.ix_(free, free)], B[free])
    return result


def test_agrees_with_a_dense_solve():
    source, target, faces, fixed, deltas = heads()
    transfer = DeformationTransfer(source, target, faces, fixed=fixed)
    R = transfer.rotation
    expected = dense_oracle(source @ R.T, target, faces, fixed, deltas[0] @ R.T)
    assert np.abs(transfer.transfer(deltas)[0] - expected).max() < 1e-9


def test_shapes_do_not_influence_each_other():
    source, target, faces, fixed, deltas = heads()
    transfer = DeformationTransfer(source, target, faces, fixed=fixed)
    both = transfer.transfer(deltas)
    assert np.allclose(transfer.transfer(deltas[1:])[0], both[1], atol=1e-12)


def test_held_vertices_move_as_told_and_take_the_rest_along():
    source, target, faces, fixed, deltas = heads()
    transfer = DeformationTransfer(source, target, faces, fixed=fixed)
    shift = np.broadcast_to([1.0, 2, 3], target.shape)[None]
    moved = transfer.transfer(deltas[:1], held=shift)
    assert np.allclose(moved, transfer.transfer(deltas[:1]) + shift, atol=1e-9)


def test_faces_count_by_their_weights():
    """Twice the faces at half the weight are the same faces; a face of no weight is not there."""
    source, target, faces, fixed, deltas = heads()
    plain = DeformationTransfer(source, target, faces, fixed=fixed)
    twice = DeformationTransfer(
        source, target, np.vstack([faces, faces]), fixed=fixed, face_weights=np.full(2 * len(faces), 0.5)
    )
    assert np.allclose(twice.transfer(deltas), plain.transfer(deltas), atol=1e-9)


def with_lash(source, faces):
    """A loose strip of triangles 0.3 mm above the sheet."""
    strip = np.array([[2.0 * i, 6 + (i % 2), 3.0] for i in range(4)])
    n = len(source)
    return np.vstack([source, strip]), np.vstack([faces, [[n, n + 2, n + 1], [n + 1, n + 2, n + 3]]])


def test_a_loose_component_follows_its_neighbours():
    source, target, faces, fixed, _ = heads()
    V, F = with_lash(source, faces)
    held = np.append(fixed, np.zeros(4, bool))
    lift = np.clip(V[:, 1] + 7, 0, None)[:, None] * [0, 0, 0.2]
    links = nearest_links(V, F, held)
    assert set(links.pairs[:, 0]) == {99, 100, 101, 102} and (links.pairs[:, 1] < 99).all()
    result = deformation_transfer(V, V, F, lift[None], fixed=held)
    assert np.abs(result - lift).max() < 1e-8
    W = np.vstack([target, V[99:] * [1.3, 1.1, 1.5]])
    result = deformation_transfer(V, W, F, lift[None], fixed=held)[0]
    near = result[links.pairs[:, 1]]
    assert np.linalg.norm(result[99:] - near, axis=1).max() < 0.35 * np.linalg.norm(near, axis=1).max()


def test_links_close_a_gap_that_closes_on_the_source():
    """Two sheets that meet in the source must meet in a target whose gap is wider."""
    one, faces = sheet(5, 6)
    n = len(one)
    source = np.vstack([one * [1, 1, 0] + [0, 10, 0], one * [1, 1, 0] - [0, 10, 0]])
    target = source + np.where(np.arange(2 * n)[:, None] < n, [0, 1.5, 0], [0, -1.5, 0])
    both = np.vstack([faces, faces + n])
    fixed = np.abs(source[:, 1]) > 17
    closing = -source * [0, 1, 0] * np.clip(1 - (np.abs(source[:, 1:2]) - 2) / 15, 0, 1)
    closing[fixed] = 0
    pairs = np.stack([np.arange(6), np.arange(2 * n - 6, 2 * n)], axis=1)
    gap = {}
    for weight in (0.0, 100.0):
        links = Links(pairs, np.full(6, weight))
        moved = target + deformation_transfer(source, target, both, closing[None], fixed=fixed, links=(links,))[0]
        gap[weight] = np.linalg.norm(moved[pairs[:, 0]] - moved[pairs[:, 1]], axis=1).max()
    assert gap[0.0] > 2.9 and gap[100.0] < 0.2


def test_a_source_triangle_without_area_does_no_harm():
    source, target, faces, fixed, deltas = heads()
    source = source.copy()
    source[60] = source[61]
    result = deformation_transfer(source, target, faces, deltas, fixed=fixed)
    assert np.isfinite(result).all() and np.abs(result).max() < 3 * np.abs(deltas).max()
    assert np.abs(deformation_transfer(source, source, faces, deltas, fixed=fixed) - deltas).max() < 1e-8


def test_misuse_is_refused():
    source, target, faces, fixed, deltas = heads()
    with pytest.raises(ValueError, match="one topology"):
        deformation_transfer(source, target[:-1], faces, deltas, fixed=fixed)
    with pytest.raises(ValueError, match="at least one vertex"):
        deformation_transfer(source, target, faces, deltas, fixed=np.zeros(len(source), bool))
    with pytest.raises(ValueError, match="deltas: expected"):
        DeformationTransfer(source, target, faces, fixed=fixed).transfer(deltas[0])
    with pytest.raises(ValueError, match="faces: expected"):
        deformation_transfer(source, target, faces + 1, deltas, fixed=fixed)
