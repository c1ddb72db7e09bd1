"""What a piece of work costs, in counts that are the same on every machine: no test reads a clock to judge it."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator
from types import FrameType

from lagcli.pfaffian.exact import operations


@contextlib.contextmanager
def at_most(count: int) -> Iterator[None]:
    """Fail where the work within makes more operations of computer algebra; 40 000 take about a second."""
    before = operations.done()
    yield
    assert operations.done() - before <= count


@contextlib.contextmanager
def at_most_calls(count: int) -> Iterator[None]:
    """Fail where the work within makes more calls of functions, of libraries too; two million take about a second."""
    made = 0

    def counting(frame: FrameType, event: str, argument: object) -> None:
        nonlocal made
        made += event in ("call", "c_call")

    threading.setprofile(counting)
    sys.setprofile(counting)
    try:
        yield
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    print("MADE", made)
    assert count is None or made <= count
