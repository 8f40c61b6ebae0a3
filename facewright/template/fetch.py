"""Get a template that is not shipped: its official folder, downloaded on request or local, built into a template."""

from __future__ import annotations

import shutil
import tempfile
import urllib.error
import urllib.request
import zipfile
from pathlib import Path, PurePosixPath

from facewright.errors import InputError
from facewright.template.build import build_template
from facewright.template.source import read_description
from facewright.template.store import SHIPPED, user_folder, write_template

TIMEOUT_S = 30
CHUNK = 1 << 20


def description_of(name_or_file):
    """The description file of a template that Facewright knows how to build ("ict"), or of a user's own path."""
    path = Path(name_or_file)
    if path.is_file():
        return path
    shipped = SHIPPED / f"{name_or_file}.toml"
    if shipped.is_file():
        return shipped
    known = ", ".join(sorted(path.stem for path in SHIPPED.glob("*.toml")))
    raise InputError(f"template: {str(name_or_file)!r} is neither a description file nor one of: {known}")


def build_folder(source_folder, description_path, out):
    """Build a template, write it to the folder out with the source's licence beside it; returns the Template."""
    source, out = Path(source_folder), Path(out)
    if not source.is_dir():
        raise InputError(f"template: there is no folder {source}")
    description = read_description(description_path)
    template = build_template(source, description_path)
    write_template(template, out)
    licence = description["source"].get("licence")
    if licence and (source / licence).is_file():
        shutil.copyfile(source / licence, out / "LICENSE.txt")
    return template


def fetch_template(name, *, source_folder=None, out=None, progress=None):
    """Download the official archive of a template, unless a local source_folder is given, and build it.

    out      folder of the result, default: the user's own templates (see store.user_folder)
    progress called with (bytes so far, bytes in all or None)
    returns  the folder and the Template
    raises   InputError if the archive cannot be had, in one sentence that says what to do
    """
    description_path = description_of(name)
    out = Path(out) if out else user_folder() / name
    if source_folder is not None:
        return out, build_folder(source_folder, description_path, out)
    url = read_description(description_path)["source"].get("archive")
    if not url:
        raise InputError(f"template: {name} names no archive to download; give its folder with --from FOLDER")
    with tempfile.TemporaryDirectory(prefix="facewright-") as scratch:
        archive = Path(scratch) / "archive.zip"
        _download(url, archive, progress)
        return out, build_folder(_unpack(archive, Path(scratch) / "source"), description_path, out)


def _download(url, path, progress):
    advice = f"download {url} yourself, unpack it and give its folder with --from FOLDER"
    try:
        with urllib.request.urlopen(url, timeout=TIMEOUT_S) as response, path.open("wb") as file:
            length = response.headers.get("Content-Length")
            done = 0
            while block := response.read(CHUNK):
                file.write(block)
                done += len(block)
                if progress:
                    progress(done, int(length) if length else None)
    except (urllib.error.URLError, OSError) as error:
        reason = getattr(error, "reason", None) or error
        raise InputError(f"template: cannot download {url} ({reason}); {advice}") from error


def _unpack(archive, folder):
    """Unpack a zip whose files lie in one top folder; returns that folder."""
    try:
        with zipfile.ZipFile(archive) as bundle:
            names = [PurePosixPath(name) for name in bundle.namelist()]
            if any(name.is_absolute() or ".." in name.parts for name in names):
                raise InputError("template: the downloaded archive holds paths that lead out of it; it is not used")
            bundle.extractall(folder)
    except zipfile.BadZipFile as error:
        raise InputError("template: the download is not a zip archive; try again, or give --from FOLDER") from error
    tops = sorted(path for path in folder.iterdir() if path.is_dir())
    return tops[0] if len(tops) == 1 else folder
