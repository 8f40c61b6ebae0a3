"""Made scans with known truth for the benchmarks, kept under bench/cache: ten people per template."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, replace

import numpy as np
from common import CACHE, EXTERNAL_TEMPLATES

from facewright.data import Scan, Template
from facewright.errors import InputError
from facewright.evaluate.synthetic import (
    SyntheticOptions,
    centered_between_eyes,
    random_identity,
    synthetic_scan,
    with_fewer_modes,
)
from facewright.template.modifiers import build_basis, is_macro, read_modifiers, sample_identity, split_names
from facewright.template.store import read_template

SEEDS = tuple(range(10))
ICT_MODES_OF_THE_FIT = 20
RECIPE = 8
"""Counted up when what a seed makes changes, so that old cache files are not taken for new ones."""


@dataclass(frozen=True)
class Case:
    """One made scan: scan in millimetres, truth (n, 3) in its frame, surface (V, F) without noise."""

    name: str
    scan: Scan
    truth: np.ndarray
    surface: tuple[np.ndarray, np.ndarray]


def find_benchmark_template(name):
    """A Template by name: shipped, fetched by the user, or built beside the project; None where there is none."""
    for place in (name, EXTERNAL_TEMPLATES / name):
        try:
            return read_template(place)
        except InputError:
            continue
    return None


def fingerprint(template, *more):
    """Short digest of what a made scan depends on in its template, and of anything else (by repr)."""
    digest = hashlib.sha256(repr(more).encode())
    for array in (template.vertices, template.faces, template.identity_basis):
        digest.update(np.ascontiguousarray(array).tobytes())
    for name in ("outer", "face", "lip_upper", "lip_lower"):
        digest.update(template.regions[name].tobytes())
    return digest.hexdigest()[:16]


def fitting_template(template):
    """The template as the fit may use it: without the modes that its test persons were made of."""
    if template.info["name"] != "hm08":
        return with_fewer_modes(template, ICT_MODES_OF_THE_FIT)
    path = CACHE / f"hm08-test-basis-{fingerprint(template)}.npz"
    if not path.is_file():
        modifiers = read_modifiers("hm08")
        kept, _ = split_names(modifiers.names)
        CACHE.mkdir(exist_ok=True)
        np.savez(path, basis=build_basis(modifiers, kept, len(template.identity_basis)))
    with np.load(path) as stored:
        return replace(template, identity_basis=stored["basis"])


def person(template, seed):
    """(n, 3) vertices of a test person: ICT with all its modes, hm08 with the modifiers that the test basis lacks."""
    if template.info["name"] != "hm08":
        return random_identity(template, seed)
    modifiers = read_modifiers("hm08")
    _, left_out = split_names(modifiers.names)
    names = [name for name in modifiers.names if name in set(left_out) or is_macro(name)]
    delta = sample_identity(modifiers, np.random.default_rng([seed, 1]), names)
    return centered_between_eyes(template.vertices + delta, template)


def make_case(template: Template, seed, options=None):
    """The Case of a seed, from the cache if it is there."""
    options = options or SyntheticOptions(open_back=seed % 3 == 2)
    digest = fingerprint(template, RECIPE, seed, sorted(asdict(options).items()))
    path = CACHE / f"{template.info['name']}-{seed}-{digest}.npz"
    if not path.is_file():
        scan, truth = synthetic_scan(template, person(template, seed), seed, options)
        CACHE.mkdir(exist_ok=True)
        arrays = {"vertices": scan.vertices, "faces": scan.faces, "colors": scan.colors, "truth": truth["vertices"]}
        arrays |= {"surface_vertices": truth["surface"][0], "surface_faces": truth["surface"][1]}
        np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    with np.load(path) as stored:
        colors = stored.get("colors")
        name = f"{template.info['name']}-{seed}"
        scan = Scan(stored["vertices"], stored["faces"], colors=colors, unit_mm=1.0, name=name)
        return Case(name, scan, stored["truth"], (stored["surface_vertices"], stored["surface_faces"]))
