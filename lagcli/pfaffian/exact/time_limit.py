"""Hard limits for computer algebra, on every platform and in every thread: a time, and a budget of operations.

A verdict must not depend on the machine: what a search may cost is a budget of operations, and so is the limit of all
of them, unless `--limit` gives it in seconds of the processor. An operation is the making of a sum, product, power,
function or whole number: SymPy's memory of them counts how often it is asked. Searches make 20 000 to 70 000 in a
second of a processor of 2023; arithmetic of polynomials and of intervals makes few.

SymPy may run for ever on small input. Signals work only in the main thread of a POSIX process, and another process has
to import SymPy again. So the work is done in a daemon thread, which is ended by an exception raised inside it
(`PyThreadState_SetAsyncExc` of CPython), which SymPy meets at its next bytecode.
"""

import ctypes
import math
import sys
import threading
import time
from collections.abc import Callable
from typing import TypeVar

import sympy
from sympy.core.function import Application
from sympy.core.operations import AssocOp

from lagcli import progress
from lagcli.pfaffian.exact import guarded

Value = TypeVar("Value")

SLOWEST = 8_000
"""Operations in a second of processor time, below which a budget of them ends by time: there the work was hardly
anything but arithmetic that is not counted."""

_COUNTED = tuple(
    make.cache_info  # not there where SymPy remembers nothing (`SYMPY_USE_CACHE=no`)
    for make in (AssocOp.__new__, sympy.Pow.__new__, Application.__new__, sympy.Integer.__new__)
    if hasattr(make, "cache_info")
)

# SymPy recurses a thousand deep, with large frames.
_STACK_BYTES = 64 * 1024 * 1024
# Seconds of one wait, as between two attempts to end a thread.
_POLL = 0.05
# Seconds of processor time that the smallest budget of operations has, and seconds in which a thread is to end: one
# pass of the garbage collector through a large process takes half of one, and must not end a search.
_LEAST = 1.5
_local = threading.local()
_turn = threading.Lock()


class TimeUpError(Exception):
    """The time for a piece of work is over."""


NO_ANSWER: tuple[type[Exception], ...] = (TimeUpError, guarded.NoAnswerError)
"""Failure or lateness of a proposal. A slip of ours (TypeError, AttributeError and the like) is none of it, and of what
SymPy raises only what `guarded` has met at work of it."""


# What is raised inside a late worker. A thread may end by just this exception, and by no class derived from it,
# without a printed traceback; it may arrive after the worker's own `except`.
_INTERRUPT = SystemExit


def operations() -> int:
    """The operations of this process so far."""
    counted = [info() for info in _COUNTED]
    return sum(one.hits + one.misses for one in counted)


progress.reckons(_COUNTED, progress.PARAMETERS.symbolic)


def check(deadline: float) -> None:
    """Raise `TimeUpError` when `deadline` has passed, or the budget of the work that calls it is spent."""
    if progress.left(deadline) <= 0:
        raise TimeUpError("no time left")
    if operations() > getattr(_local, "end", math.inf):
        raise TimeUpError("the budget of operations is spent")


def run(deadline: float, work: Callable[[], Value], budget: int | None = None) -> Value:
    """The value of `work()`, computed before `deadline` (see `progress.after`) and within a budget of `operations`.
    Exceptions of `work` are raised here, as by `guarded.attempt`. Raises `TimeUpError` at the limit, also where a value
    came after it. Inside a limited piece of work a later or equal deadline costs nothing: the outer one holds."""
    check(deadline)
    outer: float | None = getattr(_local, "deadline", None)
    if outer is not None:
        if deadline >= outer and budget is None:
            return guarded.attempt(work)
        return _limited(min(deadline, outer), work, budget)
    # No other thread has work in hand meanwhile: operations are counted for the whole process.
    while not _turn.acquire(timeout=_POLL):
        if progress.left(deadline) <= 0:
            raise TimeUpError("the time limit was reached")
    try:
        return _limited(deadline, work, budget)
    finally:
        _turn.release()


def answer(deadline: float, work: Callable[[], Value], budget: int | None = None) -> Value | None:
    """The value as of `run`, None where it fails or is late."""
    try:
        return run(deadline, work, budget)
    except NO_ANSWER:
        return None


def _limited(until: float, work: Callable[[], Value], budget: int | None) -> Value:
    values: list[Value] = []
    errors: list[Exception] = []
    begun, spent = operations(), time.process_time()
    end = min(getattr(_local, "end", math.inf), math.inf if budget is None else begun + budget)
    seconds = math.inf if budget is None else _LEAST + budget / SLOWEST

    inner: list[_Work] = []

    def worker() -> None:
        _local.deadline, _local.inner, _local.end = until, inner, end
        try:
            values.append(guarded.attempt(work))
        except Exception as error:  # noqa: BLE001 - handed on to the caller below, whatever it is
            errors.append(error)
        except _INTERRUPT:
            return

    thread = threading.Thread(target=worker, name="lagcli-algebra", daemon=True)
    own = _Work(thread, inner)
    # Known to the outer work before it runs: an interrupt may come while the thread is being started.
    around: list[_Work] = getattr(_local, "inner", [])
    around.append(own)
    try:
        # Deep expressions recurse deeply; the default stack of a thread is half a megabyte on some systems.
        before = threading.stack_size(_STACK_BYTES)
        try:
            thread.start()
        finally:
            threading.stack_size(before)
        while thread.is_alive():
            progress.require_time()
            rest = min(progress.left(until), spent + seconds - time.process_time())
            if rest <= 0 or operations() > end:
                raise TimeUpError("the limit was reached")
            thread.join(min(rest, _POLL))  # short: an interrupt from outside waits for the end of a join
    finally:
        if not _interrupted(own, time.monotonic() + _LEAST):
            # Another thread goes on with it: what is late must not go on to work beside what comes next.
            late = (own, math.inf)
            threading.Thread(target=_interrupted, args=late, name="lagcli-late", daemon=True).start()
        around.remove(own)
    if errors:
        raise errors[0]
    is_late = isinstance(until, progress.Counted) and progress.left(until) <= 0
    if not values or is_late or operations() > end:
        raise TimeUpError("the limit was reached")
    return values[0]


class _Work:
    """A thread, and the work it has started itself."""

    def __init__(self, thread: threading.Thread, inner: list["_Work"]) -> None:
        self.thread, self.inner = thread, inner

    def alive(self) -> list[threading.Thread]:
        """All threads of it that still run, the innermost first."""
        found = [thread for work in list(self.inner) for thread in work.alive()]
        return [*found, self.thread] if self.thread.is_alive() else found


def _interrupted(work: _Work, give_up: float) -> bool:
    """True if all its threads have ended before `give_up` (see `progress.after`). They are interrupted again and again:
    a `finally` may swallow one interrupt, and machine code meets none."""
    with _quiet:
        while (threads := work.alive()) and time.monotonic() < give_up:
            for thread in threads:
                if thread.ident is not None:
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(
                        ctypes.c_ulong(thread.ident), ctypes.py_object(_INTERRUPT)
                    )
            threads[0].join(_POLL)
    return not threads


class _QuietInterrupts:
    """While entered, interrupts that land in a callback of the garbage collector are not printed: they are repeated."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth = 0
        self._usual = sys.unraisablehook

    def __enter__(self) -> None:
        with self._lock:
            self._depth += 1
            if self._depth == 1:
                self._usual, sys.unraisablehook = sys.unraisablehook, self._on_unraisable

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                sys.unraisablehook = self._usual

    def _on_unraisable(self, about: "sys.UnraisableHookArgs") -> None:
        if about.exc_type is not _INTERRUPT:
            self._usual(about)


_quiet = _QuietInterrupts()
