import numpy as np

from facewright.cache import StageStore, fingerprint


def test_fingerprint_tells_values_apart():
    keys = [fingerprint(x) for x in (1, 1.5, "1", [1], {"a": 1}, np.arange(3), np.arange(3.0), np.arange(4))]
    assert len(set(keys)) == len(keys)
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})


def test_a_stage_comes_back_as_it_was(tmp_path):
    store = StageStore(tmp_path / "stages")
    arrays = {"x": np.linspace(0, 1, 7), "mask": np.array([True, False])}
    store.save("01-a", "key", arrays, {"n": 2}, 0.5)
    again = store.load("01-a", "key")
    assert again.info == {"n": 2} and again.reused
    for name, value in arrays.items():
        assert np.array_equal(again.arrays[name], value) and again.arrays[name].dtype == value.dtype


def test_another_key_or_a_damaged_file_is_a_miss(tmp_path):
    store = StageStore(tmp_path)
    store.save("01-a", "key", {"x": np.zeros(100)}, {}, 0.0)
    assert store.load("01-a", "other") is None
    file = tmp_path / "01-a" / "arrays.npz"
    content = bytearray(file.read_bytes())
    content[200] ^= 1
    file.write_bytes(bytes(content))
    assert store.load("01-a", "key") is None


def test_a_new_result_takes_the_old_ones_place_and_nothing_is_left_over(tmp_path):
    store = StageStore(tmp_path)
    for value in range(3):
        store.save("01-a", f"key{value}", {"x": np.full(3, value)}, {}, 0.0)
    assert store.load("01-a", "key2").arrays["x"][0] == 2
    assert [path.name for path in tmp_path.iterdir()] == ["01-a"]


def test_what_a_killed_run_left_is_swept(tmp_path):
    (tmp_path / ".01-a-abc").mkdir()
    (tmp_path / ".old-xyz").mkdir()
    StageStore(tmp_path).sweep()
    assert not list(tmp_path.iterdir())
