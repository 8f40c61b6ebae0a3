"""Results of stages on disk: arrays and a small JSON each, written by atomic rename and verified when read back."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facewright.errors import InputError

FORMAT = 1


@dataclass(frozen=True)
class StageResult:
    """arrays name -> ndarray; info JSON-able; seconds that the stage took when it ran; reused from disk or not."""

    arrays: dict[str, np.ndarray]
    info: dict[str, Any]
    seconds: float
    reused: bool


def fingerprint(*values):
    """Hex digest of JSON-able values, bytes and arrays: equal input, equal digest, on every machine."""
    digest = hashlib.sha256()
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype}{value.shape}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, bytes):
            digest.update(value)
        else:
            digest.update(json.dumps(value, sort_keys=True, default=str).encode())
        digest.update(b"\0")
    return digest.hexdigest()


def file_digest(path):
    """Hex digest of a file's bytes."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest() if hasattr(hashlib, "file_digest") else _digest(stream)


def _digest(stream):
    digest = hashlib.sha256()
    for block in iter(lambda: stream.read(1 << 20), b""):
        digest.update(block)
    return digest.hexdigest()


class StageStore:
    """The folder stages/ of one result."""

    def __init__(self, folder):
        self.folder = Path(folder)

    def load(self, name, key):
        """The StageResult stored under this name and key, or None if there is none or it is damaged."""
        folder = self.folder / name
        try:
            meta = json.loads((folder / "stage.json").read_text(encoding="utf-8"))
            if meta["format"] != FORMAT or meta["key"] != key or fingerprint(meta["info"]) != meta["info_sha256"]:
                return None
            if file_digest(folder / "arrays.npz") != meta["arrays_sha256"]:
                return None
            with np.load(folder / "arrays.npz", allow_pickle=False) as archive:
                arrays = {field: archive[field] for field in archive.files}
        except (OSError, KeyError, TypeError, ValueError, EOFError, zipfile.BadZipFile, zlib.error):
            return None
        return StageResult(arrays, meta["info"], meta["seconds"], True)

    def last_info(self, name):
        """The info last stored under this name, whatever its key; {} if there is none that can be read."""
        try:
            info = json.loads((self.folder / name / "stage.json").read_text(encoding="utf-8"))["info"]
        except (OSError, KeyError, TypeError, ValueError):
            return {}
        return info if isinstance(info, dict) else {}

    def save(self, name, key, arrays, info, seconds):
        """Store a stage; a reader sees the old one or the new one, never half of it. Returns what load would give."""
        info = json.loads(json.dumps(info))
        meta = {"format": FORMAT, "key": key, "seconds": seconds, "info": info, "info_sha256": fingerprint(info)}
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            temporary = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=self.folder))
            try:
                self._fill(temporary, arrays, meta)
                self._swap(temporary, self.folder / name)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
        except OSError as error:
            raise InputError(
                f"stages: cannot write {self.folder / name} ({error.strerror}); make room or choose another --out"
            ) from error
        return StageResult(arrays, info, seconds, False)

    def _fill(self, folder, arrays, meta):
        with open(folder / "arrays.npz", "wb") as stream:
            np.savez(stream, **arrays)
        meta = meta | {"arrays_sha256": file_digest(folder / "arrays.npz")}
        (folder / "stage.json").write_text(json.dumps(meta, indent=1, sort_keys=True), encoding="utf-8")

    def _swap(self, temporary, final):
        trash = None
        if final.exists():
            trash = Path(tempfile.mkdtemp(prefix=".old-", dir=self.folder))
            os.replace(final, trash / "stage")
        os.replace(temporary, final)
        if trash is not None:
            shutil.rmtree(trash, ignore_errors=True)

    def sweep(self):
        """Remove what a killed run left behind."""
        for leftover in self.folder.glob(".*-*"):
            shutil.rmtree(leftover, ignore_errors=True)
