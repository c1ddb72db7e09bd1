"""A line on the terminal that says which phase is going on, where a command takes long.

It is drawn by a thread of its own: the libraries below let other threads run while they compute.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Iterator

from lagcli import progress
from lagcli.cli.terminal import console
from lagcli.output.files import interrupts

TICK = 0.25  # seconds between looks at what is going on
ERASE = "\r\x1b[2K"

_shown: list[Status] = []


@contextlib.contextmanager
def showing(quiet: bool) -> Iterator[None]:
    """Inside the block phases that last are shown on stderr, where that is a terminal that takes such lines."""
    if quiet or console.is_plain(sys.stderr):
        yield
        return
    line = Status()
    _shown.append(line)
    try:
        with progress.reported_to(line):
            yield
    finally:
        _shown.remove(line)
        line.close()


def erase() -> None:
    """Take the line off the terminal, from any thread: the process is about to end."""
    for line in _shown:
        if line.is_shown:  # without waiting for whoever draws it
            with contextlib.suppress(OSError):
                os.write(2, ERASE.encode())


interrupts.before_end(erase)


class Status:
    """The phases that are going on, and the line that shows the innermost one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._names: list[str] = []
        self._began = time.monotonic()
        self.is_shown, self._text = False, ""
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, name: str) -> None:
        """A phase begins."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._watch, daemon=True)
            self._thread.start()
        with self._lock:
            self._names.append(name)

    def end(self) -> None:
        """The innermost phase has ended; after the last one others may write on the terminal."""
        with self._lock:
            self._names.pop()
            if self.is_shown and not self._names:
                self._write(ERASE)
                self.is_shown, self._text = False, ""

    def close(self) -> None:
        """Nothing more is shown."""
        self._closed.set()
        if self._thread is not None:
            self._thread.join()

    def _watch(self) -> None:
        while not self._closed.wait(TICK):
            with self._lock:
                seconds = time.monotonic() - self._began
                if not self._names or seconds < console.DELAY:
                    continue
                text = f"{self._names[-1]} ... {seconds:.0f} s"
                if text != self._text:
                    self.is_shown, self._text = True, text
                    # A line that is folded could not be erased.
                    self._write(ERASE + text[: console.stderr_width() - 1])

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):  # a closed stderr is no reason to fail
            sys.stderr.write(text)
            sys.stderr.flush()
