"""An interrupt ends the process also while a library computes.

Handlers of signals run between two steps of the interpreter, and a library may compute for seconds in one of them.
The number of a signal is written to a socket at once, and a thread that waits there ends the process where the
handler did not come to run, as long as no file has been begun.
"""

from __future__ import annotations

import signal
import socket
import threading
import time

from lagcli.cli import signals

GRACE = 0.2  # seconds in which the handler may run


def start() -> None:
    """Watch for the rest of the process; for the main thread. Where no signals are taken there is nothing to do."""
    if not any(map(signals.is_ending, signal.valid_signals())):
        return
    reading, writing = socket.socketpair()
    writing.setblocking(False)
    signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
    # The writing end lives as long as the thread that holds it.
    threading.Thread(target=_watch, args=(reading, writing), daemon=True).start()


def _watch(reading: socket.socket, writing: socket.socket) -> None:
    while received := reading.recv(64):
        came = time.monotonic()
        for number in received:
            if signals.is_ending(number):
                time.sleep(GRACE)
                if signals.is_stuck(came - GRACE):
                    signals.end_at_once(number)
