"""Failures to write a file, reported with its name, and files that are refused before any work: those of no known
format, those that cannot be made or replaced, and those that are one."""

from __future__ import annotations

import contextlib
import errno
import os
import pathlib
import stat
import sys
import unicodedata
from collections.abc import Iterable, Iterator
from typing import TextIO

from lagcli.frozen import frozen_value
from lagcli.output.files import atomic_file, formats, interrupts


class WriteError(Exception):
    """A file could not be written."""


class BadRequest(Exception):
    """Something that was asked for cannot be done; the message names the option."""


@contextlib.contextmanager
def writing(name: str) -> Iterator[None]:
    """Take what fails inside, but for a closed pipe, as the writing of `name`. Raises `WriteError`, `Interrupted`."""
    try:
        with interrupts.unwinding():
            yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise WriteError(f"cannot write {name}: {error.strerror or error}") from error


@contextlib.contextmanager
def drawing(name: str) -> Iterator[None]:
    """Surround what loads matplotlib and writes a figure; matplotlib's remarks on its cache are no answer of ours."""
    import logging

    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    with writing(name):
        yield


IGNORING_CASE = ("win32", "darwin")  # platforms whose file systems usually take `A` and `a` for one name


@frozen_value
class File:
    """A file with the option that names it, or, is_derived, writes it too. number: the descriptor of a stream of the
    shell, which has no name."""

    option: str
    name: str
    is_written: bool = False
    is_derived: bool = False
    number: int | None = None

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


def model_file(name: str) -> Iterator[File]:
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
    """Refuse a file that is written under one option and read or written under another, but for two options that may
    name one file together. Raises `BadRequest`."""
    known: list[tuple[File, frozenset[object]]] = []
    for file in files:
        keys = file.keys
        for other, others in known:
            if not (file.is_written or other.is_written) or keys.isdisjoint(others):
                continue
            if {file.option, other.option} <= together:
                continue
            what = f"{file.option}{', which writes' if file.is_derived else ''} {file.name}"
            whose = "also written by" if other.is_derived else "the file of"
            raise BadRequest(f"{what}: that is {whose} {other.option}")
        known.append((file, keys))


def require_endings(*files: tuple[str | None, tuple[str, ...]]) -> None:
    """Refuse a file, of those there are, whose name ends in none of the formats beside it."""
    for name, known in files:
        if name is not None:
            try:
                formats.of(pathlib.Path(name), known)
            except formats.UnknownFormat as error:
                raise BadRequest(str(error)) from None


def require_outputs(model: str, output: str | None, plot: str | None, as_json: bool) -> None:
    """Refuse a table, `-` for standard output, and a figure that cannot be written beside this MODEL."""
    if as_json and output == "-":
        raise BadRequest("--output -: --json has standard output; give a file")
    table = None if output == "-" else output
    require([("MODEL", model)], ("--output", table, formats.TABLES), ("--plot", plot, formats.FIGURES))


def require(
    read: Iterable[tuple[str, str | None]], *written: tuple[str, str | None, tuple[str, ...]]
) -> None:
    """Refuse files to write whose names end in none of the formats beside them, that are another file of these, or
    cannot be made. read: options with their files; a MODEL may be standard input."""
    files = [(option, name, known) for option, name, known in written if name is not None]
    require_endings(*((name, known) for _, name, known in files))
    if files:
        others: list[File] = []
        for option, name in read:
            if name is not None:
                others += model_file(name) if option == "MODEL" else [File(option, name)]
        require_writable(others, [File(option, name, is_written=True) for option, name, _ in files])


def require_writable(
    model: Iterable[File], files: Iterable[File], together: frozenset[str] = frozenset()
) -> None:
    """Refuse files that are one, but for two options together, and those that cannot be made or replaced, before a long
    run."""
    everything = (*model, *files, *stdout())
    require_separate(everything, together)
    for file in everything:
        if file.is_written and file.number is None:
            with writing(file.name):
                target = atomic_file.destination(pathlib.Path(file.name))
                # Files are written aside and moved, so that the folder counts; a pipe or a device is written in place.
                is_replaced = atomic_file.is_replaced(target)
                path, rights = (target.parent, os.W_OK | os.X_OK) if is_replaced else (target, os.W_OK)
                os.stat(path)
                if not os.access(path, rights):
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
