"""Parts follow the person: similar heads give similar parts, teeth stay out of the lips."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.parts import fit_parts, fit_skeleton
from facewright.transfer.eyeball import measure_eyeball


@pytest.fixture(scope="module")
def person(hm08_person):
    return fit_parts(hm08_person(3))


def test_a_moved_and_scaled_template_takes_its_parts_along(hm08, hm08_person):
    face = replace(hm08_person(0), vertices=1.05 * hm08.vertices + [3, 4, 5])
    fitted = fit_parts(face)
    for name in ("teeth_upper", "teeth_lower", "tongue"):
        part = hm08.part(name).vertex_slice
        assert np.abs(fitted.vertices[part] - face.vertices[part]).max() < 0.6, name
    part = hm08.part("eye_left").vertex_slice
    assert np.abs(fitted.vertices[part] - face.vertices[part]).max() < 0.7
    assert abs(fitted.stats["parts"]["mouth"]["scale"] - 1.05) < 1e-3


def test_only_parts_and_lids_change(hm08, hm08_person, person):
    before = hm08_person(3)
    moved = np.linalg.norm(person.vertices - before.vertices, axis=1)
    skin = hm08.regions["skin"]
    lids = before.regions["eyes"] | before.regions["socket_left"] | before.regions["socket_right"]
    assert not moved[skin & ~lids].any() and np.array_equal(person.fit, before.fit)
    assert before.vertices.flags.writeable is False


def test_stats_say_what_was_done(person):
    stats = person.stats["parts"]
    assert set(stats) == {"eye_left", "eye_right", "mouth"}
    assert 11 <= stats["eye_left"]["radius_mm"] <= 13
    assert 0.85 <= stats["mouth"]["scale"] <= 1.2 and stats["mouth"]["seen_from_front_share"] < 0.05


def test_the_bite_stays_as_it_is(hm08, person):
    gaps = []
    for V in (hm08.vertices, person.vertices):
        upper, lower = V[hm08.part("teeth_upper").vertex_slice], V[hm08.part("teeth_lower").vertex_slice]
        gaps.append(np.linalg.norm(upper.mean(axis=0) - lower.mean(axis=0)))
    assert abs(gaps[1] / gaps[0] - person.stats["parts"]["mouth"]["scale"]) < 1e-6


def test_joints_follow(hm08, person):
    own = fit_skeleton(hm08, hm08.vertices)
    assert np.allclose(own.positions, hm08.skeleton.positions, atol=1e-6)
    skeleton = fit_skeleton(hm08, person.vertices)
    eye = skeleton.positions[skeleton.names.index("eye_left")]
    assert np.allclose(eye, person.stats["parts"]["eye_left"]["center_mm"], atol=1e-6)
    assert np.linalg.norm(skeleton.positions - hm08.skeleton.positions, axis=1).max() < 40
    shifted = fit_skeleton(hm08, hm08.vertices + [1, 2, 3])
    assert np.allclose(shifted.positions, hm08.skeleton.positions + [1, 2, 3], atol=1e-6)


def test_what_hangs_on_the_skin_follows_it(hm08, hm08_person):
    """A loose strip made of the tongue's vertices, said to hang on the skin, stays with the skin beside it."""
    parts = tuple(replace(part, attach="skin") if part.name == "tongue" else part for part in hm08.parts)
    face = replace(hm08_person(1), template=replace(hm08, parts=parts))
    shifted = replace(face, vertices=hm08.vertices + np.where(hm08.regions["skin"][:, None], [2.0, 0, 1], 0))
    at = hm08.part("tongue").vertex_slice
    assert np.allclose(fit_parts(shifted).vertices[at], hm08.vertices[at] + [2, 0, 1], atol=0.3)


def test_same_person_same_parts(person, hm08_person):
    assert np.array_equal(fit_parts(hm08_person(3)).vertices, person.vertices)


def test_the_eye_of_the_rig_is_the_ball_that_was_placed(hm08, person):
    stats = person.stats["parts"]["eye_right"]
    part = hm08.part("eye_right").vertex_slice
    distance = np.linalg.norm(person.vertices[part] - stats["center_mm"], axis=1)
    assert np.median(distance) == pytest.approx(stats["radius_mm"], rel=0.03)
    assert measure_eyeball(hm08, "right").radius == pytest.approx(12.0, abs=0.01)
