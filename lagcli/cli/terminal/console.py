"""Tables, folded text and the progress bar: the only file that uses rich.

User texts go in as `Text`, never as markup. Nothing is ever cut: on a terminal cells are folded, elsewhere the
columns are as wide as their texts.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import sys
import textwrap
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, TextIO

from lagcli.errors import diagnostics

if TYPE_CHECKING:
    from rich import progress as rich_progress
    from rich.console import Console
    from rich.table import Table

UNCUT = 10_000  # columns of a "terminal" that is none
NARROWEST = 20  # columns: in fewer a table is unreadable however it is cut
USUAL = 80  # of a terminal that does not say
DELAY = 1.0  # seconds before anything is shown on the way: most commands have ended by then
HEIGHT = 25  # rich takes a width only together with a height; nothing here depends on it

Rows = Sequence[Sequence[str]]


def is_plain(stream: TextIO) -> bool:
    """True if the stream gets no colour and no progress bar."""
    return not stream.isatty() or bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"


def clear() -> None:
    """Empty the screen, where stdout is one."""
    if sys.stdout.isatty() and os.environ.get("TERM") != "dumb":
        from rich.console import Console

        Console(file=sys.stdout).clear()


def width() -> int:
    """Columns of stdout."""
    return max(NARROWEST, shutil.get_terminal_size().columns) if sys.stdout.isatty() else UNCUT


def counted(count: int, noun: str) -> str:
    """A number of things, of which there may be one."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def stderr_width() -> int:
    """Columns of stderr, a terminal."""
    try:
        columns = os.get_terminal_size(sys.stderr.fileno()).columns
    except (OSError, ValueError):  # one that does not say
        columns = 0
    return max(NARROWEST, columns or USUAL)


def table(headers: Sequence[str], rows: Rows, colours: Mapping[str, str]) -> None:
    """A table on stdout; cells that are a key of `colours` get that style on a terminal. On a terminal that is too
    narrow for it each row is printed in lines of its own."""
    if sys.stdout.isatty() and not fits(headers, rows):
        for line in stacked(headers, rows, width()):
            print(line)
        return
    _console().print(_table(headers, rows, colours))


def stacked(headers: Sequence[str], rows: Rows, columns: int) -> Iterator[str]:
    """A table as paragraphs of at most so many columns: the first cell, then each other one after its header."""
    for row in rows:
        first, *cells = (diagnostics.printable(cell) for cell in row)
        pairs = zip(headers[1:], cells, strict=True)
        labelled = [f"{header} {cell}".strip() for header, cell in pairs if cell]
        text = f"{first}: {'; '.join(labelled)}" if first else "; ".join(labelled)
        yield from textwrap.wrap(text, columns, subsequent_indent="    ", break_on_hyphens=False)


def fits(headers: Sequence[str], rows: Rows) -> bool:
    """True if a table shows on stdout without folded cells."""
    console = _console()
    # Measured as if there were room: rich bounds the measure by the width it is given.
    roomy = console.options.update(width=UNCUT)
    return console.measure(_table(headers, rows, {}), options=roomy).maximum <= width()


def paragraph(text: str, indent: str = "    ") -> None:
    """Sentences on stdout, folded between words on a terminal; `indent` goes before all lines but the first."""
    plain = diagnostics.printable(text)
    if sys.stdout.isatty():
        plain = textwrap.fill(plain, width(), subsequent_indent=indent, break_on_hyphens=False)
    print(plain)


def _console() -> Console:
    from rich.console import Console

    class Piped(Console):
        """A console that leaves a closed pipe to `exits`: rich ends the program with a code of its own."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    terminal = sys.stdout.isatty()
    return Piped(
        file=sys.stdout,
        force_terminal=terminal,
        color_system=None if is_plain(sys.stdout) else "auto",
        width=width(),
        height=HEIGHT,
        highlight=False,
        emoji=False,
        markup=False,
    )


def _table(headers: Sequence[str], rows: Rows, colours: Mapping[str, str]) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    terminal = sys.stdout.isatty()
    # A line below the headers only where someone looks: for a program a row is a line.
    grid = Table(box=box.SIMPLE_HEAD if terminal else None, pad_edge=False, show_edge=False)
    for header in headers:
        grid.add_column(Text(header), overflow="fold", no_wrap=not terminal)
    for row in rows:
        grid.add_row(*(Text(diagnostics.printable(cell), style=colours.get(cell, "")) for cell in row))
    return grid


class Progress:
    """Tells how far a run has come, by a bar with the time left once it has been going on for a second."""

    def __init__(self, start: float, end: float, is_shown: bool) -> None:
        self._start, self._span = start, (end - start) or 1.0
        self._due = time.monotonic() + DELAY if is_shown else math.inf
        self._shown: rich_progress.Progress | None = None
        self._task: rich_progress.TaskID | None = None

    def at(self, t: float) -> None:
        """The run has reached the time t."""
        if self._shown is None and time.monotonic() > self._due:
            from rich import progress as rich_progress
            from rich.console import Console

            shown = rich_progress.Progress(
                rich_progress.BarColumn(),
                rich_progress.TaskProgressColumn(),
                rich_progress.TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            self._task = shown.add_task("", total=1.0)
            # Known before it starts: an interrupt in between finds it and gives the terminal its cursor back.
            self._shown = shown
            shown.start()
        if self._shown is not None and self._task is not None:
            self._shown.update(self._task, completed=(t - self._start) / self._span)

    def close(self) -> None:
        """Nothing more is shown: others write on the terminal."""
        if self._shown is not None:
            self._shown.stop()
            self._shown, self._due = None, math.inf


def progress(start: float, end: float, quiet: bool) -> contextlib.closing[Progress]:
    """How far a run has come, told on stderr where that is a terminal."""
    return contextlib.closing(Progress(start, end, not quiet and not is_plain(sys.stderr)))
