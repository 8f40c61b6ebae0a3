"""CREDITS.txt says what the template's licence asks."""

from dataclasses import replace

import pytest

from facewright.write.credits import credits_text, write_credits

INFO = {"template": "ict", "template_version": "1", "topology_id": "ict-12", "copyright": "Copyright (c) 2020 Somebody"}


@pytest.mark.parametrize(
    ("licence", "words"), [("MIT", "permission notice"), ("CC0-1.0", "public domain"), ("X", "own licence")]
)
def test_says_the_licence(small_rig, licence, words):
    text = credits_text(replace(small_rig, info=INFO | {"licence": licence, "credits": ["One", "Two"]}))
    assert words in text and "Copyright (c) 2020 Somebody" in text and "ict 1 (topology ict-12)" in text
    assert "Credit:   One" in text and "Credit:   Two" in text


def test_the_templates_own_text_goes_first(small_rig, tmp_path):
    write_credits(
        replace(small_rig, info=INFO | {"licence": "MIT", "licence_text": "as they say"}), tmp_path / "CREDITS.txt"
    )
    text = (tmp_path / "CREDITS.txt").read_text(encoding="utf-8")
    assert "as they say" in text and "Permission is hereby" not in text
