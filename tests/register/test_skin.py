"""The skin drawn to a scan: it takes up what the model lacks, and does not slide."""

import numpy as np

from facewright.mesh.closest import Surface
from facewright.mesh.normals import vertex_normals
from facewright.register.correspond import Samples, Target
from facewright.register.lids import Border
from facewright.register.register import LEVELS
from facewright.register.skin import aside_rows, border_rows, fit_skin, skin_rules, welts


def test_what_the_model_lacks_is_taken_up_along_the_normal(hm08):
    """A scan of the model's own head with a swelling and noise: the skin follows it, its points stay below theirs."""
    n = hm08.skin.vertices[1]
    model, faces = hm08.vertices[:n], hm08.faces[hm08.skin.face_slice]
    normals = vertex_normals(model, faces)
    cheek = model[hm08.regions["face"][:n] & (model[:, 0] > 35) & (model[:, 1] < -30)].mean(axis=0)
    swelling = 1.5 * np.exp(-((model - cheek) ** 2).sum(axis=1) / 15.0**2)
    noise = np.random.default_rng(0).normal(0.0, 0.1, n)
    truth = model + swelling[:, None] * normals
    fitted, _ = fit_skin(model, faces, Target(truth + noise[:, None] * normals, faces), skin_rules(hm08), (), LEVELS)
    face = hm08.regions["face"][:n] & hm08.regions["outer"][:n]
    off = fitted - truth
    height = np.einsum("nc,nc->n", off, normals)
    slid = np.linalg.norm(off - height[:, None] * normals, axis=1)
    assert np.abs(height)[face].mean() < 0.06
    assert slid[face].mean() < 0.06
    assert slid[face & (swelling > 0.5)].mean() < 0.25


def test_a_border_pulls_straight_across_and_only_by_what_is_beyond_its_slack():
    x = np.linspace(-10.0, 10.0, 81)
    border = Border(np.stack([x, 0 * x, 0 * x], axis=1), np.array([0.0, 0.0, 1.0]))
    vertices = np.array([[-4.0, 0.2, 3.0], [0.0, 1.0, 0.0], [3.0, -0.7, 0.0], [14.0, 2.0, 0.0]])
    (rows,) = border_rows(np.arange(4), border, 12.0, 0.3, 4)(vertices)
    gap = np.einsum("kc,kc->k", rows.normals, rows.targets - vertices)
    assert np.allclose(gap * rows.normals[:, 1], [0.0, -0.7, 0.4, gap[3] * rows.normals[3, 1]])
    assert np.allclose(np.abs(rows.normals[:, 1]), 1.0)
    assert rows.weights.tolist() == [12.0, 12.0, 12.0, 0.0]


def test_vertices_are_led_aside_by_what_is_beyond_the_slack_and_never_in_depth():
    forward = np.array([0.0, 0.0, 1.0])
    vertices = np.array([[0.0, 0.0, 5.0], [9.0, 9.0, 9.0], [1.0, 1.0, 0.0]])
    points = np.array([[0.0, 2.0, -4.0], [1.2, 1.0, 3.0]])
    (rows,) = aside_rows(np.array([0, 2]), points, forward, 2.0, 0.5, 3)(vertices)
    assert np.allclose(rows.matrix @ vertices, vertices[[0, 2]])
    assert np.allclose(rows.targets, [[0.0, 1.5, 5.0], [1.0, 1.0, 0.0]])
    assert rows.weights.tolist() == [2.0, 2.0]


def test_hair_before_a_cheek_is_told_by_its_colour_and_a_beard_is_not(hm08):
    rules = skin_rules(hm08)
    V, face = hm08.vertices[: len(rules.hairy)], hm08.regions["face"][: len(rules.hairy)]
    cheek = face & rules.curtained & ~rules.hairy
    chin = face & ~rules.curtained & (V[:, 1] < V[hm08.lines["lip_seam_lower"], 1].min() - 15)
    assert cheek.sum() > 100 and chin.sum() > 100

    def believed(mask, roughness, hair):
        rows = np.flatnonzero(mask)[:, None]
        values = np.full(len(rows), roughness), np.full(len(rows), hair)
        return rules.believe(rows, np.zeros(len(rows)), Samples(None, None, *values))

    assert (believed(cheek, 5.0, 0.0) == 1).all() and (believed(cheek, 0.5, 1.0) == 0).all()
    assert (believed(chin, 5.0, 1.0) == 1).all()
    assert (believed(rules.hairy, 5.0, 0.0) == 0).all()
    throat = rules.hairy & ~rules.curtained
    assert throat.any() and (believed(throat, 0.5, 1.0) == 1).all()


def test_hairlines_that_the_skin_has_climbed_are_told_by_their_folds(hm08):
    stop = hm08.skin.vertices[1]
    V, F = hm08.vertices[:stop], hm08.faces[hm08.skin.face_slice]
    hairy, surface = skin_rules(hm08).hairy, Surface(V, F)
    assert not welts(hm08, V, F, surface, hairy).any()
    center = V[hairy & hm08.regions["face"][:stop]].mean(axis=0) * [0.0, 1.0, 1.0]
    center = V[np.linalg.norm(V - center, axis=1).argmin()]
    turned = V.copy()
    patch = np.linalg.norm(V - center, axis=1) < 6.0
    turned[patch, 0] = 2 * center[0] - turned[patch, 0]
    found = welts(hm08, turned, F, surface, hairy)
    assert found[patch & hairy].all() and not (found & ~hairy).any()
    assert np.linalg.norm(V[found] - center, axis=1).max() < 25.0
