"""Light comes to front teeth, less to what lies deep, and only darkens what is painted."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.parts.assemble import AssemblyOptions, build_rig
from facewright.parts.mouth_light import LEAST, mouth_light, parts_behind_lips, shaded


@pytest.fixture(scope="module")
def light(hm08):
    return mouth_light(hm08)


def test_only_what_lies_behind_lips_is_shaded(hm08, light):
    behind = parts_behind_lips(hm08)
    assert {"teeth_upper", "teeth_lower", "tongue", "gums_upper"} <= {part.name for part in behind}
    others = [part for part in hm08.parts if part not in behind]
    assert all((light[part.vertex_slice] == 1.0).all() for part in others)
    assert light.min() > LEAST - 1e-6 and light.max() <= 1.0 + 1e-9


@pytest.mark.parametrize("name", ["teeth_upper", "teeth_lower"])
def test_front_teeth_are_light_and_back_teeth_dark(hm08, light, name):
    part = hm08.part(name)
    depth = hm08.vertices[part.vertex_slice, 2].max() - hm08.vertices[part.vertex_slice, 2]
    here = light[part.vertex_slice]
    front, middle, back = (np.quantile(here[(depth >= a) & (depth < b)], 0.9) for a, b in ((0, 4), (8, 16), (25, 60)))
    assert front > 1.2 * middle > 1.5 * back
    assert front > 0.6 or name == "teeth_lower"


def test_a_tongue_is_light_where_it_comes_out(hm08, light):
    tongue = hm08.part("tongue").vertex_slice
    depth = hm08.vertices[tongue, 2].max() - hm08.vertices[tongue, 2]
    assert np.median(light[tongue][depth < 5.0]) > 0.8 > 0.3 > np.median(light[tongue][depth > 40.0])


def test_light_is_the_same_on_both_sides(hm08, light):
    every = np.concatenate([np.arange(*part.vertices) for part in parts_behind_lips(hm08)])
    assert np.abs(light[every] - light[hm08.mirror[every]]).max() < 1e-12


def test_a_template_without_shapes_has_a_dark_mouth(hm08, light):
    shut = mouth_light(replace(hm08, deltas=np.zeros_like(hm08.deltas)))
    teeth = hm08.part("teeth_upper").vertex_slice
    assert shut[teeth].max() < light[teeth].max()


def test_full_light_changes_nothing_and_less_darkens_evenly(hm08):
    parts = [part for part in parts_behind_lips(hm08) if part.material == "gums"]
    image = np.random.default_rng(0).integers(40, 255, (32, 32, 3)).astype(np.uint8)
    before = image.copy()
    np.testing.assert_array_equal(shaded(image, hm08, parts, np.ones(len(hm08.vertices))), image)
    dark = shaded(image, hm08, parts, np.full(len(hm08.vertices), 0.3))
    np.testing.assert_array_equal(image, before)
    assert (dark < image).all()


def test_parts_without_paint_are_shaded_too(hm08, hm08_person):
    """As a template has them whose teeth are of one colour, whatever their UVs."""
    bare = {name: {key: look[key] for key in look if key != "paint"} for name, look in hm08.materials.items()}
    person = hm08_person(1)
    rig = build_rig(replace(person, template=replace(hm08, materials=bare)), hm08.deltas)
    teeth = rig.maps["teeth_albedo"].astype(float).mean(axis=2)
    assert teeth.max() > 1.5 * teeth.min()
    plain = build_rig(replace(person, template=hm08), hm08.deltas, options=AssemblyOptions(painted=False))
    assert "teeth_albedo" not in plain.maps
