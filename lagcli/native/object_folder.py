"""Machine code that is kept between processes: one bounded folder of the user's, which may be emptied at any time.

A file is named by what its code was made of, and begins with a digest of itself, so that a damaged one is not read.
Machine code is run, so a folder or file that somebody else may write to is not used. Whatever the system refuses
here (a full disk, no home, no rights) costs time alone: the code is made again.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from lagcli.frozen import frozen_value

ENDING = ".object"
DIGEST = hashlib.sha256().digest_size
MOST_BYTES = 256 * 2**20  # of all files together; the ones used longest ago go first


@frozen_value
class Contents:
    """What the folder holds, None where there is none: the number of files, their bytes, and the time in seconds since
    the oldest was used."""

    folder: Path | None
    files: int = 0
    size: int = 0
    age: float = 0.0

    def as_json(self) -> dict[str, object]:
        """The object of `lagcli cache --json`."""
        place = None if self.folder is None else str(self.folder)
        return {"folder": place, "files": self.files, "bytes": self.size, "seconds": self.age}


def folder() -> Path | None:
    """The folder for caches of this program, None where the system names none: `LAGCLI_CACHE`, or the usual place."""
    own = os.environ.get("LAGCLI_CACHE")
    if own:
        return Path(own)
    try:
        home = Path.home()
    except RuntimeError:  # no home is known
        return None
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "lagcli" / "Cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "lagcli"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "lagcli"


def key(parts: Sequence[bytes]) -> str:
    """The name of code by all that it is made of."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()


def read(name: str) -> bytes | None:
    """The code of this name, None where there is none that is whole and the user's own."""
    place = folder()
    if place is None:
        return None
    file = place / f"{name}{ENDING}"
    try:
        if not (_is_own(place) and _is_own(file)):
            return None
        whole = file.read_bytes()
        os.utime(file)  # used last
    except OSError:
        return None
    digest, code = whole[:DIGEST], whole[DIGEST:]
    return code if hashlib.sha256(code).digest() == digest else None


def write(name: str, code: bytes) -> None:
    """Keep code under this name, whole or not at all, and let go of what was used longest ago."""
    place = folder()
    if place is None:
        return
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_own(place):
            return
        handle, temporary = tempfile.mkstemp(dir=place)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(temporary, place / f"{name}{ENDING}")
        except OSError:
            os.unlink(temporary)
            raise
        _shorten(place)
    except OSError:
        return


def contents() -> Contents:
    """What is kept. Raises `OSError` where it cannot be read."""
    place = folder()
    if place is None or not place.is_dir():
        return Contents(place)
    kept = _files(place)
    now = time.time()
    oldest = min((used for used, _, _ in kept), default=now)
    return Contents(place, len(kept), sum(size for _, size, _ in kept), max(0.0, now - oldest))


def clear() -> None:
    """Delete what is kept. Raises `OSError` where that is not allowed."""
    place = folder()
    if place is not None and place.is_dir():
        for _, _, file in _files(place):
            file.unlink(missing_ok=True)  # another process may have done it


def _is_own(path: Path) -> bool:
    """True if a folder or file is the user's and nobody else may write to it; Windows keeps that by the place."""
    if sys.platform == "win32":
        return True
    status = path.lstat()
    return status.st_uid == os.geteuid() and not stat.S_ISLNK(status.st_mode) and not status.st_mode & 0o022


def _files(place: Path) -> list[tuple[float, int, Path]]:
    """When each file was used last, its bytes, and where it is."""
    kept = []
    for file in place.glob(f"*{ENDING}"):
        try:
            status = file.stat()
        except FileNotFoundError:  # deleted by another process
            continue
        kept.append((status.st_mtime, status.st_size, file))
    return sorted(kept)


def _shorten(place: Path) -> None:
    kept = _files(place)
    excess = sum(size for _, size, _ in kept) - MOST_BYTES
    for _, size, file in kept:
        if excess <= 0:
            return
        file.unlink(missing_ok=True)
        excess -= size
