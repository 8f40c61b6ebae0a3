from dataclasses import replace

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.template.modifiers import (
    build_basis,
    build_modes,
    is_macro,
    mean_weights,
    modifier_axes,
    read_modifiers,
    sample_identity,
    sample_weights,
    split_names,
    write_modifiers,
)
from facewright.template.store import write_template


@pytest.fixture(scope="module")
def modifiers():
    return read_modifiers("hm08")


def test_there_are_all_modifiers_and_macros(modifiers):
    assert sum(is_macro(name) for name in modifiers.names) == 96
    assert sum(not is_macro(name) for name in modifiers.names) == 348


def test_opposites_share_an_axis():
    names = ["nose-hump-decr", "nose-hump-incr", "head-oval", "asym-jaw-1-l", "asym-jaw-1-r", "mouth-trans-in"]
    assert modifier_axes([*names, "mouth-trans-out", "asian-male-old"]) == [
        ("nose-hump-incr", "nose-hump-decr"),
        ("head-oval", None),
        ("asym-jaw-1-r", "asym-jaw-1-l"),
        ("mouth-trans-out", "mouth-trans-in"),
    ]


def test_left_out_fifth_shares_nothing_with_the_rest(modifiers):
    kept, out = split_names(modifiers.names)
    assert not set(kept) & set(out) and len(kept) + len(out) == len(modifiers.names)
    assert not any(is_macro(name) for name in out)
    assert 0.15 < len(out) / 348 < 0.25
    other_side = {"l-" + name[2:] for name in out if name.startswith("r-")}
    assert other_side <= set(out)


def test_samples_are_plausible_and_repeat(modifiers):
    weights = sample_weights(np.random.default_rng(7), modifiers.names)
    np.testing.assert_array_equal(weights, sample_weights(np.random.default_rng(7), modifiers.names))
    assert np.abs(weights).max() <= 1.0
    macro = np.array([is_macro(name) for name in modifiers.names])
    general = np.array([name.startswith("universal") for name in modifiers.names])
    assert np.isclose(weights[macro & ~general].sum(), 1.0) and np.isclose(weights[general].sum(), 1.0)
    assert np.isclose(mean_weights(modifiers.names).sum(), 2.0)


def test_only_named_modifiers_vary(modifiers, hm08):
    delta = sample_identity(modifiers, np.random.default_rng(1), ["nose-hump-incr", "nose-hump-decr"])
    moved = np.linalg.norm(delta, axis=1) > 0.01
    assert moved.any()
    assert np.linalg.norm(hm08.vertices[moved] - [0, -25, 25], axis=1).max() < 75.0


def test_modes_are_the_shipped_basis(modifiers, hm08):
    modes = build_modes(modifiers, n_modes=3)
    assert np.abs(np.stack([modifiers.operator @ mode for mode in modes]) - hm08.identity_basis[:3]).max() < 0.01


def test_modes_are_decorrelated_and_mirror_to_themselves(modifiers):
    kept, _ = split_names(modifiers.names)
    modes = build_modes(modifiers, kept, 12, n_samples=400)
    measure = (modifiers.areas / modifiers.areas.sum())[None, :, None]
    gram = np.einsum("icd,jcd->ij", modes * measure, modes)
    assert np.abs(gram - np.diag(np.diag(gram))).max() < 1e-3 * gram.max()
    assert (np.diff(np.diag(gram)) <= 1e-9).all()
    mirrored = modes[:, modifiers.mirror] * [-1, 1, 1]
    agreement = np.einsum("icd,icd->i", mirrored * measure, modes) / np.diag(gram)
    np.testing.assert_allclose(np.abs(agreement), 1.0, atol=0.02)
    assert build_basis(modifiers, kept, 2, n_samples=50).shape == (2, modifiers.operator.shape[0], 3)


def test_written_and_read_again(modifiers, hm08, tmp_path):
    some = modifiers.subset(modifiers.names[:4])
    one = modifiers.deltas[:1]
    template = replace(hm08, identity_basis=np.stack([modifiers.operator @ mode for mode in one]))
    write_template(template, tmp_path, control={"operator": modifiers.operator, "identity": one})
    write_modifiers(some, tmp_path)
    again = read_modifiers(tmp_path)
    assert again.names == some.names
    assert np.abs(again.deltas - some.deltas).max() < 0.002
    assert abs(again.operator - some.operator).max() == 0


def test_a_template_without_them_says_so(hm08, tmp_path):
    write_template(hm08, tmp_path)
    with pytest.raises(InputError, match=r"modifiers\.npz"):
        read_modifiers(tmp_path)
