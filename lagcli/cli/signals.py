"""Interrupts: they end the process at once, or where files have been begun, in order.

Before a run has begun to write there is nothing to put in order, and an exception would not be safe: extension
modules drop some of those that are raised while they are imported. Then it is raised, at once or, while rows are
being written, right after.
"""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator
from types import FrameType

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
PATIENCE = 1.0  # seconds an interrupt waits for a pipe that takes no more


class Interrupted(BaseException):
    """A signal asked the command to end; `number` is the signal's."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


_unwinding = 0
_shielded = 0
_raised: list[int] = []
_pending: list[int] = []
_patience: list[float] = []


def install() -> None:
    """Take the ending signals of this platform, where the caller does not have them ignored."""
    for number in _numbers():
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _handle)


def release() -> None:
    """Give the signals back to the system: the command has ended, and its exit code is known."""
    for number in _numbers():
        if signal.getsignal(number) is _handle:
            signal.signal(number, signal.SIG_DFL)


def _numbers() -> list[signal.Signals]:
    return [getattr(signal, name) for name in NAMES if hasattr(signal, name)]


def _handle(number: int, frame: FrameType | None) -> None:
    # A second one does not wait: what is shielded may be stuck, in a pipe that nobody reads.
    if _shielded and not _pending:
        _pending.append(number)
        if _patience:
            _alarm(min(_patience))
        return
    _pending.clear()
    if not _shielded and not _unwinding:
        # Nothing that is still in a buffer is written: whoever reads it may have stopped to.
        os._exit(128 + number)
    _raised.append(number)
    raise Interrupted(number)


@contextlib.contextmanager
def unwinding() -> Iterator[None]:
    """Inside the block an interrupt is an exception, so that what has been begun is put in order."""
    global _unwinding
    _unwinding += 1
    try:
        yield
    finally:
        _unwinding -= 1
        if not _unwinding:
            _raised.clear()


def check() -> None:
    """Raise again an interrupt that got lost in somebody else's code; called where work goes on as if nothing was."""
    if _raised:
        raise Interrupted(_raised[-1])


@contextlib.contextmanager
def shielded(patience: float | None = None) -> Iterator[None]:
    """Hold an interrupt back inside the block, and raise it at the end.

    With `patience` it is raised after so many seconds even where the block has not ended, on platforms that
    have timers for it: for what may never end, the writing into a pipe that nobody reads.
    """
    global _shielded
    _shielded += 1
    if patience is not None:
        _patience.append(patience)
    try:
        yield
    finally:
        if patience is not None:
            _patience.pop()
        _shielded -= 1
    if _pending and not _shielded:
        raise Interrupted(_pending.pop())


def _alarm(seconds: float) -> None:
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _out_of_patience)
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _out_of_patience(number: int, frame: FrameType | None) -> None:
    # Too late where the block has ended meanwhile, and another without patience may have begun.
    if _shielded and _patience and _pending:
        raise Interrupted(_pending.pop())
