"""Templates written and read back."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from facewright.data import Landmarks, Part, Skeleton, Template
from facewright.errors import InputError
from facewright.template import store


def small_template(n_modes=2):
    """Two quads, mirrored at x = 0, as a template with two parts."""
    rng = np.random.default_rng(5)
    vertices = np.array([[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-1, 1, 0], [0, 1, 0], [1, 1, 1 / 3]], float)
    polygons = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    return Template(
        vertices=vertices,
        faces=faces,
        polygons=polygons,
        uv=vertices[:, :2] / 2 + 0.5,
        uv_faces=faces,
        uv_polygons=polygons,
        mirror=np.array([2, 1, 0, 5, 4, 3]),
        parts=(Part("skin", (0, 6), (0, 2), "skin"), Part("tongue", (0, 0), (2, 4), "tongue", "jaw")),
        regions={"skin": np.arange(6) < 4, "face": np.ones(6, bool)},
        lines={"lip": np.array([0, 1, 2]), "lid": np.array([3, 4])},
        landmarks=Landmarks(("mp0", "p1"), [0, 1], [[1 / 3, 1 / 3, 1 / 3], [0, 1, 0]], [0.0, 0.5]),
        shape_names=("jawOpen", "tongueOut"),
        deltas=rng.normal(size=(2, 6, 3)) * [[[20]], [[0]]],
        identity_basis=rng.normal(size=(n_modes, 6, 3)) * 5,
        openness=np.linspace(0, 1, 6),
        skeleton=Skeleton(("neck", "head"), (-1, 0), [[0, -90, -40], [0, 0, 1 / 3]]),
        skin_weights=np.column_stack([np.linspace(0, 1, 6), 1 - np.linspace(0, 1, 6)]),
        materials={"skin": {"color": (0.8, 0.7, 0.6), "roughness": 0.5}},
        info={"name": "small", "version": "1", "credits": ["nobody"]},
    )


def test_read_gives_what_was_written(tmp_path):
    template = small_template()
    store.write_template(template, tmp_path / "small")
    back = store.read_template(tmp_path / "small")
    for name in ("vertices", "faces", "polygons", "uv_faces", "uv_polygons", "mirror"):
        assert np.array_equal(getattr(back, name), getattr(template, name)), name
    assert np.abs(back.deltas - template.deltas).max() < 0.002 / np.sqrt(3)
    assert np.abs(back.identity_basis - template.identity_basis).max() < 0.002
    assert np.abs(back.openness - template.openness).max() < 1e-4
    assert np.allclose(back.skin_weights.sum(1), 1, atol=1e-12)
    assert back.parts == template.parts and back.shape_names == template.shape_names
    assert back.landmarks.names == template.landmarks.names
    assert np.allclose(back.landmarks.barycentric, template.landmarks.barycentric)
    assert {k: v.tolist() for k, v in back.lines.items()} == {k: v.tolist() for k, v in template.lines.items()}
    assert {k: v.tolist() for k, v in back.regions.items()} == {k: v.tolist() for k, v in template.regions.items()}
    assert back.materials == template.materials
    assert back.info["topology_id"].startswith("small-")


def test_write_is_deterministic_and_stable(tmp_path):
    store.write_template(small_template(), tmp_path / "a")
    store.write_template(small_template(), tmp_path / "b")
    store.write_template(store.read_template(tmp_path / "a"), tmp_path / "c")
    for name in (store.ARRAYS, store.DESCRIPTION):
        first = (tmp_path / "a" / name).read_bytes()
        assert first == (tmp_path / "b" / name).read_bytes()
        if name == store.DESCRIPTION:
            assert first == (tmp_path / "c" / name).read_bytes()


def test_control_mesh_is_expanded(tmp_path):
    operator = sp.csr_matrix(np.array([[1, 0], [0.5, 0.5], [0, 1], [1, 0], [0.5, 0.5], [0, 1]]))
    coarse = np.random.default_rng(1).normal(size=(3, 2, 3))
    basis = np.stack([operator @ mode for mode in coarse])
    template = replace(small_template(), identity_basis=basis)
    store.write_template(template, tmp_path / "t", control={"operator": operator, "identity": coarse})
    assert np.abs(store.read_template(tmp_path / "t").identity_basis - basis).max() < 1e-3
    with pytest.raises(ValueError, match="control fields"):
        store.write_template(template, tmp_path / "u", control={"operator": operator, "identity": coarse + 1})


def test_changed_topology_is_refused(tmp_path):
    folder = tmp_path / "t"
    store.write_template(small_template(), folder)
    text = (folder / store.DESCRIPTION).read_text()
    (folder / store.DESCRIPTION).write_text(text.replace('topology_id = "small-', 'topology_id = "other-'))
    with pytest.raises(InputError, match="topology_id"):
        store.read_template(folder)


@pytest.mark.parametrize(
    "damage, message",
    [
        (lambda folder: (folder / store.ARRAYS).write_bytes(b"PK"), "cannot be read"),
        (lambda folder: (folder / store.ARRAYS).unlink(), "no arrays.npz"),
        (lambda folder: (folder / store.DESCRIPTION).write_text("format = 2"), "format 2"),
        (lambda folder: (folder / store.DESCRIPTION).write_text("format = "), "not valid TOML"),
        (lambda folder: (folder / store.DESCRIPTION).write_text("format = 1"), "lacks"),
        (lambda folder: (folder / store.DESCRIPTION).unlink(), "holds no template.toml"),
    ],
)
def test_broken_folders_are_told_apart(tmp_path, damage, message):
    folder = tmp_path / "t"
    store.write_template(small_template(), folder)
    damage(folder)
    with pytest.raises(InputError, match=message):
        store.read_template(folder)


def test_unknown_name_lists_known_ones(tmp_path, monkeypatch):
    monkeypatch.setenv("FACEWRIGHT_HOME", str(tmp_path))
    store.write_template(small_template(), tmp_path / "templates" / "mine")
    assert store.list_templates()["mine"] == tmp_path / "templates" / "mine"
    assert store.read_template("mine").info["name"] == "small"
    with pytest.raises(InputError, match="mine"):
        store.read_template("nobody")


def test_unwritable_folder_is_an_input_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        store.write_template(small_template(), tmp_path / "file" / "t")
