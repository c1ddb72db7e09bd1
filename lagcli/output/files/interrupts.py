"""Signal handling: exit at once, or, once output files are open, put them in order first.

Before a run has begun to write an exception would not be safe: extension modules drop some of those that are raised
while they are imported. Later a signal raises `Interrupted`, at once or, where rows are being written, when they are.
Further ones never break off the writing of a file: only a pipe that nobody reads is given up.

The program installs the handlers; a script that uses the package has none. Handlers run between two steps of the
interpreter, and a library may compute for seconds in one of them: so a thread that waits at a pipe for the signals ends
the process where the handler did not come to run, as long as no file has been begun.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from types import FrameType

NUMBERS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
PATIENCE = 1  # seconds an interrupt waits for a pipe that takes no more
WAIT = "lagcli: writing the rows, a moment"
GRACE = 0.2  # seconds in which a handler may run before the process is ended without it


class Interrupted(BaseException):
    """A signal asked the command to end; `number` is the signal's."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


_unwinding = 0  # depth of blocks in which an interrupt is an exception
_shielded = 0  # depth of blocks in which it waits
_raised: list[int] = []
_pending: list[int] = []
_patience: list[float] = []
_at_end: list[Callable[[], None]] = []
_handled: float | None = None  # when the handler ran last, by `time.monotonic`
_is_window = False
_final_messages: list[str] = []
_printed: list[str] = []


def install() -> None:
    """Take the ending signals of this platform, where the caller does not have them ignored."""
    for number in NUMBERS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _handle)


def end_promptly() -> None:
    """Let an interrupt end the process also while a library computes, from now on; for the main thread."""
    if not any(map(is_ending, NUMBERS)):
        return
    import threading

    reading, writing = os.pipe()
    if sys.platform != "win32":  # where it need not be
        os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(reading,), daemon=True).start()


def _watch(reading: int) -> None:
    while received := os.read(reading, 64):
        came = time.monotonic()
        for number in received:
            if is_ending(number):
                time.sleep(GRACE)
                # Where the handler has not run, and nothing has been begun that must be put in order
                has_run = _handled is not None and _handled >= came - GRACE
                if not (has_run or _shielded or _unwinding):
                    end_at_once(number)


def release() -> None:
    """Ignore the signals from now on: the command has ended, its exit code is known, and its files are written."""
    for number in filter(is_ending, NUMBERS):
        signal.signal(number, signal.SIG_IGN)


def is_ending(number: int) -> bool:
    """True if a signal is one of those that end the process, and taken here."""
    return number in NUMBERS and signal.getsignal(number) is _handle


def before_end(farewell: Callable[[], None]) -> None:
    """Have a function called before the process ends at once; from any thread, and it must not wait for another."""
    _at_end.append(farewell)


def end_at_once(number: int) -> None:
    """End the process as a signal does; what is in a buffer is lost, for who reads it may have stopped to."""
    for farewell in _at_end:
        farewell()
    for text in _final_messages:
        _print(text)
    os._exit(128 + number)


def _handle(number: int, frame: FrameType | None) -> None:
    global _handled
    _handled = time.monotonic()
    if _shielded:
        is_first = not _pending and not _raised
        if not _pending:
            _pending.append(number)
            if _patience and hasattr(signal, "setitimer"):
                signal.signal(signal.SIGALRM, _out_of_patience)
                signal.setitimer(signal.ITIMER_REAL, min(_patience))
        elif _patience:
            # What waits for a reader may wait for ever: a second signal gives it up.
            _pending.clear()
            _raised.append(number)
            raise Interrupted(number)
        if not is_first:
            _print(WAIT)
        return
    if _is_window and _raised:
        return  # it has been raised, and `check` raises it again where somebody else's code has dropped it
    _pending.clear()
    if not _unwinding:
        end_at_once(number)
    _raised.append(number)
    if not _is_dropped(frame):
        raise Interrupted(number)


def _is_dropped(frame: FrameType | None) -> bool:
    """True where Python would drop an exception, and print that it does: as the lock of a module is let go of. `check`
    raises it later."""
    return (
        frame is not None
        and frame.f_code.co_name == "cb"
        and frame.f_code.co_filename.startswith("<frozen importlib")
    )


def _print(text: str) -> None:
    """Write a line on stderr, once, past its buffer: the signal may have come while that was being written."""
    if text in _printed:
        return
    _printed.append(text)
    if not hasattr(sys.stderr, "fileno"):  # None, or nothing of the system's
        return
    with contextlib.suppress(OSError, ValueError):  # closed
        os.write(sys.stderr.fileno(), f"{text}\n".encode(errors="backslashreplace"))


def leave(*texts: str) -> None:
    """Keep what is printed where a signal ends the command from now on, or by `final_messages`."""
    _final_messages[:] = texts
    _printed.clear()


def final_messages() -> Iterator[str]:
    """The texts that were left to be printed, each once."""
    while _final_messages:
        text = _final_messages.pop()
        if text not in _printed:
            yield text


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
            _pending.clear()


def check() -> None:
    """Raise again an interrupt that got lost in somebody else's code; called where work goes on as if nothing was."""
    if _raised:
        raise Interrupted(_raised[-1])


@contextlib.contextmanager
def shielded(patience: float | None = None) -> Iterator[None]:
    """Hold interrupts back inside the block, and raise one at the end.

    With `patience` the first is raised after so many seconds even where the block has not ended, on platforms that
    have timers for it, and a second one at once: for what may never end, the writing into a pipe that nobody reads.
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
        number = _pending.pop()
        _raised.append(number)
        raise Interrupted(number)


@contextlib.contextmanager
def window() -> Iterator[None]:
    """Let an interrupt through once inside a shielded block, one that was held back too: for work that may be broken
    off."""
    global _shielded, _is_window
    depth, _is_window, _shielded = _shielded, True, 0
    try:
        if _pending and not _raised:
            _raised.append(_pending.pop())
        check()
        yield
    finally:
        _shielded, _is_window = depth, False


def _out_of_patience(number: int, frame: FrameType | None) -> None:
    # Too late where the block has ended meanwhile, and another without patience may have begun.
    if _shielded and _patience and _pending:
        _raised.append(_pending[-1])
        raise Interrupted(_pending.pop())
