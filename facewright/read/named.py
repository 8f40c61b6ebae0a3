"""named_files: what a scan file names beside itself, so that a change of it is noticed without reading the scan."""

from __future__ import annotations

import json
import re
import urllib.parse
from pathlib import Path

from facewright.errors import InputError
from facewright.read.obj import texture_file
from facewright.read.raw import path_beside

_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.+?)[ \t\r]*$", re.MULTILINE)
_MAP = re.compile(rb"^[ \t]*(?:map_kd|map_kn|norm)[ \t]+(.+?)[ \t\r]*$", re.MULTILINE | re.IGNORECASE)


def named_files(path):
    """Paths of the material libraries, images and buffers that the scan file at path names and that exist."""
    path = Path(path)
    kind = path.suffix.lower()
    if kind == ".gltf":
        return _existing(path, _uris(path))
    if kind != ".obj":
        return []
    libraries = _existing(path, [_text(name) for name in _LIBRARY.findall(path.read_bytes())])
    images = [texture_file(_text(name)) for file in libraries for name in _MAP.findall(file.read_bytes())]
    return libraries + _existing(path, images)


def _uris(path):
    """Names of buffers and images of a .gltf; none where it is no such file, which its reader says better."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        entries = [entry["uri"] for kind in ("buffers", "images") for entry in document.get(kind, ()) if "uri" in entry]
        return [urllib.parse.unquote(uri) for uri in entries if not uri.startswith("data:")]
    except (ValueError, TypeError, AttributeError):
        return []


def _existing(path, names):
    files = []
    for name in dict.fromkeys(names):
        try:
            files.append(path_beside(path, name))
        except InputError:  # missing: the reader says so, or reads without it
            continue
    return files


def _text(name):
    return name.decode("utf-8", "replace")
