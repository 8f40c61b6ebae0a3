"""Results of stages on disk: arrays and a small JSON each, written by atomic rename and verified when read back."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
            meta = json.loads((folder / "stage.json").read_text())
            if meta["format"] != FORMAT or meta["key"] != key:
                return None
            if file_digest(folder / "arrays.npz") != meta["arrays_sha256"]:
                return None
            with np.load(folder / "arrays.npz", allow_pickle=False) as archive:
                arrays = {field: archive[field] for field in archive.files}
        except (OSError, KeyError, ValueError, zipfile.BadZipFile):
            return None
        return StageResult(arrays, meta["info"], meta["seconds"], True)

    def save(self, name, key, arrays, info, seconds):
        """Store a stage; a reader sees the old one or the new one, never half of it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=self.folder))
        try:
            with open(temporary / "arrays.npz", "wb") as stream:
                np.savez(stream, **arrays)
            digest = file_digest(temporary / "arrays.npz")
            meta = {"format": FORMAT, "key": key, "arrays_sha256": digest, "seconds": seconds, "info": info}
            (temporary / "stage.json").write_text(json.dumps(meta, indent=1, sort_keys=True))
            self._swap(temporary, self.folder / name)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        return StageResult(arrays, info, seconds, False)

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
