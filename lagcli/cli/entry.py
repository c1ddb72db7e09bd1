"""One run of the program: streams that are fit to print on, the commands, the exit code."""

from __future__ import annotations

import os
import sys
from typing import TextIO

from lagcli.cli import app
from lagcli.cli.terminal import exits


def run() -> int:
    """Carry out the command line in `sys.argv`; its exit code."""
    sys.stdout = sys.stdout or _closed()
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - as long as the program
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # Names and titles may hold any letter; a terminal that cannot show one gets an escape, no failure.
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")
    return exits.guarded(_commands, debug="--debug" in sys.argv)


def _commands() -> None:
    """The commands end in `SystemExit` with their own code; here ends what typer itself prints, as --help."""
    stdout = sys.stdout
    try:
        app.app(prog_name="lagcli")
    except SystemExit as end:
        # Typer answers a closed pipe with exit 1 and another sys.stdout.
        closed = sys.stdout is not stdout
        sys.stdout = stdout
        if closed:
            raise BrokenPipeError from None
        raise exits.Exit(end.code if isinstance(end.code, int) else exits.DONE) from None


def _closed() -> TextIO:
    """A stream that cannot be written, in place of a stdout that was closed by the caller."""
    return open(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")
