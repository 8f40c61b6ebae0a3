"""The working set says something of every shape, and its expressions hold them all."""

from facewright.conventions import ARKIT_SHAPES, mirrored_name
from facewright.working_set import read_working_set


def test_a_word_for_each_of_apples_shapes():
    words = read_working_set().words
    assert set(words) == set(ARKIT_SHAPES)
    for name, word in words.items():
        least, most = word.amplitude
        assert word.name == name and word.au and word.region in read_working_set().regions and 0 < least <= most
        assert (word.side is None) == (
            mirrored_name(name) == name or name in ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
        )


def test_halves_are_named_after_their_sum():
    halves = read_working_set().halves(ARKIT_SHAPES)
    assert len(halves) == 8
    assert all(pair == (f"{name}Left", f"{name}Right") for name, pair in halves.items())
    assert not {half for pair in halves.values() for half in pair} & set(ARKIT_SHAPES)


def test_26_expressions_hold_every_shape():
    expressions = read_working_set().expressions
    assert len(expressions) == 26
    assert {name for weights in expressions.values() for name in weights} == set(ARKIT_SHAPES)
    assert {weight for weights in expressions.values() for weight in weights.values()} == {1.0}


def test_each_expression_has_its_mirror_image():
    expressions = [frozenset(weights) for weights in read_working_set().expressions.values()]
    swap = {"jawLeft": "jawRight", "mouthLeft": "mouthRight"}
    swap |= {b: a for a, b in swap.items()}
    for names in expressions:
        assert frozenset(swap.get(name, mirrored_name(name)) for name in names) in expressions


def test_15_visemes_of_known_shapes_that_close_no_shut_jaw():
    visemes = read_working_set().visemes
    assert len(visemes) == 15 and all(name.startswith("viseme_") for name in visemes)
    for weights in visemes.values():
        assert set(weights) <= set(ARKIT_SHAPES) and all(0 < weight <= 1 for weight in weights.values())
        assert weights.get("mouthClose", 0.0) <= weights.get("jawOpen", 0.0)
