"""`facewright template`, called in-process."""

import argparse

import pytest

from facewright.cli import template
from facewright.errors import InputError


def call(*words):
    parser = argparse.ArgumentParser()
    template.add_arguments(parser)
    return template.run(parser.parse_args(words))


def test_list_names_the_shipped_template_and_how_to_get_ict(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("FACEWRIGHT_HOME", str(tmp_path))
    assert call("list") == 0
    out = capsys.readouterr().out
    assert "hm08" in out and "template fetch ict" in out


def test_info_shows_licence_and_parts(capsys):
    assert call("info", "hm08") == 0
    out = capsys.readouterr().out
    assert "CC0" in out and "topology_id" in out and "teeth_lower" in out and "lip_seam_upper" in out


def test_a_template_that_was_made_is_said_in_one_sentence(capsys, tmp_path, monkeypatch, hm08):
    monkeypatch.setattr("facewright.template.fetch.build_folder", lambda *_: hm08)
    monkeypatch.setenv("FACEWRIGHT_HOME", str(tmp_path / "home"))
    assert call("fetch", "ict", "--from", str(tmp_path)) == 0
    line = capsys.readouterr().out
    assert line.startswith("hm08 (") and line.endswith("--template ict\n") and str(tmp_path / "home") in line
    for action in (["build"], ["fetch", "ict"]):
        assert call(*action, "--from", str(tmp_path), "--out", str(tmp_path / "out")) == 0
        line = capsys.readouterr().out
        assert "Template(" not in line and line.endswith(f"--template {tmp_path / 'out'}\n")


def test_unknown_template_and_folder(tmp_path):
    with pytest.raises(InputError, match="nobody"):
        call("info", "nobody")
    with pytest.raises(InputError, match="no folder"):
        call("build", "--from", str(tmp_path / "none"), "--out", str(tmp_path / "out"))
