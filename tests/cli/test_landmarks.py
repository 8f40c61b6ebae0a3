"""`facewright landmarks`: a file to edit and a picture, which the main job takes back."""

from PIL import Image

from facewright.cli.__main__ import main
from facewright.sample import sample_path
from facewright.scan import read_landmarks
from facewright.scan.landmark_files import NAMED


def test_named_points_and_picture(tmp_path, capsys):
    out = tmp_path / "new" / "points.json"
    assert main(["landmarks", str(sample_path()), "--out", str(out)]) == 0
    points = read_landmarks(out)
    assert set(points) == set(NAMED)
    assert "points.png" in capsys.readouterr().out
    with Image.open(out.with_suffix(".png")) as picture:
        assert picture.size[0] > 1000
    assert sorted(path.name for path in out.parent.iterdir()) == ["points.json", "points.png"]
    assert points["eye_outer_left"][0] != points["eye_outer_right"][0]


def test_no_face(tmp_path, capsys):
    cube = tmp_path / "tri.obj"
    cube.write_text("v 0 0 0\nv 100 0 0\nv 0 100 0\nf 1 2 3\n")
    assert main(["landmarks", str(cube), "--out", str(tmp_path / "a.json")]) == 2
    assert capsys.readouterr().err.startswith("facewright:")
    assert not (tmp_path / "a.json").exists()


def test_a_picture_of_the_same_name_is_left_alone(tmp_path, capsys):
    (tmp_path / "head.png").write_text("mine")
    assert main(["landmarks", str(sample_path()), "--out", str(tmp_path / "head.json")]) == 2
    assert "another name" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["head.png"]
