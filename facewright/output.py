"""The output folder of a job: made, checked, filled at once by one run at a time, and taken back when the input turns
out to be unusable.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

from facewright.cache import file_digest
from facewright.errors import InputError
from facewright.lock import Locked, locked

RESULTS = ("rig.glb", "obj", "rig", "textures", "preview.png", "report.json", "CREDITS.txt")


class OutputFolder:
    """The folder given by --out, with its results and stages/."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.stages = self.folder / "stages"
        # What this run makes is taken back when it fails; what was there before never is.
        self._new = [path for path in (self.stages, self.folder, *self.folder.parents) if not path.exists()]

    def make(self):
        """Make the folder if needed and check that it can be written; returns the folder of the stages."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            probe = self.folder / ".facewright-write-test"
            probe.write_bytes(b"")
            probe.unlink()
        except OSError as error:
            self.remove_what_is_new()
            raise InputError(
                f"output folder {self.folder}: cannot be written ({error.strerror}); choose another --out"
            ) from error
        return self.stages

    @contextmanager
    def held(self):
        """The folder of the stages, made, for this run alone; what this run made goes again if its input is unusable.

        raises InputError where another run has the folder, or somebody else's files bear the names of results
        """
        self._refuse_foreign()
        stages = self.make()
        try:
            stages.mkdir(exist_ok=True)
            try:
                with locked(stages / "lock"):
                    yield stages
            except InputError:
                self.remove_what_is_new()
                raise
        except Locked as other:
            raise InputError(
                f"output folder {self.folder}: another run (process {other.owner}) writes into it; wait for it, or "
                "choose another --out"
            ) from None

    def _refuse_foreign(self):
        taken = [name for name in RESULTS if (self.folder / name).exists()]
        ours = (self.folder / "rig" / "rig.json").is_file() or any(self.stages.glob("*/stage.json"))
        if taken and not ours:
            raise InputError(
                f"output folder {self.folder}: its {taken[0]} cannot be told to be from an earlier run and would be "
                "overwritten; choose another --out"
            )

    @contextmanager
    def taken_back_on_failure(self):
        """The folder, made and checked; whatever ends the block early, what this run made of it goes again."""
        self.make()
        try:
            yield self.folder
        except BaseException:
            self.remove_what_is_new()
            raise

    def remove_what_is_new(self):
        """Remove the stages and the folder where this run made them, and parents of it that are empty."""
        for path in self._new:
            if path in (self.stages, self.folder):
                shutil.rmtree(path, ignore_errors=True)
                continue
            try:
                path.rmdir()
            except OSError:  # never made, or another job writes into it
                return

    @contextmanager
    def workshop(self):
        """A new folder to write results into, out of sight until they are published; removed in the end."""
        self.stages.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=".result-", dir=self.stages))
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def publish(self, workshop, stale=()):
        """Move all files of a workshop to their places, and remove the stale ones that none of them replaces.

        stale    names of files, as an earlier publish gave them
        returns  dict name -> digest of the files, names relative to the output folder
        """
        files = sorted(path for path in workshop.rglob("*") if path.is_file())
        names = [path.relative_to(workshop).as_posix() for path in files]
        digests = {name: file_digest(path) for name, path in zip(names, files)}
        try:
            # While files of two runs lie side by side there is no report.
            (self.folder / "report.json").unlink(missing_ok=True)
            for name in sorted(set(stale) - set(names)):
                self._remove(name)
            for name, path in zip(names, files):
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(path, self.folder / name)
        except OSError as error:
            raise InputError(
                f"output folder {self.folder}: cannot write {error.filename2 or error.filename} ({error.strerror}); "
                "close what holds it or choose another --out"
            ) from error
        return digests

    def _remove(self, name):
        path = self.folder / name
        if not path.resolve().is_relative_to(self.folder.resolve()):
            return
        path.unlink(missing_ok=True)
        if path.parent != self.folder and path.parent.is_dir() and not any(path.parent.iterdir()):
            path.parent.rmdir()

    def holds(self, digests):
        """Whether every file is there as it was published."""
        paths = {self.folder / name: digest for name, digest in digests.items()}
        return all(path.is_file() and file_digest(path) == digest for path, digest in paths.items())
