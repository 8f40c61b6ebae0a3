"""The main job on the embedded sample: what it leaves behind, that it resumes, and that it always says the same."""

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from facewright import pipeline
from facewright.cache import StageStore
from facewright.errors import InputError
from facewright.evaluate.gltf import read_glb
from facewright.mesh.closest import Surface
from facewright.packing import unpack_face
from facewright.pipeline import BAKE_ALONE_SHARE, STAGE_SHARE, STAGES, JobOptions, rig_job
from facewright.read import read_scan
from facewright.sample import sample_path
from facewright.write.rig import read_rig

# Apple's names, written out once more: the constant they are checked against must not change by accident.
APPLE = (
    "eyeBlinkLeft eyeLookDownLeft eyeLookInLeft eyeLookOutLeft eyeLookUpLeft eyeSquintLeft eyeWideLeft eyeBlinkRight "
    "eyeLookDownRight eyeLookInRight eyeLookOutRight eyeLookUpRight eyeSquintRight eyeWideRight jawForward jawLeft "
    "jawRight jawOpen mouthClose mouthFunnel mouthPucker mouthLeft mouthRight mouthSmileLeft mouthSmileRight "
    "mouthFrownLeft mouthFrownRight mouthDimpleLeft mouthDimpleRight mouthStretchLeft mouthStretchRight "
    "mouthRollLower mouthRollUpper mouthShrugLower mouthShrugUpper mouthPressLeft mouthPressRight mouthLowerDownLeft "
    "mouthLowerDownRight mouthUpperUpLeft mouthUpperUpRight browDownLeft browDownRight browInnerUp browOuterUpLeft "
    "browOuterUpRight cheekPuff cheekSquintLeft cheekSquintRight noseSneerLeft noseSneerRight tongueOut"
).split()
WORK = ("read_scan", "find_landmarks", "register", "in_place", "shapes_of", "bake", "write_results")


class Killed(BaseException):
    """Stands for whatever ends a process; no code catches it."""


def kill_at(stage):
    """A progress function that ends the run when a stage begins."""

    def progress(name, number, count, left, message):
        if name == stage:
            raise Killed

    return progress


def results(folder):
    """name -> bytes of every file of a result but the report, which holds times, and the stages."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    names = {path.relative_to(folder).as_posix(): path for path in files}
    return {n: p.read_bytes() for n, p in names.items() if n != "report.json" and not n.startswith("stages/")}


def same_results(folder, other):
    ours, theirs = results(folder), results(other)
    assert list(ours) == list(theirs)
    assert [name for name in ours if ours[name] != theirs[name]] == []


@pytest.fixture
def copied(sample_job, tmp_path):
    """A copy of the finished job."""
    return Path(shutil.copytree(sample_job.folder, tmp_path / "result"))


@pytest.fixture
def forbid(monkeypatch):
    """A function that makes stages fail when they are worked out instead of taken from disk."""

    def apply(names):
        for name in names:
            monkeypatch.setattr(pipeline, name, lambda *_, name=name, **__: pytest.fail(f"{name} was called"))

    return apply


@pytest.fixture
def writes_copy(sample_job, monkeypatch):
    """Writing takes the finished job's files: for runs that are about the stages before."""

    def write_results(rig, maps, scan, face, folder, options, title, closer):
        names = [path.name for path in sample_job.folder.iterdir() if path.name not in ("stages", "report.json")]
        for name in names:
            source = sample_job.folder / name
            (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / name)

    monkeypatch.setattr(pipeline, "write_results", write_results)


def test_all_files_are_there(sample_job):
    names = {path.relative_to(sample_job.folder).as_posix() for path in sample_job.folder.rglob("*") if path.is_file()}
    expected = ["rig.glb", "preview.png", "report.json", "CREDITS.txt", "rig/rig.json", "rig/arrays.npz"]
    expected += [f"textures/{name}" for name in ("albedo.png", "normal.png", "coverage.png", "manifest.json")]
    expected += [f"stages/{stage}/{name}" for stage in STAGES for name in ("stage.json", "arrays.npz")]
    assert set(expected) <= names
    assert not [name for name in names if any(part.startswith(".") for part in name.split("/"))]


def test_every_moving_mesh_has_apples_shapes_in_apples_order(sample_job):
    glb = read_glb(sample_job.folder / "rig.glb")
    moving = [mesh for mesh in glb.meshes.values() if len(mesh.deltas)]
    assert {"skin"} < {mesh.name for mesh in moving} < set(glb.meshes)
    for mesh in moving:
        assert list(mesh.target_names) == APPLE and len(mesh.deltas) == 52
    largest = np.max([np.abs(mesh.deltas).max(axis=(1, 2)) for mesh in moving], axis=0)
    assert (largest > 5e-4).all(), "a shape of less than half a millimetre"
    assert read_rig(sample_job.folder / "rig").plain().target_names == tuple(APPLE)


def test_left_is_the_persons_left(sample_job):
    skin = read_glb(sample_job.folder / "rig.glb").meshes["skin"]
    for name in ("eyeBlinkLeft", "mouthSmileLeft", "browDownLeft", "noseSneerLeft"):
        moved = np.linalg.norm(skin.deltas[APPLE.index(name)], axis=1)
        assert (moved @ skin.positions[:, 0]) / moved.sum() > 0.005, name


def test_the_matrix_leads_from_the_glb_to_the_scan_file(sample_job):
    scan = read_scan(sample_path())
    rig = read_rig(sample_job.folder / "rig")
    T = np.array(json.loads((sample_job.folder / "report.json").read_text())["T_rig_to_scan"])
    assert np.allclose(T, rig.info["T_rig_to_scan"], rtol=1e-8)
    skin = read_glb(sample_job.folder / "rig.glb").meshes["skin"].positions.astype(float)
    # The GLB splits vertices at UV seams; the rig's own ones tell which lie in the face.
    face = rig.meshes[0].vertices[rig.regions["face"] & ~rig.regions["nostrils"] & ~rig.regions["eyes"]] / 1000.0
    nearest = np.linalg.norm(skin[:, None] - face[None, ::400], axis=2).min(axis=0)
    assert nearest.max() < 1e-6
    distance = Surface(scan.vertices, scan.faces).closest(face @ T[:3, :3].T + T[:3, 3]).distance
    mm_per_unit = 1000.0 / np.cbrt(np.linalg.det(T[:3, :3]))
    assert np.median(distance) * mm_per_unit < 0.15
    assert np.mean(distance) * mm_per_unit < 0.3


def test_a_second_run_works_nothing_out(sample_job, copied, forbid):
    forbid(WORK)
    report = rig_job(sample_path(), copied, sample_job.options)
    assert all(report["reused"].values()) and list(report["reused"]) == list(STAGES)
    changing = ("reused", "peak_memory_mb")
    assert {k: v for k, v in report.items() if k not in changing} == {
        k: v for k, v in sample_job.report.items() if k not in changing
    }
    assert json.loads((copied / "report.json").read_text()) == report
    same_results(copied, sample_job.folder)


def test_the_number_of_threads_is_no_reason_to_run_again(sample_job, copied, forbid):
    forbid(WORK)
    report = rig_job(sample_path(), copied, replace(sample_job.options, jobs=2))
    assert all(report["reused"].values())


def test_damaged_stages_are_worked_out_again(sample_job, copied, forbid, writes_copy):
    arrays = copied / "stages" / "04-parts" / "arrays.npz"
    content = bytearray(arrays.read_bytes())
    content[len(content) // 2] ^= 1
    arrays.write_bytes(bytes(content))
    (copied / "stages" / "06-bake" / "stage.json").write_text("{")
    (copied / "rig.glb").write_bytes(b"spoilt")
    forbid(("read_scan", "find_landmarks", "register", "shapes_of"))
    report = rig_job(sample_path(), copied, sample_job.options)
    assert [stage for stage in STAGES if not report["reused"][stage]] == ["04-parts", "06-bake", "07-write"]
    assert arrays.read_bytes() == (sample_job.folder / "stages" / "04-parts" / "arrays.npz").read_bytes()
    same_results(copied, sample_job.folder)


def test_from_a_stage_on(sample_job, copied, forbid, writes_copy, monkeypatch, hm08):
    stage = sample_job.folder / "stages" / "03-register"
    info = json.loads((stage / "stage.json").read_text())["info"]
    with np.load(stage / "arrays.npz") as arrays:
        face = unpack_face(arrays, info, hm08)
    forbid(("read_scan", "find_landmarks"))
    monkeypatch.setattr(pipeline, "register", lambda *_: face)
    report = rig_job(sample_path(), copied, replace(sample_job.options, from_stage="register"))
    assert [stage for stage in STAGES if report["reused"][stage]] == ["01-read", "02-landmarks"]
    for stage in STAGES[2:6]:
        again, before = (folder / "stages" / stage / "arrays.npz" for folder in (copied, sample_job.folder))
        assert again.read_bytes() == before.read_bytes(), stage


def test_other_formats_replace_what_is_no_longer_asked_for(sample_job, copied, forbid, monkeypatch):
    own = copied / "textures" / "my notes.txt"
    own.write_text("keep")
    forbid(WORK[:-1])
    monkeypatch.setattr(pipeline, "write_preview", lambda rig, scan, face, path, *_: path.write_bytes(b"picture"))
    report = rig_job(sample_path(), copied, replace(sample_job.options, formats=("obj",)))
    assert [stage for stage in STAGES if not report["reused"][stage]] == ["07-write"]
    assert not (copied / "rig.glb").exists()
    assert list((copied / "obj").rglob("*.obj"))
    assert own.read_text() == "keep"
    report = rig_job(sample_path(), copied, sample_job.options)
    assert (copied / "rig.glb").read_bytes() == (sample_job.folder / "rig.glb").read_bytes()
    assert not (copied / "obj").exists()


def test_a_killed_run_goes_on_wherever_it_was_killed(sample_job, tmp_path, monkeypatch):
    out = tmp_path / "result"
    kill_a_process_in_the_middle_of_registration(out)
    assert (out / "stages" / "02-landmarks").is_dir() and not (out / "stages" / "03-register").is_dir()
    for stage in STAGES:
        with pytest.raises(Killed):
            rig_job(sample_path(), out, sample_job.options, kill_at(stage))
        assert [path.name for path in out.iterdir()] == ["stages"]
    with monkeypatch.context() as patch:  # in the middle of writing
        patch.setattr(pipeline, "write_preview", killed)
        with pytest.raises(Killed):
            rig_job(sample_path(), out, sample_job.options)
        assert [path.name for path in out.iterdir()] == ["stages"]
    with monkeypatch.context() as patch:  # when half of the files are in their places
        patch.setattr(pipeline, "write_preview", lambda rig, scan, face, path, *_: path.write_bytes(b"picture"))
        patch.setattr("facewright.output.os.replace", killed_after(3))
        with pytest.raises(Killed):
            rig_job(sample_path(), out, sample_job.options)
    assert not (out / "report.json").exists()
    report = rig_job(sample_path(), out, sample_job.options)
    assert [stage for stage in STAGES if not report["reused"][stage]] == ["07-write"]
    same_results(out, sample_job.folder)
    assert sorted(path.name for path in (out / "stages").iterdir()) == sorted([*STAGES, "lock"])


def kill_a_process_in_the_middle_of_registration(out):
    process = subprocess.Popen(
        [sys.executable, "-m", "facewright", "demo", "--out", str(out), "--texture-size", "256", "--jobs", "1"],
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 120
    while not (out / "stages" / "02-landmarks").is_dir():
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    time.sleep(0.5)
    process.kill()
    process.wait()


def killed(*_, **__):
    raise Killed


def killed_after(count):
    """os.replace that moves a few result files, then ends the run; stages are moved as ever."""
    true_replace, moved = os.replace, []

    def replaced(source, target):
        if Path(target).parent.name != "stages" and ".result-" in str(source):
            moved.append(target)
            if len(moved) > count and not str(target).endswith(".part"):
                raise Killed
        true_replace(source, target)

    return replaced


def test_another_process_with_more_threads_writes_the_same_bytes(sample_job, tmp_path):
    command = [sys.executable, "-m", "facewright", "rig", str(sample_path()), "--out", str(tmp_path / "result")]
    environment = dict(os.environ, PYTHONHASHSEED="77")
    done = subprocess.run(
        [*command, "--texture-size", "256", "--jobs", "2"], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert "preview.png" in done.stdout and "[7/7] write" in done.stderr
    same_results(tmp_path / "result", sample_job.folder)
    report = json.loads((tmp_path / "result" / "report.json").read_text())
    changing = ("timings_s", "peak_memory_mb", "options")
    assert {k: v for k, v in report.items() if k not in changing} == {
        k: v for k, v in sample_job.report.items() if k not in changing
    }


def test_a_landmark_moved_by_hand_moves_the_fit(sample_job, copied, forbid, tmp_path, hm08):
    def nose_tip(fit):
        i = hm08.landmarks.names.index("mp4")
        return hm08.landmarks.barycentric[i] @ fit[hm08.faces[hm08.landmarks.faces[i]]]

    before = fit_of(sample_job.folder)
    T = np.array(read_rig(copied / "rig").info["T_rig_to_scan"])
    wanted = nose_tip(before) + [5.0, 0.0, 0.0]
    file = tmp_path / "moved.json"
    file.write_text(json.dumps({"nose_tip": (T[:3, :3] @ (wanted / 1000.0) + T[:3, 3]).tolist()}))
    forbid(("read_scan",))
    with pytest.raises(Killed):
        rig_job(sample_path(), copied, replace(sample_job.options, landmarks=str(file)), kill_at("04-parts"))
    after = fit_of(copied)
    assert nose_tip(after)[0] - nose_tip(before)[0] > 2.5
    far = np.flatnonzero(hm08.regions["scalp"])
    assert np.median(np.linalg.norm((after - before)[far], axis=1)) < 1.0


def fit_of(folder):
    with np.load(folder / "stages" / "03-register" / "arrays.npz") as arrays:
        return arrays["fit"]


def test_a_second_run_at_once_is_refused_and_leaves_the_first_alone(tmp_path):
    scan = tmp_path / "flat.obj"
    scan.write_text("v 0 0 0\nv 100 0 0\nv 0 100 0\nf 1 2 3\n")

    def progress(*_):
        before = sorted((tmp_path / "result").rglob("*"))
        with pytest.raises(InputError, match=f"another run .process {os.getpid()}."):
            rig_job(scan, tmp_path / "result", JobOptions())
        assert sorted((tmp_path / "result").rglob("*")) == before
        raise Killed

    with pytest.raises(Killed):
        rig_job(scan, tmp_path / "result", JobOptions(), progress)


def test_input_without_a_face_leaves_an_earlier_result_as_it_was(sample_job, copied, tmp_path):
    scan = tmp_path / "flat.obj"
    scan.write_text("v 0 0 0\nv 100 0 0\nv 0 100 0\nf 1 2 3\n")
    with pytest.raises(InputError):
        rig_job(scan, copied, sample_job.options)
    same_results(copied, sample_job.folder)
    assert (copied / "report.json").is_file()


@pytest.mark.parametrize("changed", [None, "03-register", "05-transfer", "06-bake", "07-write"])
def test_the_time_left_is_that_of_the_stages_that_are_not_in_the_cache(tmp_path, changed):
    def run_stages(depends):
        told = {}
        run = pipeline._Run(StageStore(tmp_path), lambda name, *rest: told.update({name: rest[2]}), len(STAGES))
        for name in STAGES:
            run.stage(name, lambda: ({}, {}), depends if name == changed else None)
        return told

    run_stages("before")
    for name in STAGES:  # a job of 100 seconds
        file = tmp_path / name / "stage.json"
        file.write_text(json.dumps(json.loads(file.read_text()) | {"seconds": 100 * STAGE_SHARE[name]}))
    told = run_stages("after")
    assert list(told) == list(STAGES)
    first = len(STAGES) if changed is None else STAGES.index(changed)
    assert all(told[name] is None for name in STAGES[:first])
    if changed == "03-register":  # all before took 9 % of the time, which says too little
        assert told[changed] is None
    elif changed is not None:
        alone = 100 * BAKE_ALONE_SHARE if changed == "06-bake" else 0.0
        assert told[changed] == pytest.approx(sum(100 * STAGE_SHARE[name] for name in STAGES[first:]) + alone)


def test_names_of_stages():
    assert [pipeline._stage_number(word) for word in ("read", "03", "07-write", None)] == [0, 2, 6, 7]
    with pytest.raises(InputError, match="register"):
        pipeline._stage_number("regster")


def test_options_that_cannot_be():
    for wrong in ({"eyes": "shut"}, {"shapes": "all"}, {"formats": ()}, {"formats": ("fbx",)}, {"jobs": 0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            JobOptions(**wrong)
