"""The time by which a piece of work has to be done: what may take long asks now and then whether it is over.

What is ended so has no answer, and none that depends on the machine: the work is given up as a whole.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from contextvars import ContextVar


class OverTime(Exception):
    """The work takes longer than it may."""


_end: ContextVar[float] = ContextVar("end", default=math.inf)


@contextlib.contextmanager
def after(seconds: float) -> Iterator[None]:
    """Inside the block, in this thread, `require` raises `OverTime` when so many seconds have passed."""
    token = _end.set(min(_end.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _end.reset(token)


def require() -> None:
    """Raise `OverTime` where the time of the work that this thread does is over."""
    end = _end.get()
    if end < math.inf and time.monotonic() >= end:
        raise OverTime
