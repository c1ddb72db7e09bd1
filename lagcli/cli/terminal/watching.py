"""A command that is run again at each change of its files, until it is interrupted.

The files are looked at several times a second: that works on every platform and file system, over a network, and where
an editor puts a new file into the place of the old one.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence

from lagcli.cli.terminal import console, exits, status_line

Stamp = tuple[tuple[int, int, int] | None, ...]


def follow(
    paths: Sequence[str],
    run: Callable[[], None],
    quiet: bool = False,
    pause: Callable[[], None] | None = None,
) -> None:
    """Run a command, and again whenever one of the files is another one; it ends by an interrupt, or by `pause`.

    What a run raises as commands may is printed, and the next change is waited for. pause: waits for a moment; whatever
    it raises ends the watch. Raises `exits.UsageError` for standard input.
    """
    if "-" in paths:
        raise exits.UsageError("--watch needs a file: standard input is read once")
    pause = pause or _pause
    while True:
        # Taken before the run: a change while it goes on is one to run again for.
        seen = stamps(paths)
        console.clear()
        with status_line.showing(quiet):
            exits.outcome(run)
        if not quiet:
            names = os.path.basename(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
            exits.print_err(f"watching {names}; Ctrl-C ends")
        _wait(paths, seen, pause)


def stamps(paths: Sequence[str]) -> Stamp:
    """Time of change, size and number of each, by which a file is known again; None for one that is not there."""
    return tuple(map(_stamp, paths))


def _wait(paths: Sequence[str], seen: Stamp, pause: Callable[[], None]) -> None:
    """Return when a file has changed, and changes no more."""
    sys.stdout.flush()
    while (now := stamps(paths)) == seen:
        pause()
    # An editor may write in several steps, or take the old file away first.
    while True:
        pause()
        settled, now = now, stamps(paths)
        if settled == now:
            return


def _stamp(path: str) -> tuple[int, int, int] | None:
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _pause() -> None:
    time.sleep(status_line.TICK)
