"""The part of the work that is going on, told to whoever listens in this thread: a terminal, or nobody."""

from __future__ import annotations

import contextlib
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
def heard_by(listener: Listener) -> Iterator[None]:
    """Inside the block all phases of this thread are told to the listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


@contextlib.contextmanager
def unheard() -> Iterator[None]:
    """Inside the block phases are told to nobody: one of many like pieces of work."""
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
