"""What takes long says what it is doing, on a terminal alone, and an interrupt ends it while a library computes."""

import contextlib
import io
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import lagcli
from lagcli import memory, progress
from lagcli.api import prepare_run
from lagcli.cli.terminal import console, status_line

MODEL = Path(__file__).resolve().parents[2] / "models" / "pendulum.yaml"


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Make stderr a terminal for the rest of the test."""
    found = Terminal()
    for name in ("NO_COLOR", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(console, "DELAY", 0.0)
    monkeypatch.setattr(status_line, "TICK", 0.001)
    monkeypatch.setattr(sys, "stderr", found)
    return found


def lasting(stream: Terminal, name: str) -> None:
    """A phase that ends when it has been shown."""
    with progress.phase(name):
        shown(stream, name)


def shown(stream: Terminal, name: str) -> None:
    """Wait until a text has been written."""
    for _ in range(20_000):
        if name in stream.getvalue():
            return
        time.sleep(0.001)
    raise AssertionError(f"{name} is not shown")


def test_a_phase_that_lasts_is_shown_and_taken_away_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    with status_line.showing(False), progress.phase("reading the model"):
        lasting(stream, "reading the model")
        lasting(stream, "counting")
    found = stream.getvalue()
    assert found.startswith(f"{status_line.ERASE}reading the model ... 0 s")
    assert found.endswith(status_line.ERASE)
    assert "\n" not in found


def test_a_phase_that_fails_is_taken_away_before_the_error_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stream = terminal(monkeypatch)
    with status_line.showing(False):
        with contextlib.suppress(ValueError), progress.phase("counting"):
            lasting(stream, "counting")
            raise ValueError
        assert stream.getvalue().endswith(status_line.ERASE)


def test_a_line_is_never_wider_than_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    monkeypatch.setattr(status_line.console, "stderr_width", lambda: 20)
    with status_line.showing(False), progress.phase("a phase with a name that is long"):
        shown(stream, "a phase with")
    assert max(len(line) for line in stream.getvalue().split(status_line.ERASE)) == 19


def test_an_interrupt_takes_the_line_away(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    written: list[tuple[int, bytes]] = []
    with status_line.showing(False), progress.phase("counting"):
        lasting(stream, "counting")
        monkeypatch.setattr(status_line.os, "write", lambda fd, text: written.append((fd, text)))
        status_line.erase()
    assert written == [(2, status_line.ERASE.encode())]


@pytest.mark.parametrize("case", ["shown", "quiet", "NO_COLOR", "dumb", "piped"])
def test_no_phase_is_listened_to_where_no_line_is_wanted(monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    stream = terminal(monkeypatch)
    if case == "NO_COLOR":
        monkeypatch.setenv("NO_COLOR", "1")
    if case == "dumb":
        monkeypatch.setenv("TERM", "dumb")
    if case == "piped":
        monkeypatch.setattr(stream, "isatty", lambda: False)
    heard: list[str] = []
    monkeypatch.setattr(status_line.Status, "begin", lambda self, name: heard.append(name))
    monkeypatch.setattr(status_line.Status, "end", lambda self: None)
    with status_line.showing(case == "quiet"), progress.phase("counting"):
        pass
    assert heard == (["counting"] if case == "shown" else [])
    assert stream.getvalue() == ""


class Heard:
    """Keeps the names of all phases."""

    def __init__(self) -> None:
        self.names: set[str] = set()
        self.depth = 0

    def begin(self, name: str) -> None:
        self.names.add(name)
        self.depth += 1

    def end(self) -> None:
        self.depth -= 1


@pytest.mark.parametrize(
    ("work", "wanted"),
    [
        (lagcli.dof, {"looking for a consistent start", "classifying the constraints"}),
        (lagcli.check, {"counting degrees of freedom", "looking for multipliers that are not unique"}),
        (lambda m: prepare_run.prepare(m, m.simulation), {"preparing the run", "choosing independent rows"}),
        (lambda m: lagcli.simulate(m, duration=0.01, samples=2), {"simulating", "preparing the run"}),
        (lambda m: lagcli.compare(m, duration=0.01, samples=2), {"comparing"}),
        (lambda m: lagcli.audit(m, duration=0.01), {"auditing", "simulating"}),
        (lagcli.displacements, {"looking for displacements"}),
        (lagcli.derive, {"deriving the equations"}),
    ],
)  # fmt: skip
def test_all_work_is_a_phase(work, wanted) -> None:
    memory.forget()  # nothing is left of other tests
    heard = Heard()
    with progress.reported_to(heard):
        work(lagcli.load(MODEL))
    assert heard.names >= {"reading the model", "building the equations", *wanted}
    assert heard.depth == 0


COMPUTING = """
import numpy as np
from lagcli.output.files import interrupts
interrupts.install()
interrupts.end_promptly()
{begun}
print("now", flush=True)
np.linalg.eig(np.random.default_rng(0).standard_normal(({n}, {n})))
print("done", flush=True)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_ends_the_process_while_a_library_computes(number: signal.Signals) -> None:
    # What it computes takes minutes.
    text = COMPUTING.format(begun="", n=6000)
    with subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"now\n"
        time.sleep(0.3)  # it has begun to compute
        process.send_signal(number)
        try:
            assert process.wait(timeout=30) == 128 + number
        finally:
            process.kill()


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="signals of POSIX")
def test_what_has_been_begun_is_put_in_order_after_the_library_has_computed() -> None:
    text = COMPUTING.format(begun="unwinding = interrupts.unwinding()\nunwinding.__enter__()", n=600)
    with subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"now\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
        # An exception, for whoever has files to put in order, and not the end at once.
        assert b"Interrupted" in said
        assert process.returncode == 1
