"""Refusals before any work, whatever the command: files that are missing, of a wrong format, or not to be
written. Its functions raise `exits.UsageError`, and `write_guard.WriteError` for a folder that is missing or closed.
"""

from __future__ import annotations

import errno
import os
import pathlib
from collections.abc import Iterable
from typing import TypedDict

from lagcli.cli.requests import file_conflicts, model_reading
from lagcli.cli.terminal import exits
from lagcli.output.files import atomic_file, endings, write_guard


class RepeatedRuns(TypedDict):
    """The settings of the runs of `compare` and `limit`, None where the file's stays."""

    duration: float | None
    output_step: float | None
    samples: int | None
    rtol: float | None
    atol: float | None
    max_step: float | None
    assemble: bool | None


def require_models(paths: list[str]) -> None:
    """One MODEL that does not exist is told before the others are worked on. Raises `exits.UsageError`."""
    for path in paths:
        if path != "-" and not os.path.exists(path):
            raise model_reading.missing(path)
    if paths.count("-") > 1:
        raise exits.UsageError("standard input can be read once only")


def require_ending(name: str | None, known: tuple[str, ...]) -> None:
    """Refuse a file whose name ends in none of the known formats."""
    if name is None:
        return
    try:
        endings.of(pathlib.Path(name), known)
    except endings.UnknownFormat as error:
        raise exits.UsageError(str(error)) from None


def require_outputs(model: str, output: str | None, plot: str | None, as_json: bool) -> None:
    """Refuse a table, `-` for standard output, and a figure that cannot be written beside this MODEL."""
    if as_json and output == "-":
        raise exits.UsageError("--output -: --json has standard output; give a file")
    table = None if output == "-" else output
    require_ending(table, endings.TABLES)
    require_ending(plot, endings.FIGURES)
    named = (("--output", table), ("--plot", plot))
    files = [file_conflicts.File(option, name, is_written=True) for option, name in named if name is not None]
    if files:
        require_writable(file_conflicts.model(model), files)


def require_writable(
    model: Iterable[file_conflicts.File],
    files: Iterable[file_conflicts.File],
    together: frozenset[str] = frozenset(),
) -> None:
    """Refuse files that are one, and those that cannot be made or replaced, before a long run and not after it.

    together: two options that may name one file.
    """
    everything = (*model, *files, *file_conflicts.stdout())
    file_conflicts.require_separate(everything, together)
    for file in everything:
        if file.is_written and file.number is None:
            _require_place(file.name)


def _require_place(name: str) -> None:
    with write_guard.writing(name):
        target = atomic_file.destination(pathlib.Path(name))
        # Files are written aside and moved, so that the folder counts; a pipe or a device is written in place.
        is_replaced = atomic_file.is_replaced(target)
        place, rights = (target.parent, os.W_OK | os.X_OK) if is_replaced else (target, os.W_OK)
        os.stat(place)
        if not os.access(place, rights):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
