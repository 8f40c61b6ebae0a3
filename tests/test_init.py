"""The public API: every name is there, documented, and costs nothing before it is asked for."""

import inspect
import pickle
import subprocess
import sys

import numpy as np
import pytest

import facewright

STATED = """read_scan clean_scan find_landmarks register fit_parts deformation_transfer transfer_shapes bake build_rig
write_gltf write_obj write_rig read_rig read_template list_templates rig_job JobOptions Scan Landmarks Template Face
Mesh Material Skeleton Part Rig InputError StageError""".split()


def test_the_stated_names_are_public():
    assert set(STATED) <= set(facewright.__all__)
    assert set(facewright.__all__) <= set(dir(facewright))


@pytest.mark.parametrize("name", facewright.__all__)
def test_every_name_resolves_and_is_documented(name):
    value = getattr(facewright, name)
    if callable(value):
        assert inspect.getdoc(value), name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="sculpt"):
        facewright.sculpt  # noqa: B018


def test_importing_loads_nothing():
    code = "import sys, facewright; print('numpy' in sys.modules, *(m for m in sys.modules if m[:11] == 'facewright.'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


@pytest.mark.parametrize("name", ["register", "bake"])
@pytest.mark.parametrize("first", ["pass;", "import facewright.pipeline;", "from facewright.bake.maps import bake;"])
def test_a_stage_and_its_package_share_a_name(name, first):
    code = f"{first} from facewright import {name}; print(callable({name}), callable({name}.{name}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "True"]


def test_a_called_package_calls_its_function(monkeypatch):
    monkeypatch.setattr(facewright.bake, "bake", lambda *arguments, **options: (arguments, options))
    assert facewright.bake(1, jobs=2) == ((1,), {"jobs": 2})


def test_the_job_is_picklable():
    assert pickle.loads(pickle.dumps(facewright.rig_job)) is facewright.rig_job
    options = facewright.JobOptions(texture_size=512)
    assert pickle.loads(pickle.dumps(options)) == options


def test_shapes_are_apples():
    assert len(facewright.ARKIT_SHAPES) == len(np.unique(facewright.ARKIT_SHAPES)) == 52
