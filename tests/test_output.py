"""The output folder is filled at once, and what a failed run made is taken back, nothing else."""

import pytest

from facewright.errors import InputError
from facewright.output import OutputFolder


def publish(output, files, stale=()):
    with output.workshop() as folder:
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        return output.publish(folder, stale)


def test_what_was_made_is_taken_back(tmp_path):
    output = OutputFolder(tmp_path / "a" / "b" / "result")
    output.make().mkdir()
    output.remove_what_is_new()
    assert list(tmp_path.iterdir()) == []


def test_what_was_there_stays(tmp_path):
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "mine.txt").write_text("mine")
    output = OutputFolder(tmp_path / "result")
    output.make().mkdir()
    output.remove_what_is_new()
    assert [path.name for path in (tmp_path / "result").iterdir()] == ["mine.txt"]


def test_a_parent_that_another_job_uses_stays(tmp_path):
    output = OutputFolder(tmp_path / "all" / "one")
    output.make()
    (tmp_path / "all" / "two").mkdir()
    output.remove_what_is_new()
    assert [path.name for path in (tmp_path / "all").iterdir()] == ["two"]


def test_published_files_are_known_by_their_content(tmp_path):
    output = OutputFolder(tmp_path / "result")
    output.make()
    digests = publish(output, {"rig.glb": "one", "maps/a.png": "two"})
    assert sorted(digests) == ["maps/a.png", "rig.glb"]
    assert output.holds(digests)
    (tmp_path / "result" / "rig.glb").write_text("three")
    assert not output.holds(digests)


def test_stale_files_go_and_others_stay(tmp_path):
    output = OutputFolder(tmp_path / "result")
    output.make()
    (tmp_path / "outside.txt").write_text("mine")
    first = publish(output, {"obj/a.obj": "one", "rig.glb": "two", "maps/a.png": "old"})
    (tmp_path / "result" / "maps" / "mine.txt").write_text("mine")
    publish(output, {"rig.glb": "new"}, [*first, "../outside.txt"])
    left = sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file())
    assert left == ["outside.txt", "result/maps/mine.txt", "result/rig.glb"]
    assert not (tmp_path / "result" / "obj").exists()


def test_a_file_where_the_folder_should_be(tmp_path):
    (tmp_path / "result").write_text("mine")
    for path in (tmp_path / "result", tmp_path / "result" / "below"):
        with pytest.raises(InputError, match="choose another --out"):
            OutputFolder(path).make()
    assert (tmp_path / "result").read_text() == "mine"


def test_a_folder_where_a_file_should_be(tmp_path):
    output = OutputFolder(tmp_path / "result")
    output.make()
    (tmp_path / "result" / "rig.glb").mkdir()
    with pytest.raises(InputError, match=r"cannot write .*rig\.glb"):
        publish(output, {"rig.glb": "one"})


def test_files_of_others_where_results_would_go_are_left_alone(tmp_path):
    out = tmp_path / "result"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    with OutputFolder(out).held():
        pass
    (out / "preview.png").write_text("mine")
    with (
        pytest.raises(InputError, match=r"its preview\.png cannot be told to be from an earlier run"),
        OutputFolder(out).held(),
    ):
        pass
    assert (out / "preview.png").read_text() == "mine"
    (out / "rig").mkdir()
    (out / "rig" / "rig.json").write_text("{}")  # a result without its stages is one
    with OutputFolder(out).held():
        pass
