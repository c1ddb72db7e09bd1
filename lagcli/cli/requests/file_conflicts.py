"""The files of a command line: none that is written may be one that is read, or written by another option."""

from __future__ import annotations

import dataclasses
import os
import stat
import sys
import unicodedata
from collections.abc import Iterable, Iterator
from typing import TextIO

from lagcli.cli.terminal import exits

IGNORING_CASE = ("win32", "darwin")  # platforms whose file systems usually take `A` and `a` for one name


@dataclasses.dataclass(frozen=True, slots=True)
class File:
    """A file with the option that names it.

    is_written: or it is read; is_derived: the option does not name it but writes it too; number: the descriptor of a
    stream of the shell, which has no name.
    """

    option: str
    name: str
    is_written: bool = False
    is_derived: bool = False
    number: int | None = None

    @property
    def told(self) -> str:
        """The begin of a message about it."""
        return f"{self.option}, which writes {self.name}" if self.is_derived else f"{self.option} {self.name}"

    @property
    def keys(self) -> frozenset[object]:
        """The keys it shares with the same file under another name: by links of both kinds, or as a stream."""
        found: set[object] = set()
        try:
            status = os.stat(self.name if self.number is None else self.number)
        except (OSError, ValueError):  # there is none, or it cannot be a name
            status = None
        if status is not None and status.st_ino:
            found.add((status.st_dev, status.st_ino))
        if self.number is None:
            path = os.path.normcase(os.path.realpath(self.name))
            is_one_case = sys.platform in IGNORING_CASE
            found.add(unicodedata.normalize("NFC", path).casefold() if is_one_case else path)
        return frozenset(found)


def model(name: str) -> Iterator[File]:
    """The file of a MODEL, which may come from standard input."""
    if name == "-":
        yield from _stream("MODEL", sys.stdin, is_written=False)
    else:
        yield File("MODEL", name)


def stdout() -> Iterator[File]:
    """Standard output, where it is a file: `lagcli simulate ... > FILE`."""
    return _stream("standard output", sys.stdout, is_written=True)


def _stream(option: str, which: TextIO | None, is_written: bool) -> Iterator[File]:
    try:
        number = which.fileno() if which is not None else -1
        is_file = stat.S_ISREG(os.fstat(number).st_mode)
    except (OSError, ValueError):  # closed, or nothing of the system's
        return
    if is_file:
        yield File(option, "", is_written, number=number)


def require_separate(files: Iterable[File], together: frozenset[str] = frozenset()) -> None:
    """Refuse a file that is written under one option and read or written under another.

    together: two options that may name one file. Raises `exits.UsageError`.
    """
    known: list[tuple[File, frozenset[object]]] = []
    for file in files:
        keys = file.keys
        for other, others in known:
            if not (file.is_written or other.is_written) or keys.isdisjoint(others):
                continue
            if {file.option, other.option} <= together:
                continue
            whose = "also written by" if other.is_derived else "the file of"
            raise exits.UsageError(f"{file.told}: that is {whose} {other.option}")
        known.append((file, keys))
