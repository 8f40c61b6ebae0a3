"""A packed set on disk: comes back as it was, appears whole, and replaces what an earlier run left."""

import json

import numpy as np
import pytest
from PIL import Image

from facewright.compress import FacezipOptions, facezip, facezip_decode, facezip_maps
from facewright.compress.folder import (
    atlas_places,
    files_of,
    publishing,
    read_packed,
    weight_atlas,
    weight_layers,
    write_packed,
)
from facewright.compress.packed import atlas_shape
from facewright.compress.synthetic import expression_set
from facewright.errors import InputError


@pytest.fixture(scope="module")
def made():
    return expression_set((48, 64), 7)


def same(one, other):
    arrays = ("neutral", "textures", "texture_step", "texture_zero", "weights", "weight_step", "weight_zero", "layers")
    return one.cell == other.cell and all(np.array_equal(getattr(one, name), getattr(other, name)) for name in arrays)


@pytest.mark.parametrize("k", [1, 3, 4, 6])
def test_a_set_comes_back_as_it_was(tmp_path, made, k):
    packed = facezip(made.neutral, made.textures, names=made.names, options=FacezipOptions(textures=k))
    about = write_packed(packed, tmp_path)
    again = read_packed(tmp_path)
    assert same(packed, again) and again.names == packed.names
    assert about["bytes"]["memory"] == packed.memory_bytes()
    assert about["bytes"]["png"] == sum(p.stat().st_size for p in tmp_path.glob("*.png"))


def test_several_maps_lie_in_one_folder(tmp_path, made):
    grey = [image[:, :, :1].astype(np.uint16) * 200 for image in [made.neutral, *made.textures]]
    maps = {"color": (made.neutral, lambda n: made.textures[n]), "height": (grey[0], lambda n: grey[n + 1])}
    packed = facezip_maps(maps, made.names, share=True)
    assert packed["height"].weights is packed["color"].weights
    assert packed["height"].textures.dtype == np.uint16
    write_packed(packed, tmp_path)
    for name in maps:
        assert same(read_packed(tmp_path, name), packed[name])
    with pytest.raises(InputError, match="no map 'normal'"):
        read_packed(tmp_path, "normal")


def test_weights_are_shared_where_that_pays_only(made):
    rng = np.random.default_rng(0)
    specular = [np.rint(0.5 * image[:, :, :1]).astype(np.uint8) for image in [made.neutral, *made.textures]]
    maps = {"color": (made.neutral, lambda n: made.textures[n]), "specular": (specular[0], lambda n: specular[n + 1])}
    packed = facezip_maps(maps, made.names)
    assert packed["specular"].weights is packed["color"].weights
    noise = [rng.integers(0, 255, (48, 64, 1)).astype(np.uint8) for _ in range(8)]
    maps["specular"] = (noise[0], lambda n: noise[n + 1])
    packed = facezip_maps(maps, made.names)
    assert packed["specular"].weights is not packed["color"].weights


def test_maps_with_weights_of_their_own_share_the_budget(made):
    maps = {name: (made.neutral, lambda n: made.textures[n]) for name in ("color", "specular")}
    cells, image = 4 * 6 * 8, made.neutral.nbytes
    for k in (2, 4):
        budget = 2 * ((1 + k) * image + 7 * cells)
        packed = facezip_maps(maps, made.names, share=False, options=FacezipOptions(textures=6, budget=budget))
        assert [len(one.textures) for one in packed.values()] == [k, k]
        assert sum(one.memory_bytes() for one in packed.values()) <= budget


@pytest.mark.parametrize("count,rows,columns", [(1, 64, 64), (20, 64, 64), (100, 512, 512), (7, 3, 5)])
def test_the_atlas_fits_a_graphics_card(count, rows, columns):
    across, down = atlas_shape(count, rows, columns)
    assert across * down >= count and across * columns <= 16384 and down * rows <= 16384


def test_too_many_maps_for_an_atlas_are_refused():
    with pytest.raises(InputError, match="split the set"):
        atlas_shape(2000, 512, 512)


@pytest.mark.parametrize("k", [2, 3, 4, 6])
def test_layers_lie_where_the_index_says(made, k):
    packed = facezip(made.neutral, made.textures, options=FacezipOptions(textures=k))
    rows, columns = packed.weights.shape[1:3]
    across, _ = atlas_places(packed)
    images = [weight_atlas(packed, start) for start in range(0, k, 4)]
    for weights, layer in zip(packed.weights, weight_layers(packed)):
        for i, (place, channel) in enumerate(layer["at"]):
            y, x = place // across * rows, place % across * columns
            assert (images[i // 4][y : y + rows, x : x + columns, channel] == weights[:, :, i]).all()
            # the shaders' rule
            assert i % 4 == ((place + channel) % 3 if k == 3 else channel)


def test_a_run_that_fails_leaves_the_old_set(tmp_path, made):
    packed = facezip(made.neutral, made.textures)
    with publishing(tmp_path) as folder:
        write_packed(packed, folder)
    before = sorted(p.name for p in tmp_path.iterdir())
    with pytest.raises(RuntimeError), publishing(tmp_path) as folder:
        (folder / "neutral.png").write_bytes(b"half")
        raise RuntimeError
    assert sorted(p.name for p in tmp_path.iterdir()) == before
    assert same(read_packed(tmp_path), packed)


def test_a_new_set_replaces_the_old_and_what_a_killed_run_left(tmp_path, made):
    for k in (4, 2):
        packed = facezip(made.neutral, made.textures, options=FacezipOptions(textures=k))
        (tmp_path / ".facezip-left").mkdir(exist_ok=True)
        with publishing(tmp_path, files_of(tmp_path)) as folder:
            write_packed(packed, folder)
    assert not (tmp_path / "difference3.png").exists() and not (tmp_path / ".facezip-left").exists()
    assert len(read_packed(tmp_path).textures) == 2


def test_an_index_that_leads_outside_or_is_broken_is_refused(tmp_path, made):
    write_packed(facezip(made.neutral, made.textures), tmp_path)
    about = json.loads((tmp_path / "facezip.json").read_text())
    about["maps"]["color"]["neutral"]["file"] = "../neutral.png"
    (tmp_path / "facezip.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="outside the folder"):
        read_packed(tmp_path)
    (tmp_path / "facezip.json").write_text("{")
    with pytest.raises(InputError, match="is no packed set"):
        read_packed(tmp_path)


def test_images_of_other_sizes_than_the_neutral_are_refused(tmp_path, made):
    write_packed(facezip(made.neutral, made.textures), tmp_path)
    Image.fromarray(made.neutral[:20]).save(tmp_path / "neutral.png")
    with pytest.raises(InputError, match="do not fit"):
        read_packed(tmp_path)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda about: about["expressions"].update(expression00=99),
        lambda about: about["expressions"].update(expression00=-1),
        lambda about: about["expressions"].update(expression00=0.5),
        lambda about: about["weights"].update(places=[2, 3]),
        lambda about: about["maps"]["color"]["differences"][0].update(step=[1.0]),
        lambda about: about["weights"]["layers"].pop(),
        lambda about: about.update(weight_size=[7, 7]),
        lambda about: about.update(maps={}),
    ],
)
def test_an_index_that_does_not_fit_its_images_is_refused(tmp_path, made, spoil):
    about = write_packed(facezip(made.neutral, made.textures, names=made.names), tmp_path)
    spoil(about)
    (tmp_path / "facezip.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="is no packed set"):
        read_packed(tmp_path)


def test_decoding_what_was_written_equals_decoding_in_memory(tmp_path, made):
    packed = facezip(made.neutral, made.textures, names=made.names)
    write_packed(packed, tmp_path)
    blend = {made.names[0]: 0.5, made.names[3]: 0.8}
    assert (facezip_decode(read_packed(tmp_path), blend) == facezip_decode(packed, blend)).all()
