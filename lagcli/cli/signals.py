"""Interrupts: raised as an exception at once, except while rows are being written, then right after."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class Interrupted(BaseException):
    """A signal asked the command to end; `number` is the signal's."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


_shielded = 0
_pending: list[int] = []


def install() -> None:
    """Turn the ending signals of this platform into `Interrupted`."""
    for name in NAMES:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _handle)


def _handle(number: int, frame: FrameType | None) -> None:
    # A second one does not wait: what is shielded may be stuck, in a pipe that nobody reads.
    if _shielded and not _pending:
        _pending.append(number)
        return
    _pending.clear()
    raise Interrupted(number)


@contextlib.contextmanager
def shielded() -> Iterator[None]:
    """Hold an interrupt back inside the block, and raise it at the end."""
    global _shielded
    _shielded += 1
    try:
        yield
    finally:
        _shielded -= 1
    if _pending and not _shielded:
        raise Interrupted(_pending.pop())
