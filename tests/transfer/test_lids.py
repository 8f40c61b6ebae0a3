"""Lids stay out of the eyeball, and nothing changes where the template needs no help."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.parts import fit_parts
from facewright.parts.eyes import fit_lids, moved_to
from facewright.transfer.eyeball import carried_eyeball, lid_clearance, measure_eyeball
from facewright.transfer.lids import clear_lids
from facewright.transfer.shapes import TransferOptions, transfer_shapes


@pytest.fixture(scope="module")
def bulging(hm08, hm08_person):
    """A person whose left eye stands 1.5 mm farther out than most, and whose lids are fitted to it."""
    face = fit_parts(hm08_person(4))
    ball = carried_eyeball(hm08, face.vertices, "left")
    ball = replace(ball, center=ball.center + [0, 0, 1.5])
    V, _ = fit_lids(hm08, face.vertices, face.regions, face.lines, "left", ball)
    for name, placed in moved_to(hm08, "left", ball).items():
        V[hm08.part(name).vertex_slice] = placed
    return replace(face, vertices=V)


def lid_skin(face, side):
    near = np.linalg.norm(face.vertices - carried_eyeball(face.template, face.vertices, side).center, axis=1) < 20
    return np.flatnonzero(face.regions["eyes"] & near & ~face.regions[f"socket_{side}"])


def test_nothing_changes_on_the_template(hm08, hm08_person):
    face = replace(hm08_person(0), vertices=hm08.vertices)
    assert np.abs(clear_lids(face, hm08.deltas) - hm08.deltas).max() < 1e-9


def test_a_blink_clears_a_bulging_eye(hm08, bulging):
    plain = transfer_shapes(bulging, TransferOptions(contact=None))
    clear = transfer_shapes(bulging)
    k = hm08.shape_names.index("eyeBlinkLeft")
    ball, at = carried_eyeball(hm08, bulging.vertices, "left"), lid_skin(bulging, "left")
    before, after = (ball.gap(bulging.vertices[at] + shapes[k, at]).min() for shapes in (plain, clear))
    assert after >= before and after > -0.05


def test_shapes_that_hardly_move_the_lids_are_hardly_touched(hm08, bulging):
    plain = transfer_shapes(bulging, TransferOptions(contact=None))
    changed = np.abs(clear_lids(bulging, plain) - plain).max(axis=(1, 2))
    assert changed[hm08.shape_names.index("eyeBlinkLeft")] > 0.1
    assert changed[hm08.shape_names.index("tongueOut")] < 1e-3
    for name in ("jawOpen", "mouthFunnel", "mouthSmileLeft"):
        assert changed[hm08.shape_names.index(name)] < 0.2, name


def test_clearance_grows_from_the_margin():
    margin = np.array([[0.0, 0, 0], [1, 0, 0]])
    points = np.array([[0.0, 0, 0], [0, 1, 0], [0, 10, 0]])
    assert np.allclose(lid_clearance(points, margin, 0.15, 0.8), [0.15, 0.45, 0.8])


def test_the_carried_eyeball_is_the_one_in_the_vertices(hm08):
    V = 1.1 * hm08.vertices + [1, 2, 3]
    own, carried = measure_eyeball(hm08, "right"), carried_eyeball(hm08, V, "right")
    assert np.allclose(carried.center, 1.1 * own.center + [1, 2, 3]) and carried.radius == pytest.approx(13.2)
    assert np.allclose(carried.axis, own.axis) and np.allclose(carried.surface.radii, 1.1 * own.surface.radii)
