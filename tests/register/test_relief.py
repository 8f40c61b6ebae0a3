"""Eyes of clay heads whose lids are known, and a model that stands a little beside them."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.data import Scan
from facewright.mesh.normals import vertex_normals
from facewright.register.model import ModelFit
from facewright.register.relief import lid_reliefs

ASIDE = np.array([0.5, 1.2, -1.0])


def person(template, seed=4, scale=0.6):
    amounts = np.random.default_rng(seed).normal(size=len(template.identity_basis)) * scale
    return template.vertices + np.tensordot(amounts, template.identity_basis, 1)


def clay(template, vertices):
    """Outer skin and eyeballs of a head as one cloth without colours."""
    keep = np.zeros(len(template.faces), bool)
    keep[template.skin.face_slice] = template.regions["outer"][template.faces[template.skin.face_slice]].all(axis=1)
    for name in ("eye_left", "eye_right"):
        keep[template.part(name).face_slice] = True
    return Scan(vertices=vertices, faces=template.faces[keep])


def standing_at(vertices):
    return ModelFit(vertices, vertices, np.zeros(0), np.zeros(0), np.eye(4), 0.0)


def blinking(template, vertices, left, right):
    return vertices + left * template.shape("eyeBlinkLeft") + right * template.shape("eyeBlinkRight")


def off_by_mm(template, truth, borders, side):
    """Mean distance in height of both borders from the true lids."""
    result = []
    for which, border in zip(("upper", "lower"), borders):
        line = truth[template.lines[f"lid_{which}_{side}"]]
        line = line[np.argsort(line[:, 0])]
        result.append(np.abs(border.points[:, 1] - np.interp(border.points[:, 0], *line[:, :2].T)).mean())
    return np.mean(result)


@pytest.mark.parametrize("weight", [-0.2, 0.0, 0.3])
def test_open_eyes_are_open_and_their_lids_are_found(hm08, weight):
    truth = blinking(hm08, person(hm08), weight, weight)
    for side, relief in lid_reliefs(clay(hm08, truth), hm08, standing_at(person(hm08) + ASIDE)).items():
        assert relief.openness > 0.1
        assert off_by_mm(hm08, truth, relief.borders, side) < 0.4


def test_the_ends_of_lids_lead_from_the_eye_s_corners_to_the_border(hm08):
    truth = person(hm08, seed=7)
    for side, relief in lid_reliefs(clay(hm08, truth), hm08, standing_at(person(hm08) + ASIDE)).items():
        for which, border in zip(("upper", "lower"), relief.borders):
            line = hm08.lines[f"lid_{which}_{side}"]
            places, points = border.ends
            assert {0, len(line) - 1} <= set(places.tolist())
            x = border.points[[0, -1], 0]
            assert not ((points[:, 0] > x[0]) & (points[:, 0] < x[1])).any()
            for end, beside in ((border.points[0], points[:, 0] < x[0]), (border.points[-1], points[:, 0] > x[1])):
                nearest = points[beside][np.abs(points[beside, 0] - end[0]).argmin()]
                assert np.abs(nearest[1] - end[1]) < np.abs(nearest[0] - end[0]) + 0.1
            corners = np.isin(places, (0, len(line) - 1))
            off = points[corners] - truth[line[places[corners]]]
            assert np.linalg.norm(off[:, :2], axis=1).mean() < 0.5


def test_lids_of_another_person_s_eyes_are_found(hm08):
    truth = person(hm08, seed=7)
    for side, relief in lid_reliefs(clay(hm08, truth), hm08, standing_at(person(hm08))).items():
        assert relief.openness > 0.1
        assert off_by_mm(hm08, truth, relief.borders, side) < 1.0


def test_shut_eyes_are_shut(hm08):
    shut = clay(hm08, blinking(hm08, person(hm08), 1.0, 1.0))
    for relief in lid_reliefs(shut, hm08, standing_at(person(hm08) + ASIDE)).values():
        assert relief.openness < -0.1


def test_an_eye_that_winks_is_told_from_the_other(hm08):
    winking = clay(hm08, blinking(hm08, person(hm08), 0.0, 1.0))
    reliefs = lid_reliefs(winking, hm08, standing_at(person(hm08) + ASIDE))
    assert reliefs["left"].openness > 0.1 > -0.1 > reliefs["right"].openness


def test_a_scanner_s_noise_matters_little(hm08):
    truth = person(hm08)
    normals = vertex_normals(truth, hm08.faces)
    noisy = truth + np.random.default_rng(0).normal(0, 0.15, len(truth))[:, None] * normals
    for side, relief in lid_reliefs(clay(hm08, noisy), hm08, standing_at(truth + ASIDE)).items():
        assert relief.openness > 0.1
        assert off_by_mm(hm08, truth, relief.borders, side) < 0.4


def test_a_flat_face_says_nothing_of_lids(hm08):
    truth = person(hm08)
    flat = clay(hm08, truth * [1.0, 1.0, 0.0] + [0.0, 0.0, 10.0])
    for relief in lid_reliefs(flat, hm08, standing_at(truth)).values():
        assert relief.borders == (None, None)
        assert abs(relief.openness) < 0.05


def test_nothing_depends_on_where_the_head_s_vertices_are_listed(hm08):
    truth = person(hm08)
    scan = clay(hm08, truth)
    order = np.random.default_rng(1).permutation(len(scan.faces))
    model = standing_at(truth + ASIDE)
    one, other = (lid_reliefs(s, hm08, model) for s in (scan, replace(scan, faces=scan.faces[order])))
    for side in one:
        assert np.isclose(one[side].openness, other[side].openness, atol=1e-6)
