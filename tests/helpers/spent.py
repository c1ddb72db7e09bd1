"""What a piece of work costs, in counts that are the same on every machine: no test reads a clock to judge it."""

from __future__ import annotations

import contextlib
import cProfile
import threading
from collections.abc import Iterator
from types import FrameType

from lagcli.pfaffian.exact import time_limit


@contextlib.contextmanager
def at_most(count: int) -> Iterator[None]:
    """Fail where the work within makes more operations of computer algebra; 40 000 take about a second."""
    before = time_limit.operations()
    yield
    assert time_limit.operations() - before <= count


@contextlib.contextmanager
def at_most_calls(count: int) -> Iterator[None]:
    """Fail where the work within makes more calls of functions, of libraries too; two million take about a second."""
    elsewhere = 0

    def counting(frame: FrameType, event: str, argument: object) -> None:
        nonlocal elsewhere
        elsewhere += event in ("call", "c_call")

    # A profile counts the calls of one thread, at a fraction of what a function of ours costs.
    here = cProfile.Profile()
    threading.setprofile(counting)
    here.enable()
    try:
        yield
    finally:
        here.disable()
        threading.setprofile(None)
    assert sum(each.callcount for each in here.getstats()) + elsewhere <= count
