"""Tables and the progress bar: the only file that uses rich. User texts go in as `Text`, never as markup."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TextIO

from lagcli import diagnostics

UNCUT = 10_000  # columns of a "terminal" that is none: tables are never cut when piped


def is_plain(stream: TextIO) -> bool:
    """Whether the stream gets no colour and no progress bar."""
    return not stream.isatty() or bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"


def table(headers: Sequence[str], rows: Sequence[Sequence[str]], colours: dict[str, str]) -> None:
    """A table on stdout; cells that are a key of `colours` get that style on a terminal."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    terminal = sys.stdout.isatty()
    console = Console(
        file=sys.stdout,
        no_color=is_plain(sys.stdout),
        width=None if terminal else UNCUT,
        highlight=False,
        emoji=False,
        markup=False,
    )
    # Without a terminal the columns are as wide as their texts: nothing is folded or cut.
    grid = Table(box=box.SIMPLE_HEAD if terminal else None, pad_edge=False, show_edge=False)
    for header in headers:
        grid.add_column(Text(header), overflow="fold", no_wrap=not terminal)
    for row in rows:
        grid.add_row(*(Text(diagnostics.printable(cell), style=colours.get(cell, "")) for cell in row))
    console.print(grid, soft_wrap=False)


class Progress:
    """Tells how far a run has come."""

    def at(self, t: float) -> None:
        """The run has reached the time t."""


@contextmanager
def progress(start: float, end: float, quiet: bool) -> Iterator[Progress]:
    """A bar with the time left on stderr, where that is a terminal and the run has been going on for a second."""
    if quiet or is_plain(sys.stderr):
        yield Progress()
        return
    bar = _Bar(start, end)
    try:
        yield bar
    finally:
        bar.close()


class _Bar(Progress):
    DELAY = 1.0

    def __init__(self, start: float, end: float) -> None:
        import time

        self._start, self._span = start, (end - start) or 1.0
        self._clock = time.monotonic
        self._began = time.monotonic()
        self._shown = None

    def at(self, t: float) -> None:
        if self._shown is None and self._clock() - self._began > self.DELAY:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeRemainingColumn

            self._shown = Progress(
                BarColumn(),
                TaskProgressColumn(),
                TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._shown.start()
            self._task = self._shown.add_task("", total=1.0)
        if self._shown is not None:
            self._shown.update(self._task, completed=(t - self._start) / self._span)

    def close(self) -> None:
        """Take the bar off the screen."""
        if self._shown is not None:
            self._shown.stop()
