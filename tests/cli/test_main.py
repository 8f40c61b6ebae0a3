"""The command line: bad input ends in exit code 2 and one line that begins with "facewright:", and leaves nothing."""

import os
import shutil
import struct
import subprocess
import sys

import numpy as np
import pytest

from facewright.cli.__main__ import main
from facewright.sample import sample_path

TRIANGLE = "v 0 0 0\nv 100 0 0\nv 0 100 0\nvt 0 0\nvt 1 0\nvt 0 1\n"


def write_obj(path, vertices, polygons):
    lines = ["v {} {} {}".format(*vertex) for vertex in vertices]
    lines += ["f " + " ".join(str(i + 1) for i in polygon) for polygon in polygons]
    path.write_text("\n".join(lines) + "\n")
    return path


def cube(folder):
    corners = 200.0 * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return write_obj(folder / "cube.obj", corners, sides)


def sphere(folder):
    i, j = np.meshgrid(np.arange(40), np.arange(80), indexing="ij")
    a, b = np.pi * np.arange(41) / 40, 2 * np.pi * np.arange(80) / 80
    ball = np.stack([np.outer(np.sin(a), np.cos(b)), np.outer(np.cos(a), np.ones(80)), np.outer(np.sin(a), np.sin(b))])
    corner = [i * 80 + j, i * 80 + (j + 1) % 80, (i + 1) * 80 + (j + 1) % 80, (i + 1) * 80 + j]
    return write_obj(folder / "sphere.obj", 90.0 * ball.reshape(3, -1).T, np.stack(corner, -1).reshape(-1, 4))


def back_of_a_head(folder):
    from facewright.template.store import read_template

    template = read_template("hm08")
    faces = template.faces[template.skin.face_slice]
    behind = template.vertices[faces][:, :, 2].max(axis=1) < -60.0
    return write_obj(folder / "back.obj", template.vertices, faces[behind])


def truncated_glb(folder):
    path = folder / "cut.glb"
    path.write_bytes(struct.pack("<4sIIII", b"glTF", 2, 5000, 4000, 0x4E4F534A) + b'{"asset": {"version"')
    return path


def text(name, content):
    def make(folder):
        path = folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return make


def textured(image):
    def make(folder):
        (folder / "head.mtl").write_text(f"newmtl skin\nmap_Kd {image}\n")
        (folder / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\nno picture")
        path = folder / "head.obj"
        path.write_text("mtllib head.mtl\n" + TRIANGLE + "usemtl skin\nf 1/1 2/2 3/3\n")
        return path

    return make


BAD_SCANS = {
    "missing": (lambda folder: folder / "nobody.obj", "nobody.obj"),
    "a folder": (lambda folder: folder, "is a folder"),
    "empty": (text("head.obj", ""), "is empty"),
    "unknown format": (text("head.xyz", "1 2 3"), "unknown format"),
    "truncated GLB": (truncated_glb, "cut.glb"),
    "NaN": (text("head.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"), "vertex 2 is not a finite point"),
    "index out of range": (text("head.obj", TRIANGLE + "f 1 2 9\n"), "beyond the 3"),
    "index of zero": (text("head.obj", TRIANGLE + "f 0 1 2\n"), "head.obj"),
    "zero faces": (text("head.obj", TRIANGLE), "no faces"),
    "one triangle": (text("head.obj", TRIANGLE + "f 1 2 3\n"), "head"),
    "cube": (cube, "no face"),
    "sphere": (sphere, "no face"),
    "back of a head": (back_of_a_head, "no face"),
    "missing texture": (textured("nowhere.png"), "nowhere.png"),
    "undecodable texture": (textured("broken.png"), "cannot be decoded"),
}


@pytest.fixture
def refused(capsys):
    """A function that runs a command and checks how it was refused; returns the one line."""

    def run(*arguments):
        assert main([str(argument) for argument in arguments]) == 2
        captured = capsys.readouterr()
        lines = captured.err.splitlines()
        assert [line for line in lines if line.startswith("facewright: ")] == lines[-1:], captured.err
        assert all(line.startswith(("[", "facewright: ")) for line in lines), captured.err
        assert captured.out == ""
        return lines[-1]

    return run


@pytest.mark.parametrize("name", ["missing", "a folder", "empty", "unknown format"])
def test_what_is_plain_from_outside_is_said_before_any_stage(name, tmp_path, capsys):
    assert main(["rig", str(BAD_SCANS[name][0](tmp_path)), "--out", str(tmp_path / "result")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_so_are_images_and_landmarks_that_cannot_be_used(tmp_path, capsys):
    scan, broken = text("head.obj", TRIANGLE + "f 1 2 3\n")(tmp_path), text("broken.png", "no picture")(tmp_path)
    for option, file in (("--albedo", broken), ("--normal-map", tmp_path / "nowhere.png"), ("--landmarks", broken)):
        assert main(["rig", str(scan), option, str(file), "--out", str(tmp_path / "result")]) == 2
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1 and file.name in lines[0]


@pytest.mark.parametrize("name", BAD_SCANS)
def test_a_scan_that_cannot_be_used(name, tmp_path, refused):
    make, expected = BAD_SCANS[name]
    line = refused("rig", make(tmp_path), "--out", tmp_path / "new" / "result")
    assert expected in line
    assert not (tmp_path / "new").exists()


def test_an_empty_output_folder_stays_empty(tmp_path, refused):
    (tmp_path / "result").mkdir()
    refused("rig", cube(tmp_path), "--out", tmp_path / "result", "--quiet")
    assert list((tmp_path / "result").iterdir()) == []


@pytest.mark.parametrize(
    "options, expected",
    [
        (["--albedo", "nowhere.png"], "nowhere.png"),
        (["--albedo", __file__], "cannot be decoded"),
        (["--normal-map", "nowhere.png"], "nowhere.png"),
        (["--landmarks", "nowhere.json"], "nowhere.json"),
        (["--landmarks", __file__], "JSON"),
        (["--template", "nobody"], "'nobody' is neither a folder nor a known template"),
        (["--units", "mm"], "--units cm would put them 59 mm"),
        (["--from", "regster"], "the stages are read, landmarks, register"),
    ],
)
def test_options_that_cannot_be_used(options, expected, tmp_path, refused):
    line = refused("rig", sample_path(), "--out", tmp_path / "result", "--quiet", *options)
    assert expected in line
    assert not (tmp_path / "result").exists()


def test_a_damaged_template(tmp_path, refused, hm08_copy):
    (hm08_copy / "arrays.npz").write_bytes(b"spoilt")
    line = refused("rig", sample_path(), "--out", tmp_path / "result", "--template", hm08_copy)
    assert line.startswith("facewright: template")
    assert not (tmp_path / "result").exists()


@pytest.fixture
def hm08_copy(tmp_path):
    from facewright.template.store import find_template

    return shutil.copytree(find_template("hm08"), tmp_path / "template")


def test_a_file_where_the_output_folder_should_be(tmp_path, refused):
    (tmp_path / "result").write_text("mine")
    line = refused("rig", sample_path(), "--out", tmp_path / "result")
    assert "choose another --out" in line
    assert (tmp_path / "result").read_text() == "mine"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_output_folder(tmp_path, refused):
    (tmp_path / "result").mkdir(mode=0o500)
    assert "choose another --out" in refused("rig", sample_path(), "--out", tmp_path / "result")


@pytest.mark.parametrize(
    "arguments, expected",
    [
        ([], "COMMAND"),
        (["sculpt"], "sculpt"),
        (["rig", "head.obj"], "--out"),
        (["rig", "head.obj", "--out", "x", "--texture-size", "3"], "from 64 to 8192"),
        (["rig", "head.obj", "--out", "x", "--jobs", "0"], "from 1 to 256"),
        (["rig", "head.obj", "--out", "x", "--formats", "fbx"], "glb and obj"),
        (["rig", "head.obj", "--out", "x", "--units", "ell"], "ell"),
        (["template"], "list|info|build|fetch"),
    ],
)
def test_a_command_that_cannot_be_read(arguments, expected, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("facewright: ") and expected in lines[0] and "--help" in lines[0]


@pytest.mark.parametrize(
    "command", [[], ["rig"], ["demo"], ["evaluate"], ["compress"], ["template"], ["template", "build"]]
)
def test_help(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([*command, "--help"])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    assert printed.startswith(" ".join(["usage: facewright", *command]))
    assert max(map(len, printed.splitlines())) <= 120


def test_python_m_facewright():
    done = subprocess.run([sys.executable, "-m", "facewright", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("facewright ")


def test_a_finished_job_is_said_in_a_few_lines(sample_job, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("facewright.pipeline.rig_job", lambda scan, out, options, progress: sample_job.report)
    assert main(["demo", "--out", str(tmp_path / "result")]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].startswith("scan to face: mean 0.")
    assert "preview.png" in printed[-1] and "rig.glb" in printed[-1]


def test_formats_of_an_earlier_run_that_go_are_named(sample_job, tmp_path, capsys, monkeypatch):
    obj = tmp_path / "result" / "obj"

    def job(scan, out, options, progress):
        obj.rmdir()
        return sample_job.report

    obj.mkdir(parents=True)
    monkeypatch.setattr("facewright.pipeline.rig_job", job)
    assert main(["demo", "--out", str(tmp_path / "result")]) == 0
    assert f"{obj} of an earlier run was removed" in capsys.readouterr().out
