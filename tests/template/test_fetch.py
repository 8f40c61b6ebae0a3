"""Fetching a template: everything that can go wrong is said in one sentence."""

import zipfile

import pytest

from facewright.errors import InputError
from facewright.template import fetch


def description(tmp_path, archive):
    path = tmp_path / "mine.toml"
    path.write_text(
        f'parts = []\n[info]\nname = "mine"\n[source]\nunit_mm = 1\nneutral = "n.obj"\n{archive}\n[shapes]\n'
    )
    return path


def test_unknown_names_list_the_known_ones():
    with pytest.raises(InputError, match="ict"):
        fetch.description_of("nobody")
    assert fetch.description_of("ict").name == "ict.toml"


def test_a_missing_folder_is_said(tmp_path):
    with pytest.raises(InputError, match="no folder"):
        fetch.fetch_template("ict", source_folder=tmp_path / "none", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_empty_folder_is_said(tmp_path):
    with pytest.raises(InputError, match=r"generic_neutral_mesh\.obj"):
        fetch.fetch_template("ict", source_folder=tmp_path, out=tmp_path / "out")


def test_an_archive_that_cannot_be_had_is_said(tmp_path):
    path = description(tmp_path, f'archive = "{(tmp_path / "none.zip").as_uri()}"')
    with pytest.raises(InputError, match="--from FOLDER"):
        fetch.fetch_template(path, out=tmp_path / "out")
    with pytest.raises(InputError, match="names no archive"):
        fetch.fetch_template(description(tmp_path, ""), out=tmp_path / "out")


def test_an_archive_is_unpacked_and_a_wicked_one_is_not(tmp_path):
    good, wicked, broken = (tmp_path / f"{name}.zip" for name in ("good", "wicked", "broken"))
    with zipfile.ZipFile(good, "w") as bundle:
        bundle.writestr("top-master/n.obj", "v 0 0 0\n")
    with zipfile.ZipFile(wicked, "w") as bundle:
        bundle.writestr("../n.obj", "v 0 0 0\n")
    broken.write_bytes(b"<html>")
    seen = []
    path = description(tmp_path, f'archive = "{good.as_uri()}"')
    with pytest.raises(InputError, match=r"n\.obj has no vertices or no texture coordinates"):
        fetch.fetch_template(path, out=tmp_path / "out", progress=lambda done, total: seen.append((done, total)))
    assert seen[-1][0] == good.stat().st_size
    for archive, message in ((wicked, "lead out"), (broken, "not a zip")):
        path = description(tmp_path, f'archive = "{archive.as_uri()}"')
        with pytest.raises(InputError, match=message):
            fetch.fetch_template(path, out=tmp_path / "out")
