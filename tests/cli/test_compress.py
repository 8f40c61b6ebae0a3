"""The command line of FaceZip from images to a packed set and back, and what it says about bad input."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from facewright.cli.__main__ import main
from facewright.cli.compress import parse_size
from facewright.cli.decompress import parse_weights
from facewright.compress.folder import read_packed
from facewright.compress.synthetic import expression_set
from facewright.errors import InputError

QUAD = "v 0 0 0\nv 100 0 0\nv 100 100 0\nv 0 100 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
NAMES = ("smile", "frown", "jaw", "blink", "sneer", "puff")


@pytest.fixture
def command(tmp_path):
    made = expression_set((48, 56), len(NAMES))
    grey = [image[:, :, 0].astype(np.uint16) * 100 for image in [made.neutral, *made.textures]]
    (tmp_path / "textures").mkdir()
    (tmp_path / "height").mkdir()
    Image.fromarray(made.neutral).save(tmp_path / "neutral.png")
    Image.fromarray(grey[0]).save(tmp_path / "height.png")
    for name, texture, deep in zip(NAMES, made.textures, grey[1:]):
        Image.fromarray(texture).save(tmp_path / "textures" / f"{name}.png")
        Image.fromarray(deep).save(tmp_path / "height" / f"{name}.png")
    (tmp_path / "mesh.obj").write_text(QUAD)
    return [
        "compress",
        f"{tmp_path}/textures",
        "--neutral",
        f"{tmp_path}/neutral.png",
        "--mesh",
        f"{tmp_path}/mesh.obj",
    ]


def run(command, tmp_path, *more):
    return main([*command, "--out", f"{tmp_path}/packed", "--quiet", *more])


def test_compress_and_decompress(tmp_path, command, capsys):
    assert run(command, tmp_path, "--textures", "6") == 0
    assert "preview.html is left out" in capsys.readouterr().out  # six textures are more than the shader reads
    frame = tmp_path / "frame.png"
    assert main(["decompress", f"{tmp_path}/packed", "--weights", "smile=1", "--out", str(frame)]) == 0
    assert capsys.readouterr().out == f"{frame}: 56 x 48 pixels\n"
    smile = np.array(Image.open(tmp_path / "textures" / "smile.png")).astype(int)
    assert np.abs(np.array(Image.open(frame)).astype(int) - smile).max() <= 1


def test_the_folder_holds_what_the_index_names_and_a_page_without_links(tmp_path, command):
    assert run(command, tmp_path) == 0
    about = json.loads((tmp_path / "packed" / "facezip.json").read_text())
    images = [about["maps"]["color"]["neutral"], *about["maps"]["color"]["differences"], *about["weights"]["atlas"]]
    files = {path.name for path in (tmp_path / "packed").iterdir()}
    named = {image[key] for image in images for key in ("file", "ktx2") if key in image}
    assert files == named | {"facezip.json", "facezip.glsl", "facezip.hlsl", "preview.html"}
    page = (tmp_path / "packed" / "preview.html").read_text()
    assert "http" not in page.replace("http-equiv", "") and " src=" not in page and "facezipWeights" in page


def test_every_option_together(tmp_path, command, capsys):
    region = np.zeros((48, 56), np.uint8)
    region[:, 28:] = 255
    Image.fromarray(region).save(tmp_path / "half.png")
    B = np.random.default_rng(0).random((len(NAMES), 8))
    rows = [",".join(["texture", *(f"s{m}" for m in range(8))])]
    rows += [",".join([name, *map(str, weights)]) for name, weights in zip(NAMES, B)]
    (tmp_path / "examples.csv").write_text("\n".join(rows))
    more = ["--keep", "jaw", "--priority", f"{tmp_path}/half.png", "--examples", f"{tmp_path}/examples.csv", "--align"]
    more += ["--also", "height", f"{tmp_path}/height", f"{tmp_path}/height.png", "--budget", "1MB", "--ktx2", "none"]
    assert run(command, tmp_path, *more) == 0
    told = capsys.readouterr().out
    assert "8 shapes, weights within" in told and "with shared weights" in told
    packed = read_packed(tmp_path / "packed", "height")
    assert packed.names == tuple(f"s{m}" for m in range(8)) and packed.neutral.dtype == np.uint16
    assert not list((tmp_path / "packed").glob("*.ktx2"))
    assert run(command, tmp_path, "--method", "paper", "--masks", "6", "--region", f"{tmp_path}/half.png") == 0


def test_a_budget_sets_the_number_of_difference_textures(tmp_path, command, capsys):
    assert run(command, tmp_path, "--budget", f"{3 * 48 * 56 * 3 + 6 * 4 * 6 * 7}") == 0
    assert len(read_packed(tmp_path / "packed").textures) == 2
    assert run(command, tmp_path, "--budget", "5KB") == 2
    assert "too small" in capsys.readouterr().err


@pytest.mark.parametrize("text,size", [("8MB", 8_000_000), ("1.5 KiB", 1536), ("1e6", 1_000_000)])
def test_sizes(text, size):
    assert parse_size(text) == size


def test_evaluate_compression(tmp_path, command, capsys):
    out = tmp_path / "figures"
    assert main(["evaluate", "compression", *command[1:], "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert all(word in told for word in ("PCA(8)", "published", "refined", "random restarts"))
    tables = {"table.csv", "expressions.csv", "masks.csv", "restarts.csv", "figures.json"}
    plots = {"errors.png", "permutation.png", "masks.png", "worst.png", "median.png"}
    assert {path.name for path in out.iterdir()} == tables | plots
    assert (
        len((out / "masks.csv").read_text().splitlines()) == 2
    )  # four vertices hold four masks, however many are asked
    assert main(["evaluate", "compression", command[1]]) == 2
    assert "give --neutral IMAGE and --mesh OBJ" in capsys.readouterr().err


def keep_three(folder):
    for name in NAMES[3:]:
        (folder / "textures" / f"{name}.png").unlink()


def make_alike(folder):
    for name in NAMES:
        shutil.copy(folder / "neutral.png", folder / "textures" / f"{name}.png")


def repeat_three(folder):
    for name, other in zip(NAMES[3:], NAMES):
        shutil.copy(folder / "textures" / f"{other}.png", folder / "textures" / f"{name}.png")


@pytest.mark.parametrize("spoil", [keep_three, make_alike, repeat_three])
def test_evaluate_compression_of_fewer_different_textures_than_clusters(tmp_path, command, spoil, capsys):
    spoil(tmp_path)
    out = tmp_path / "figures"
    assert main(["evaluate", "compression", *command[1:], "--out", str(out), "--json"]) == 0
    for text in (capsys.readouterr().out, (out / "figures.json").read_text()):
        table = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))["table"]
        assert {row["method"] for row in table} >= {"PCA(4)", "refined"} and "published" not in str(table)
    assert not (out / "masks.csv").exists()


def test_evaluate_compression_replaces_its_own_files_only(tmp_path, command):
    assert run(command, tmp_path) == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "packed").iterdir()}
    evaluate = ["evaluate", "compression", *command[1:], "--out", f"{tmp_path}/packed", "--json"]
    assert main(evaluate) == 0
    assert (tmp_path / "packed" / "permutation.png").exists()
    keep_three(tmp_path)
    assert main(evaluate) == 0
    assert not (tmp_path / "packed" / "permutation.png").exists()
    assert {name: (tmp_path / "packed" / name).read_bytes() for name in before} == before


def test_a_result_never_lies_among_its_inputs(tmp_path, command, capsys):
    before = (tmp_path / "neutral.png").read_bytes()
    for out in (tmp_path, tmp_path / "textures", tmp_path / "textures" / ".." / "textures"):
        assert main([*command, "--out", str(out), "--quiet"]) == 2
        assert "a folder of its own" in capsys.readouterr().err
        assert main(["evaluate", "compression", *command[1:], "--out", str(out), "--json"]) == 2
        assert "a folder of its own" in capsys.readouterr().err
    assert (tmp_path / "neutral.png").read_bytes() == before
    assert len(list((tmp_path / "textures").iterdir())) == len(NAMES)


def test_previews_of_an_earlier_set_go_with_it(tmp_path, command):
    also = ["--also", "height map", f"{tmp_path}/height", f"{tmp_path}/height.png"]
    assert run(command, tmp_path, *also) == 0
    assert {path.name for path in (tmp_path / "packed").glob("*.html")} == {"preview.html", "preview_height_map.html"}
    assert run(command, tmp_path, "--textures", "5") == 0
    assert not list((tmp_path / "packed").glob("*.html"))


def test_example_shapes_count_in_the_budget_and_equal_textures_do_not(tmp_path, command):
    cells = 4 * 6 * 7
    repeat_three(tmp_path)
    image = 3 * 48 * 56
    assert run(command, tmp_path, "--budget", str(4 * image + 3 * cells)) == 0
    assert len(read_packed(tmp_path / "packed").textures) == 3
    rows = [",".join(["texture", *(f"s{m}" for m in range(40))])]
    rows += [",".join([name, *(str((m % 7) / 7 + n) for m in range(40))]) for n, name in enumerate(NAMES)]
    (tmp_path / "examples.csv").write_text("\n".join(rows))
    more = ["--examples", f"{tmp_path}/examples.csv", "--ktx2", "none"]
    for budget in (4 * image + 29 * cells, 4 * image + 30 * cells):
        assert run(command, tmp_path, *more, "--budget", str(budget)) == 0
        about = json.loads((tmp_path / "packed" / "facezip.json").read_text())
        assert about["bytes"]["memory"] <= budget
        assert len(about["maps"]["color"]["differences"]) == (3 if budget >= 4 * image + 30 * cells else 2)


@pytest.mark.parametrize(
    "rows,words",
    [
        (["texture,a,b", *(f"{name},1,2" for name in NAMES[1:])], "no rows for smile"),
        (["texture,a,b", *(f"{name},1,2" for name in NAMES), "jaw,3,4"], "2 rows for jaw"),
        (["texture,a,b", *(f"{name},1" for name in NAMES)], "shapes in the first line: 2, weights for"),
        (["texture,a,b", *(f"{name},1,nan" for name in NAMES)], "no finite number"),
        (["texture,a,b", *(f"{name},1,x" for name in NAMES)], "cannot be read"),
        (["texture,a,a", *(f"{name},1,2" for name in NAMES)], "each once"),
        (["texture", *NAMES], "must name the shapes"),
        ([], "cannot be read"),
    ],
)
def test_tables_that_say_too_little_are_refused(tmp_path, command, capsys, rows, words):
    (tmp_path / "examples.csv").write_text("\n".join(rows))
    assert run(command, tmp_path, "--examples", f"{tmp_path}/examples.csv") == 2
    told = capsys.readouterr().err
    assert words in told and len(told.splitlines()) == 1 and not (tmp_path / "packed").exists()


def test_rows_of_other_textures_are_told(tmp_path, command, capsys):
    rows = ["texture,a,b", *(f"{name},{n},2" for n, name in enumerate(NAMES)), "wink,3,4", "neutral,0,0"]
    (tmp_path / "examples.csv").write_text("\n".join(rows))
    assert run(command, tmp_path, "--examples", f"{tmp_path}/examples.csv", "--ktx2", "none") == 0
    assert "2 rows left out, of textures that are not in the set: wink, neutral" in capsys.readouterr().out


@pytest.mark.parametrize(
    "weights,wanted",
    [
        ("smile=0.5, jaw=1", {"smile": 0.5, "jaw": 1}),
        ("a,b=1,c=d=-2", {"a,b": 1, "c=d": -2}),
        ("x, y=1 , z=2,", {"x, y": 1, "z": 2}),
        ("q=,1=0.5,2,a=1", {"q=,1": 0.5, "2,a": 1}),
        ("", {}),
    ],
)
def test_weights(weights, wanted):
    assert parse_weights(weights) == wanted


@pytest.mark.parametrize("weights", ["smile", "smile=", "smile=high", "smile=nan", "smile=1,jaw=inf", "smile=1,jaw"])
def test_weights_that_are_none(weights):
    with pytest.raises(InputError, match="no list of NAME=WEIGHT"):
        parse_weights(weights)


def test_weights_that_name_an_expression_twice():
    with pytest.raises(InputError, match="names smile twice"):
        parse_weights("smile=1,jaw=0.2, smile=0.5")


def test_weights_too_large_to_blend_and_steps_that_are_none(tmp_path, command, capsys):
    assert run(command, tmp_path, "--ktx2", "none") == 0
    frame = ["decompress", f"{tmp_path}/packed", "--out", f"{tmp_path}/frame.png", "--weights"]
    assert main([*frame, "smile=1e300"]) == 2
    assert "too large to blend" in capsys.readouterr().err
    index = tmp_path / "packed" / "facezip.json"
    about = json.loads(index.read_text())
    about["maps"]["color"]["differences"][0]["step"] = [float("nan")] * 3
    index.write_text(json.dumps(about))
    assert main([*frame, "smile=1"]) == 2
    told = capsys.readouterr().err
    assert "do not fit each other" in told and len(told.splitlines()) == 1
    assert not (tmp_path / "frame.png").exists()


def test_decompress_writes_png_only(tmp_path, capsys):
    assert main(["decompress", str(tmp_path), "--weights", "a=1", "--out", f"{tmp_path}/frame.jpg"]) == 2
    assert "ends in .png" in capsys.readouterr().err


def test_an_error_stands_on_a_line_of_its_own(tmp_path, command, capsys):
    (tmp_path / "textures" / "zz.png").write_bytes(b"")
    assert main([*command, "--out", f"{tmp_path}/packed"]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("facewright: ")


def broken_texture(folder):
    (folder / "textures" / "broken.png").write_bytes(b"\x89PNG")


def truncated_texture(folder):
    path = folder / "textures" / "jaw.png"
    path.write_bytes(path.read_bytes()[:1500])


def other_size(folder):
    Image.new("RGB", (20, 20)).save(folder / "textures" / "small.png")


def uv_outside(folder):
    (folder / "mesh.obj").write_text(QUAD.replace("vt 1 1", "vt 1.5 1"))


def no_uv(folder):
    (folder / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def no_faces(folder):
    (folder / "mesh.obj").write_text("")


def no_textures(folder):
    for path in (folder / "textures").iterdir():
        path.unlink()


@pytest.mark.parametrize(
    "spoil,words",
    [
        (broken_texture, "broken.png"),
        (truncated_texture, "jaw.png"),
        (other_size, "export all textures alike"),
        (uv_outside, "beyond the image"),
        (no_uv, "without UVs"),
        (no_faces, "holds no faces"),
        (no_textures, "holds no images"),
    ],
)
def test_bad_input_ends_in_exit_code_2_and_leaves_nothing(tmp_path, command, capsys, spoil, words):
    spoil(tmp_path)
    assert run(command, tmp_path) == 2
    told = capsys.readouterr().err
    assert words in told and len(told.strip().splitlines()) == 1
    assert not (tmp_path / "packed").exists()


@pytest.mark.parametrize(
    "more,words",
    [
        (["--method", "paper", "--textures", "5", "--keep", "jaw"], "--keep works with"),
        (["--keep", "grin"], "no such texture"),
        (["--budget", "lots"], "is no size"),
        (["--masks", "0"], "at least 1"),
        (["--masks", "9"], "--masks works with --method paper only"),
        (["--region", "half.png"], "--region works with --method paper only"),
        (["--textures", "9"], "1 to 8"),
        (["--textures", "0"], "1 to 8"),
        (["--budget", "1e999"], "is no size"),
        (["--also", "color", "x", "y"], "a name of its own"),
        (["--also", "co/lor", "x", "y", "--also", "co lor", "x", "y"], "a name of its own"),
    ],
)
def test_bad_options_are_one_sentence(tmp_path, command, capsys, more, words):
    assert run(command, tmp_path, *more) == 2
    assert words in capsys.readouterr().err


def test_fewer_textures_than_clusters(tmp_path, command, capsys):
    for name in NAMES[3:]:
        (tmp_path / "textures" / f"{name}.png").unlink()
    assert run(command, tmp_path, "--method", "paper") == 2
    assert "cannot form 4 clusters" in capsys.readouterr().err
    assert run(command, tmp_path) == 0


def test_a_full_disk_leaves_nothing(tmp_path, command, capsys, monkeypatch):
    real = Path.write_bytes

    def write_bytes(self, data):
        if len(data):
            raise OSError(28, "No space left on device")
        return real(self, data)

    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    assert run(command, tmp_path) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert not (tmp_path / "packed").exists()


def test_a_disk_that_fills_up_in_a_comparison_is_told_by_the_file(tmp_path, command, capsys, monkeypatch):
    for name in NAMES[3:]:  # fewer than clusters: no published method, no search
        (tmp_path / "textures" / f"{name}.png").unlink()
    real = Path.write_bytes

    def write_bytes(self, data):
        if self.name == "worst.png":
            raise OSError(28, "No space left on device")
        return real(self, data)

    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    out = tmp_path / "figures"
    assert main(["evaluate", "compression", *command[1:], "--out", str(out), "--json"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"facewright: {out / 'worst.png'}: cannot write") and len(told.splitlines()) == 1
    assert not out.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_summary_that_cannot_be_written_is_one_sentence(tmp_path, command):
    arguments = [sys.executable, "-m", "facewright", *command, "--out", f"{tmp_path}/packed", "--quiet"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(arguments, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and "No space left on device" in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_a_killed_run_leaves_no_index_and_the_next_one_cleans_up(tmp_path, command):
    out = tmp_path / "packed"
    code = "import signal, sys, time\nfrom facewright.compress import folder\nreal = folder._Store.text\n"
    code += "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"  # where the tests themselves run under nohup
    code += "folder._Store.text = lambda self, *a: (real(self, *a), print('written', flush=True), time.sleep(60))\n"
    code += "from facewright.cli.__main__ import main\nsys.exit(main(sys.argv[1:]))\n"

    def begin(out):
        arguments = [sys.executable, "-c", code, *command, "--out", str(out), "--quiet"]
        process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stdout.readline().strip() == "written"
        return process

    process = begin(out)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not [path for path in out.iterdir() if not path.name.startswith(".facezip-")]
    for request in (signal.SIGTERM, signal.SIGHUP):
        process = begin(tmp_path / "other")
        process.send_signal(request)
        assert "stopped" in process.communicate()[1] and process.returncode == 130
        assert not (tmp_path / "other").exists()
    time.sleep(0.1)
    assert run(command, tmp_path) == 0
    assert not list(out.glob(".facezip-*")) and (out / "facezip.json").exists()
