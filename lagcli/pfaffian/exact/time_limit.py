"""A hard time limit for computer algebra, on every platform and in every thread.

SymPy's solvers and integrators may run for ever on small input. Signals work only in the main thread of a
POSIX process, and a process of its own must import SymPy again (half a second) and has to copy the
expressions there and back. So the work is done in a daemon thread, and a thread that is late is ended by
raising an exception inside it (`PyThreadState_SetAsyncExc` of CPython). SymPy is pure Python: it meets that
exception at its next bytecode.
"""

import ctypes
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

from sympy.polys.polyerrors import BasePolynomialError

Value = TypeVar("Value")

_STACK_BYTES = 64 * 1024 * 1024
_KILL_INTERVAL = 0.02
_KILL_PATIENCE = 1.0
_POLL = 0.05
_local = threading.local()


class TimeUpError(Exception):
    """The time for a piece of work is over."""


class NoAnswerError(Exception):
    """A proposal or a test has no answer for its input. That is "none found", never a verdict."""


# BasePolynomialError: SymPy's polynomials raise it from their operators too, which no guarded call could hold.
# RecursionError: an expression is nested too deeply.
FAILURES: tuple[type[Exception], ...] = (NoAnswerError, BasePolynomialError, RecursionError)
"""What says that no answer was found. A slip of ours (TypeError, AttributeError and the like) is none of it, and of
what SymPy raises only what `guarded` has met at a call of it.
"""
NO_ANSWER: tuple[type[Exception], ...] = (TimeUpError, *FAILURES)
"""Failure or lateness of a proposal."""


# What is raised inside a late worker. A thread may end by just this exception, and by no class derived from it,
# without a printed traceback; it may arrive after the worker's own `except`.
_INTERRUPT = SystemExit


def after(seconds: float) -> float:
    """The deadline (a value of the monotonic clock, s) that lies `seconds` ahead."""
    return time.monotonic() + seconds


def left(deadline: float) -> float:
    """Seconds until `deadline`; negative when it has passed."""
    return deadline - time.monotonic()


def check(deadline: float) -> None:
    """Raise `TimeUpError` when `deadline` has passed."""
    if left(deadline) <= 0:
        raise TimeUpError("no time left")


def run(deadline: float, work: Callable[[], Value], effort: float | None = None) -> Value:
    """The value of `work()`, computed before `deadline` (monotonic clock, s).

    With `effort` the work also ends after so many seconds of processor time of this process: what is found does
    not depend on what else the machine is doing. Exceptions of `work` are raised here. Raises `TimeUpError` at
    the limit; the worker is ended. Inside a limited piece of work a later or equal deadline costs nothing: the
    outer limit already holds.
    """
    check(deadline)
    outer: float | None = getattr(_local, "deadline", None)
    if outer is not None and deadline >= outer and effort is None:
        return work()
    values: list[Value] = []
    errors: list[Exception] = []
    until = deadline if outer is None else min(deadline, outer)

    inner: list[_Work] = []

    def worker() -> None:
        _local.deadline, _local.inner = until, inner
        try:
            values.append(work())
        except Exception as error:  # noqa: BLE001 - handed on to the caller below, whatever it is
            errors.append(error)
        except _INTERRUPT:
            return

    spent = time.process_time()
    thread = threading.Thread(target=worker, name="lagcli-algebra", daemon=True)
    own = _Work(thread, inner)
    # Known to the outer work before it runs: an interrupt may come while the thread is being started.
    around: list[_Work] = getattr(_local, "inner", [])
    around.append(own)
    try:
        _start(thread)
        while thread.is_alive():
            rest = left(until) if effort is None else min(left(until), spent + effort - time.process_time())
            if rest <= 0:
                raise TimeUpError("the time limit was reached")
            thread.join(min(rest, _POLL))  # short: an interrupt from outside waits for the end of a join
    finally:
        _end(own)
        around.remove(own)
    if errors:
        raise errors[0]
    if not values:
        raise TimeUpError("the time limit was reached")
    return values[0]


class _Work:
    """A thread, and the work it has started itself."""

    def __init__(self, thread: threading.Thread, inner: list["_Work"]) -> None:
        self.thread, self.inner = thread, inner

    def alive(self) -> list[threading.Thread]:
        """All threads of it that still run, the innermost first."""
        found = [thread for work in list(self.inner) for thread in work.alive()]
        return [*found, self.thread] if self.thread.is_alive() else found


def _start(thread: threading.Thread) -> None:
    # Deep expressions recurse deeply; the default stack of a thread is half a megabyte on some systems.
    before = threading.stack_size(_STACK_BYTES)
    try:
        thread.start()
    finally:
        threading.stack_size(before)


def _end(work: _Work) -> None:
    """Interrupt all its threads again and again: a `finally` or a bare `except` inside may swallow one
    interrupt.
    """
    give_up = after(_KILL_PATIENCE)
    with _quiet:
        while (threads := work.alive()) and left(give_up) > 0:
            for thread in threads:
                if thread.ident is not None:
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(
                        ctypes.c_ulong(thread.ident), ctypes.py_object(_INTERRUPT)
                    )
            threads[0].join(_KILL_INTERVAL)


class _Quiet:
    """While entered, interrupts that land in a callback of the garbage collector are not told: they are repeated."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth = 0
        self._usual: Callable[[Any], Any] = sys.unraisablehook

    def __enter__(self) -> None:
        with self._lock:
            self._depth += 1
            if self._depth == 1:
                self._usual, sys.unraisablehook = sys.unraisablehook, self._told

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                sys.unraisablehook = self._usual

    def _told(self, about: Any) -> None:
        if about.exc_type is not _INTERRUPT:
            self._usual(about)


_quiet = _Quiet()
