"""An interrupt ends the process also while a library computes.

Handlers of signals run between two steps of the interpreter, and a library may compute for seconds in one of them.
The number of a signal is written to a pipe at once, and a thread that waits there ends the process where the
handler did not come to run, as long as no file has been begun.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

from lagcli.cli.terminal import signals

GRACE = 0.2  # seconds in which the handler may run


def start() -> None:
    """Watch for the rest of the process; for the main thread. Where no signals are taken there is nothing to do."""
    if not any(map(signals.is_ending, signal.valid_signals())):
        return
    reading, writing = os.pipe()
    if sys.platform != "win32":  # where it need not be
        os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(reading,), daemon=True).start()


def _watch(reading: int) -> None:
    while received := os.read(reading, 64):
        came = time.monotonic()
        for number in received:
            if signals.is_ending(number):
                time.sleep(GRACE)
                if signals.is_stuck(came - GRACE):
                    signals.end_at_once(number)
