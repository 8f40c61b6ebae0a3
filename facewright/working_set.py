"""The working set: every shape with its meaning, region and amplitude, the 26 FACS expressions, the 15 visemes.

All of it is data, in working_set.toml; docs/shapes.md shows it.
"""

from __future__ import annotations

import functools
import sys
from dataclasses import dataclass
from importlib import resources

import numpy as np
from scipy.spatial import cKDTree

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SIDES = ("Left", "Right")


@dataclass(frozen=True)
class Word:
    """One shape of Apple's 52.

    au         FACS action units (Ekman and Friesen 1978)
    region     name of the Region where it may move skin
    side       "left", "right" or None
    at         where its amplitude is measured: "skin", "margin", "corner", "gaze" or "tongue"
    amplitude  (least, most) at weight 1: mm at 63 mm between the eyes, degrees for "gaze"
    halves     names of the left and the right shape that add up to it, or ()
    """

    name: str
    au: tuple[str, ...]
    region: str
    side: str | None
    at: str
    amplitude: tuple[float, float]
    halves: tuple[str, ...]


@dataclass(frozen=True)
class Region:
    """Skin within reach mm (at 63 mm between the eyes) of feature lines, not above `below`, not below `above`."""

    around: tuple[str, ...]
    reach: float
    below: tuple[str, ...] = ()
    above: tuple[str, ...] = ()


@dataclass(frozen=True)
class WorkingSet:
    """words: name -> Word; regions: name -> Region; expressions and visemes: name -> {shape: weight}."""

    words: dict[str, Word]
    regions: dict[str, Region]
    expressions: dict[str, dict[str, float]]
    visemes: dict[str, dict[str, float]]

    def halves(self, names):
        """sum -> (left half, right half) of those of some shape names that have halves."""
        return {name: self.words[name].halves for name in names if name in self.words and self.words[name].halves}


@functools.cache
def read_working_set():
    """The WorkingSet that the package ships."""
    text = resources.files(__package__).joinpath("working_set.toml").read_text(encoding="utf-8")
    document = tomllib.loads(text)
    words = {word.name: word for entry in document["shape"] for word in _words(entry)}
    regions = {
        name: Region(**{key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()})
        for name, entry in document["region"].items()
    }
    expressions = {name: _weights(dict.fromkeys(shapes, 1.0)) for name, shapes in document["expressions"].items()}
    visemes = {name: _weights(weights) for name, weights in document["visemes"].items()}
    return WorkingSet(words, regions, expressions, visemes)


def _words(entry):
    """The one or two Words of an entry of the file."""
    name, common = entry["name"], (tuple(entry["au"]), entry["region"])
    amplitude = (entry["at"], (float(entry["amplitude"][0]), float(entry["amplitude"][1])))
    both = tuple(name + side for side in SIDES)
    if entry.get("sides"):
        return [Word(one, *common, side.lower(), *amplitude, ()) for one, side in zip(both, SIDES)]
    return [Word(name, *common, None, *amplitude, both if entry.get("halves") else ())]


def _weights(weights):
    """shape -> weight with "name*" written out as its Left and its Right."""
    spelt = {}
    for name, weight in weights.items():
        names = [name[:-1] + side for side in SIDES] if name.endswith("*") else [name]
        spelt |= dict.fromkeys(names, float(weight))
    return spelt


def region_depth(vertices, lines, region, side, scale):
    """(n,) how far inside a Region each vertex (n, 3) lies, mm at 63 mm between the eyes; 0 or less is outside.

    lines  feature line -> vertices; side "left", "right" or None for both; scale  brings the head to 63 mm
    """

    def points(names):
        found = [line for name in names for line in _side_lines(lines, name, side)]
        return vertices[np.concatenate(found)]

    depth = region.reach - cKDTree(points(region.around)).query(vertices)[0] * scale
    if region.below:
        depth = np.minimum(depth, (points(region.below)[:, 1].max() - vertices[:, 1]) * scale)
    if region.above:
        depth = np.minimum(depth, (vertices[:, 1] - points(region.above)[:, 1].min()) * scale)
    if side:
        seam = vertices[lines["lip_seam_upper"], 0]
        past = (vertices[:, 0] - seam.mean()) * (1.0 if side == "left" else -1.0)
        depth = np.minimum(depth, (past + 0.5 * np.ptp(seam)) * scale)
    return depth


def _side_lines(lines, name, side):
    if name in lines:
        return [lines[name]]
    return [lines[f"{name}_{one}"] for one in ((side,) if side else ("left", "right"))]
