"""Long work of this thread: the part that is going on, told to whoever listens, and the time by which it has to end.

A limit that somebody gives is in seconds of the processor (`time.process_time`). One that nobody gave is `Counted`:
seconds that are reckoned from operations (`reckon`, `reckons`), so that no answer depends on a clock.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Iterator
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
def reported_to(listener: Listener | None) -> Iterator[None]:
    """Inside the block all phases of this thread are reported to the listener, or to nobody."""
    token = _listener.set(listener)
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


class Counted(float):
    """Seconds reckoned from operations: those that they take on a processor of 2023, wherever they are done."""


class ReckoningParameters:
    """Seconds of processor time that work takes, as measured on a processor of 2023 and rounded.

    The tests are of `tests/unit/test_limits.py`.
    """

    __slots__ = ()

    evaluation: float = 1e-4
    """Of rows at a point, or at some points together. `test_work_is_reckoned_by_its_kind` fails at 1e-5 and 1e-3."""
    entry: float = 1e-6
    """And of each of their entries, or of a product in many digits.
    `test_work_is_reckoned_by_its_kind` fails at 1e-7 and 1e-5."""
    operation: float = 1e-8
    """Of an operation in doubles at one of many points.
    `test_work_is_reckoned_by_its_kind` fails at 1e-9 and 1e-7."""
    symbolic: float = 2.5e-5
    """Of an operation of SymPy. `test_work_is_reckoned_by_its_kind` fails at 2.5e-6 and 2.5e-4."""


PARAMETERS = ReckoningParameters()


class Asked(Protocol):
    """A count of the questions to a memory of results, as `functools.lru_cache` keeps it."""

    hits: int
    misses: int


Memory = Callable[[], Asked]


_reckoned: float = 0  # seconds of work of this process
_memories: list[tuple[Memory, float]] = []  # that count more: seconds for each question


def reckon(seconds: float) -> None:
    """Say that work was done that takes so many seconds on a processor of 2023."""
    global _reckoned
    _reckoned += seconds


def reckons(memories: Iterable[Memory], seconds: float) -> None:
    """Reckon so many seconds each time that one of these memories is asked."""
    _memories.extend((memory, seconds) for memory in memories)


def _now(kind: float) -> float:
    """The seconds of the work of this process, of the kind of this limit."""
    if not isinstance(kind, Counted):
        return time.process_time()
    counts = [(memory(), each) for memory, each in _memories]
    return _reckoned + sum((count.hits + count.misses) * each for count, each in counts)


def after(limit: float) -> float:
    """The deadline that lies so many seconds ahead, of the kind that they are of."""
    deadline = _now(limit) + limit
    return Counted(deadline) if isinstance(limit, Counted) else deadline


def left(deadline: float) -> float:
    """The seconds until a deadline, of its kind; negative when it has passed."""
    seconds = deadline - _now(deadline)
    return Counted(seconds) if isinstance(deadline, Counted) else seconds


def soon(deadline: float, share: float) -> float:
    """The deadline at which this share of what is left until another has passed."""
    seconds = share * left(deadline)
    return after(Counted(seconds) if isinstance(deadline, Counted) else seconds)


def told(limit: float) -> str:
    """The limit in words."""
    reckoned = ", reckoned from operations" if isinstance(limit, Counted) else ""
    return f"{limit:g} s of processor time{reckoned}"


_end: ContextVar[float] = ContextVar("end", default=math.inf)


@contextlib.contextmanager
def ends_after(seconds: float) -> Iterator[None]:
    """Inside the block, in this thread, `require_time` raises `OverTime` when so many seconds of the processor have
    passed."""
    token = _end.set(min(_end.get(), time.process_time() + seconds))
    try:
        yield
    finally:
        _end.reset(token)


def require_time() -> None:
    """Raise `OverTime` where the time of the work that this thread does is over."""
    end = _end.get()
    if end < math.inf and time.process_time() >= end:
        raise OverTime
