"""facewright evaluate prints what a result folder holds, and says what is wrong with one that is none."""

import json

from facewright.cli.__main__ import main
from facewright.write.gltf import write_gltf
from facewright.write.rig import write_rig

FIGURES = {"mean": 0.1, "rms": 0.2, "p95": 0.3, "max": 0.4, "left_out": 0.0}
REGISTRATION = {
    "scan_to_face_mm": FIGURES,
    "face_to_scan_mm": FIGURES,
    "lips": {"scan_to_face_mm": FIGURES, "face_to_scan_mm": FIGURES | {"mean": None}},
    "folded": 2,
}


def result_folder(folder, rig):
    write_rig(rig, folder / "rig")
    (folder / "report.json").write_text(json.dumps({"registration": REGISTRATION}))
    return folder


def test_the_report_is_printed(small_rig, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("facewright.evaluate.rig.measure_neutral", lambda rig: {"vertices": 3})
    assert main(["evaluate", str(result_folder(tmp_path, small_rig))]) == 0
    printed = capsys.readouterr().out
    assert "face scan to face" in printed
    assert "lips face to scan" in printed
    assert "folded" in printed


def test_json_is_json(small_rig, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("facewright.evaluate.rig.measure_neutral", lambda rig: {"vertices": 3})
    assert main(["evaluate", str(result_folder(tmp_path, small_rig)), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["report"]["registration"]["folded"] == 2


def test_a_scan_that_the_rig_was_not_made_from(small_rig, tmp_path, capsys, monkeypatch):
    means = {"lips": 0.3, "face": 40.0}
    monkeypatch.setattr("facewright.evaluate.rig.measure_neutral", lambda rig: {"vertices": 3})
    monkeypatch.setattr("facewright.cli.evaluate.scan_in_rig_frame", lambda *_: None)
    monkeypatch.setattr(
        "facewright.evaluate.rig.measure_rig_distances",
        lambda *_: {name: {"rig_to_scan": FIGURES | {"mean": mean}} for name, mean in means.items()},
    )
    command = ["evaluate", str(result_folder(tmp_path, small_rig)), "--scan", "other.obj"]
    assert main(command) == 0 and capsys.readouterr().err == ""
    for lips in (12.0, None):
        means["lips"] = lips
        assert main(command) == 0 and "nowhere near other.obj" in capsys.readouterr().err
    assert main(["evaluate", "rig", str(tmp_path), "--scan", "other.obj"]) == 2
    assert "leave out --scan" in capsys.readouterr().err


def test_a_folder_that_is_no_result(tmp_path, capsys):
    assert main(["evaluate", str(tmp_path)]) == 2
    assert "rig" in capsys.readouterr().err


def test_a_folder_that_does_not_exist(tmp_path, capsys):
    for words in (["evaluate"], ["evaluate", "rig"]):
        assert main([*words, str(tmp_path / "nope")]) == 2
        assert "nope does not exist" in capsys.readouterr().err


def test_a_result_without_a_report(small_rig, tmp_path, capsys):
    write_rig(small_rig, tmp_path / "rig")
    assert main(["evaluate", str(tmp_path)]) == 2
    assert "report.json" in capsys.readouterr().err


def test_bars_of_any_glb(small_rig, tmp_path, capsys):
    write_gltf(small_rig, tmp_path / "rig.glb")
    assert main(["evaluate", "rig", str(tmp_path / "rig.glb"), "--blends", "0"]) == 0
    printed = capsys.readouterr().out
    assert "no regions" in printed and "folded faces" in printed and "bars met" in printed
    assert main(["evaluate", "rig", str(tmp_path / "rig.glb"), "--blends", "0", "--json"]) == 0
    assert {row["group"] for row in json.loads(capsys.readouterr().out)} == {"shapes", "expressions"}
    assert main(["evaluate", "rig", str(tmp_path / "nothing")]) == 2
