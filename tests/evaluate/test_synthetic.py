"""Made scans: deterministic, with every fault that was asked for, and true to their truth."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.evaluate import synthetic
from facewright.mesh.adjacency import border_loops, face_components
from facewright.mesh.closest import Surface
from facewright.template.store import read_template

OPTIONS = synthetic.SyntheticOptions(n_faces=12000)
CLEAN = replace(OPTIONS, noise_mm=0.0, hair_mm=0.0, strands=0, collar=False, holes=0, pose_deg=0.0, pose_mm=0.0)


@pytest.fixture(scope="module")
def template():
    return read_template("hm08")


@pytest.fixture(scope="module")
def person(template):
    return synthetic.random_identity(template, 5)


@pytest.fixture(scope="module")
def made(template, person):
    return synthetic.synthetic_scan(template, person, 5, OPTIONS)


@pytest.fixture(scope="module")
def bare(template, person):
    return synthetic.synthetic_scan(template, person, 5, CLEAN)


def distance_to(scan, points):
    return Surface(scan.vertices, scan.faces).closest(points).distance


def test_same_seed_same_scan(template, person, made):
    again, truth = synthetic.synthetic_scan(template, person, 5, OPTIONS)
    assert np.array_equal(again.vertices, made[0].vertices)
    assert np.array_equal(again.faces, made[0].faces)
    assert np.array_equal(again.colors, made[0].colors)
    assert np.array_equal(truth["vertices"], made[1]["vertices"])


def test_truth_lies_on_the_clean_surface_and_near_the_scan(template, made):
    scan, truth = made
    face = template.regions["face"] & ~template.regions["nostrils"]
    assert Surface(*truth["surface"]).closest(truth["vertices"][face]).distance.max() < 1e-3
    assert np.median(distance_to(scan, truth["vertices"][face])) < 0.3


def test_the_eyes_are_the_origin(template, person):
    assert np.allclose(synthetic.centered_between_eyes(person + [5, 6, 7], template), person)


def test_noise_has_the_size_asked_for(template, person):
    noisy, truth = synthetic.synthetic_scan(template, person, 5, replace(CLEAN, noise_mm=0.15))
    off = Surface(*truth["surface"]).closest(noisy.vertices).distance
    assert 0.08 < off.mean() < 0.14  # the mean of |N(0, 0.15)| is 0.12, less where the surface bends


def test_faults_can_be_left_out(bare):
    bare, truth = bare
    assert Surface(*truth["surface"]).closest(bare.vertices).distance.max() < 1e-6
    assert len(np.unique(face_components(bare.faces, len(bare.vertices)))) == 1
    assert len(border_loops(bare.faces)) == 1
    assert np.allclose(truth["T"], np.eye(4))


def test_faults_are_there(template, person, made):
    scan, truth = made
    assert len(np.unique(face_components(scan.faces, len(scan.vertices)))) == 2  # head and collar
    assert len(border_loops(scan.faces)) >= 4  # neck, collar and at least two holes or strands
    off = Surface(*truth["surface"]).closest(scan.vertices).distance
    assert (off > 4.0).mean() > 0.1  # hair


def test_the_neck_is_cut(template, bare):
    scan, truth = bare
    outer = truth["vertices"][template.regions["outer"]]
    gone = distance_to(scan, outer) > 2.0
    assert 0.01 < gone.mean() < 0.3
    assert np.median(outer[gone, 1]) < truth["vertices"][template.lines["lip_seam_lower"], 1].min()


def test_the_back_can_be_missing(template, person, bare):
    _, truth = bare
    front, _ = synthetic.synthetic_scan(template, person, 5, replace(CLEAN, open_back=True))
    assert front.vertices[:, 2].min() > truth["vertices"][:, 2].min() + 40.0


def test_lips_are_redder_than_cheeks_and_brows_darker(template, made):
    scan, truth = made
    surface = Surface(scan.vertices, scan.faces)

    def mean_color(mask):
        nearest = surface.closest(truth["vertices"][mask])
        return scan.colors[scan.faces[nearest.faces]].mean(axis=(0, 1))

    lips = mean_color(template.regions["lip_lower"])
    face = mean_color(template.regions["face"] & ~template.regions["lips"] & ~template.regions["eyes"])
    assert lips[0] - lips[1] > face[0] - face[1] + 0.05
    assert scan.colors.min() >= 0 and scan.colors.max() <= 1


def test_fewer_modes_keep_the_rest(template):
    fewer = synthetic.with_fewer_modes(template, 20)
    assert len(fewer.identity_basis) == 20
    assert np.array_equal(fewer.vertices, template.vertices)
