"""A Rig written and read back is the same Rig, to the bit."""

import json

import numpy as np
import pytest

from facewright.errors import InputError
from facewright.write.rig import ARRAYS, DESCRIPTION, read_rig, write_rig

ARRAY_FIELDS = ("vertices", "faces", "polygons", "uv", "uv_faces", "uv_polygons", "skin_weights")


def test_read_gives_what_was_written(small_rig, tmp_path):
    write_rig(small_rig, tmp_path / "rig")
    back = read_rig(tmp_path / "rig")
    for mesh, other in zip(small_rig.meshes, back.meshes, strict=True):
        assert (mesh.name, mesh.material) == (other.name, other.material)
        for name in ARRAY_FIELDS:
            assert np.array_equal(getattr(mesh, name), getattr(other, name)), name
    assert np.array_equal(back.meshes[0].deltas, small_rig.meshes[0].deltas) and back.meshes[1].deltas is None
    assert back.target_names == small_rig.target_names and back.info == small_rig.info
    assert (back.skeleton.names, back.skeleton.parents) == (small_rig.skeleton.names, small_rig.skeleton.parents)
    assert np.array_equal(back.skeleton.positions, small_rig.skeleton.positions)
    assert back.in_betweens == small_rig.in_betweens and back.correctives == small_rig.correctives
    assert back.halves == small_rig.halves and back.visemes == small_rig.visemes
    assert back.expressions == small_rig.expressions
    for kind in ("maps", "regions", "lines"):
        mine, theirs = getattr(small_rig, kind), getattr(back, kind)
        assert list(mine) == list(theirs) and all(np.array_equal(mine[k], theirs[k]) for k in mine)


def test_same_rig_same_bytes(small_rig, tmp_path):
    for name in ("a", "b"):
        write_rig(small_rig, tmp_path / name)
    write_rig(read_rig(tmp_path / "a"), tmp_path / "c")
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*.*"))
    assert [str(path) for path in files] == [ARRAYS, "maps/albedo.png", "maps/normal.png", DESCRIPTION]
    for path in files:
        contents = {(tmp_path / name / path).read_bytes() for name in ("a", "b", "c")}
        assert len(contents) == 1, path


def test_names_cannot_leave_the_folder(small_rig, tmp_path):
    small_rig.maps["../../evil"] = small_rig.maps["albedo"]
    write_rig(small_rig, tmp_path / "rig")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig"]
    assert set(read_rig(tmp_path / "rig").maps) == {"albedo", "normal", "../../evil"}


def test_broken_folders_are_refused(small_rig, tmp_path):
    folder = tmp_path / "rig"
    with pytest.raises(InputError, match=r"rig\.json is missing"):
        read_rig(folder)
    write_rig(small_rig, folder)
    description = json.loads((folder / DESCRIPTION).read_text())
    for change, match in (
        ({"format": 2}, "format 2"),
        ({"arrays_sha256": "0"}, "not the one"),
        ({"maps": {"albedo": {"file": "../../x.png", "shape": [1]}}}, "outside"),
        ({"meshes": [{"name": "skin"}]}, "cannot be read"),
    ):
        (folder / DESCRIPTION).write_text(json.dumps(description | change))
        with pytest.raises(InputError, match=match):
            read_rig(folder)
    (folder / DESCRIPTION).write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        read_rig(folder)
