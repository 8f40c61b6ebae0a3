"""In-betweens act by hat functions, correctives by the product of their drivers."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from facewright.expand import expand_weights

STEPS = {"blink": {0.5: "blink@0.5"}, "jaw": {0.25: "jaw@0.25", 0.75: "jaw@0.75"}}
PAIRS = {"blink+squint": ("blink", "squint"), "all": ("blink", "squint", "jaw")}
TWIN = Path(__file__).resolve().parents[1] / "facewright" / "web" / "expand.mjs"


@pytest.mark.parametrize(
    ("weight", "wanted"),
    [
        (0.25, {"blink@0.5": 0.5}),
        (0.5, {"blink@0.5": 1.0}),
        (0.75, {"blink@0.5": 0.5, "blink": 0.5}),
        (1.0, {"blink": 1.0}),
        (0.0, {}),
    ],
)
def test_hats(weight, wanted):
    assert expand_weights({"blink": weight}, STEPS, PAIRS) == wanted


def test_weights_of_a_path_sum_to_one_past_the_first_step():
    for weight in np.linspace(0.25, 1.0, 7):
        assert sum(expand_weights({"jaw": weight}, STEPS, {}).values()) == pytest.approx(1.0)


def test_products_and_clipping():
    found = expand_weights({"blink": 0.5, "squint": 2.0, "jaw": -1.0}, {}, PAIRS)
    assert found["blink+squint"] == 0.5 and "all" not in found and found["squint"] == 2.0


def test_weights_beyond_one_go_on_along_the_last_piece():
    assert expand_weights({"blink": 1.5}, STEPS, {}) == {"blink@0.5": -1.0, "blink": 2.0}
    assert expand_weights({"blink": -0.5}, STEPS, {}) == {"blink@0.5": -1.0}


def test_names_are_checked_where_they_are_known():
    assert expand_weights({"wink": 1.0}, STEPS, PAIRS) == {"wink": 1.0}
    assert expand_weights({"jaw": 0.5}, {}, {}, HALVES, ("jawLeft", "jawRight")) == {"jawLeft": 0.5, "jawRight": 0.5}
    with pytest.raises(ValueError, match="no shape 'wink'"):
        expand_weights({"jaw": 0.5, "wink": 1.0}, {}, {}, HALVES, ("jawLeft", "jawRight"))


HALVES = {"jaw": ("jawLeft", "jawRight")}


def test_a_sum_is_given_to_its_halves_and_drives_as_their_mean():
    found = expand_weights({"jaw": 0.5, "jawLeft": 0.25, "blink": 1.0}, {}, {"blink+jaw": ("blink", "jaw")}, HALVES)
    assert found == {"jawLeft": 0.75, "jawRight": 0.5, "blink": 1.0, "blink+jaw": 0.625}


def node(code):
    return subprocess.run(["node", "--input-type=module", "-e", code], capture_output=True, text=True)


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_the_javascript_twin_checks_names_too():
    code = f"import {{ expandWeights }} from {json.dumps(TWIN.as_uri())};"
    code += f"const check = (pose) => expandWeights(pose, {{}}, {{}}, {json.dumps(HALVES)}, ['jawLeft', 'jawRight']);"
    assert node(code + "console.log(check({ jaw: 1 }));").returncode == 0
    assert "the rig has no shape 'wink'" in node(code + "check({ jaw: 1, wink: 0 });").stderr


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_the_javascript_twin_says_the_same():
    rng = np.random.default_rng(0)
    poses = [dict(zip(("blink", "squint", "jaw", "smile"), rng.uniform(-0.5, 1.5, 4))) for _ in range(50)]
    poses += [{"blink": 0.5}, {"jaw": 0.25, "blink": 1.0}, {}, {"jawLeft": 0.5, "squint": 1.0, "blink": 0.7}]
    code = (
        f"import {{ expandWeights }} from {json.dumps(TWIN.as_uri())};"
        f"const [poses, steps, pairs, halves] = {json.dumps([poses, STEPS, PAIRS, HALVES])};"
        "const both = (pose) => [expandWeights(pose, steps, pairs), expandWeights(pose, steps, pairs, halves)];"
        "console.log(JSON.stringify(poses.map(both)));"
    )
    for pose, answers in zip(poses, json.loads(node(code).stdout)):
        for theirs, halves in zip(answers, (None, HALVES)):
            ours = expand_weights(pose, STEPS, PAIRS, halves)
            assert ours.keys() == theirs.keys()
            assert all(ours[name] == pytest.approx(theirs[name], abs=1e-12) for name in ours)
