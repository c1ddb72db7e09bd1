"""Long work of this thread: the part that is going on, reported to whoever listens (a terminal, or nobody), and the
time by which it has to end.

What is ended has no answer, and so none that depends on the machine: the work is given up as a whole.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Protocol


class Listener(Protocol):
    """Hears of phases, which may stand inside one another."""

    def begin(self, name: str) -> None:
        """A phase begins, such as `reading the model`."""

    def end(self) -> None:
        """The phase that began last has ended."""


_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextlib.contextmanager
def reported_to(listener: Listener) -> Iterator[None]:
    """Inside the block all phases of this thread are reported to the listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


@contextlib.contextmanager
def unreported() -> Iterator[None]:
    """Inside the block phases are reported to nobody: one of many like pieces of work."""
    token = _listener.set(None)
    try:
        yield
    finally:
        _listener.reset(token)


@contextlib.contextmanager
def phase(name: str) -> Iterator[None]:
    """The block is this phase; also a decorator, for functions that are one."""
    listener = _listener.get()
    if listener is None:
        yield
        return
    listener.begin(name)
    try:
        yield
    finally:
        listener.end()


class OverTime(Exception):
    """The work takes longer than it may."""


_end: ContextVar[float] = ContextVar("end", default=math.inf)


@contextlib.contextmanager
def ends_after(seconds: float) -> Iterator[None]:
    """Inside the block, in this thread, `require_time` raises `OverTime` when so many seconds have passed."""
    token = _end.set(min(_end.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _end.reset(token)


def require_time() -> None:
    """Raise `OverTime` where the time of the work that this thread does is over."""
    end = _end.get()
    if end < math.inf and time.monotonic() >= end:
        raise OverTime
