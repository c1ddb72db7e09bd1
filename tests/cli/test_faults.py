"""A hundred faults at random moments of a run that writes, and what a pipe, a disk and a shell can do besides.

Whatever happens: under the final name stands the old file or the whole new one, the exit code tells what
happened, and the rows that are kept are the first rows of the run, all of them complete.
"""

import contextlib
import dataclasses
import functools
import io
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from numpy.typing import NDArray

import lagcli
from lagcli.api import prepare_run, run_settings
from lagcli.output.tables import sinks, table_format
from tests.helpers.pendulum import PENDULUM

if os.name != "posix":
    pytest.skip("signals, pipes and limits of POSIX", allow_module_level=True)

import fcntl
import resource

ROOT = Path(lagcli.__file__).parent.parent
COLUMNS = "t,a.x,a.z,lambda.rod,energy"
ENDLESS = {"duration": 2e5, "samples": 100_000_001}
SPARSE = {"duration": 1e6, "samples": 10_000_001}
SHORT = {"duration": 2.0, "samples": 2001}
FORMATS = ("csv", "json", "npz", "parquet")
SIGNALS = {"SIGINT": 130, "SIGTERM": 143, "SIGKILL": -9}
TEMPORARY = re.compile(r"\.run\.[a-z]+\.[0-9a-f]{8}\.tmp")
OLD = b"the old file"


# The runs


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the run writes; the model stands beside it."""
    (tmp_path / "model.yaml").write_text(PENDULUM)
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


def started(folder: Path, length: dict[str, float], *arguments: str, **how: Any) -> "subprocess.Popen[bytes]":
    """A run of the command line in a process of its own."""
    options = [f"--{key}={value}" for key, value in length.items()]
    command = [sys.executable, "-m", "lagcli", "simulate", "../model.yaml", "-q", "--columns", COLUMNS]
    # Without compiled modules on the disk, which a limit on files would cut.
    env = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([*command, *options, *arguments], cwd=folder, env=env, **(streams | how))


def ended(process: "subprocess.Popen[bytes]") -> tuple[int, str]:
    """Exit code and stderr."""
    try:
        err = process.communicate(timeout=20)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return process.returncode, err.decode()


class Expected:
    """The rows of a run, computed in this process as far as they are asked for."""

    def __init__(self, duration: float, samples: int) -> None:
        model = lagcli.loads(PENDULUM)
        changes = {"duration": duration, "samples": samples}
        running = prepare_run.start(model, run_settings.chosen(model, changes))
        self._picked = table_format.select(running.columns, COLUMNS)
        self.names = [running.columns[index] for index in self._picked]
        self._blocks = running.blocks()
        self._text = io.BytesIO()
        self._sink = sinks.open_sink(self._text, self.names)
        self._rows: list[NDArray[np.float64]] = [np.zeros((0, len(self.names)))]
        self._count = 0

    def _more(self) -> bool:
        block = next(self._blocks, None)
        if block is None:
            return False
        self._rows.append(block[:, self._picked])
        self._count += len(block)
        self._sink.write(self._rows[-1])
        return True

    def text(self, length: int) -> bytes:
        """The first bytes of the table as CSV, or all there are."""
        while self._text.tell() < length and self._more():
            pass
        return self._text.getvalue()[:length]

    def rows(self, count: int) -> NDArray[np.float64]:
        """The first rows, or all there are."""
        while self._count < count and self._more():
            pass
        self._rows = [np.concatenate(self._rows)]
        return self._rows[0][:count]


@functools.cache
def expected(duration: float, samples: int) -> Expected:
    return Expected(duration, samples)


def check_table(path: Path, ending: str, length: dict[str, float]) -> int:
    """The file is a whole table and holds the first rows of the run; their number."""
    reference = expected(length["duration"], int(length["samples"]))
    match ending:
        case "csv":
            text = path.read_bytes()
            assert text.endswith(b"\n")
            assert text == reference.text(len(text))
            return text.count(b"\n") - 1
        case "json":
            import json

            content = json.loads(path.read_text(encoding="utf-8"))
            names, rows = content["columns"], np.array(content["rows"]).reshape(-1, len(reference.names))
        case "npz":
            with np.load(path, allow_pickle=False) as archive:
                names, rows = archive.files, np.stack([archive[name] for name in archive.files], axis=1)
        case _:
            content = pyarrow.parquet.read_table(path)
            names, rows = content.column_names, np.stack([column.to_numpy() for column in content.columns], 1)
    assert names == reference.names
    assert np.array_equal(rows, reference.rows(len(rows)))
    return len(rows)


@functools.cache
def start_up() -> float:
    """Seconds from the start of a run to its first rows, on this machine as busy as it is."""
    began = time.monotonic()
    pipe, other = os.pipe()
    command = [sys.executable, "-m", "lagcli", "simulate", "-", "--duration=1e6", "--samples=1000001"]
    with contextlib.closing(os.fdopen(pipe, "rb")) as rows:
        env = os.environ | {"PYTHONPATH": str(ROOT)}
        process = subprocess.Popen(
            command, env=env, stdin=subprocess.PIPE, stdout=other, stderr=subprocess.DEVNULL
        )
        os.close(other)
        assert process.stdin is not None
        with process.stdin as model:
            model.write(PENDULUM.encode())
        assert rows.readline().startswith(b"t,")
    process.wait()
    return time.monotonic() - began


# The hundred


@dataclasses.dataclass(frozen=True)
class Case:
    """One fault; the number seeds its moment."""

    fault: str
    ending: str
    number: int

    def __str__(self) -> str:
        return f"{self.fault}-{self.ending}-{self.number}"

    @property
    def random(self) -> random.Random:
        return random.Random(str(self))

    def moment(self) -> float:
        """Seconds after the start, before anything is loaded or while rows are written."""
        return self.random.uniform(0.0, 1.5 * start_up())


CASES = [
    *(Case(name, ending, i) for name in SIGNALS for ending in FORMATS for i in range(5)),
    *(Case("closed", target, i) for target in ("stdout", "dash", "fifo") for i in range(4)),
    *(Case("full", ending, i) for ending in FORMATS for i in range(4)),
    *(Case("gone", ending, i) for ending in FORMATS for i in range(3)),
]


def test_there_are_a_hundred() -> None:
    assert len(CASES) == 100


def of(*faults: str) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("case", [case for case in CASES if case.fault in faults], ids=str)


@of("SIGINT", "SIGTERM")
def test_an_interrupt_leaves_the_old_file_and_whole_rows(folder: Path, case: Case) -> None:
    length = (ENDLESS, SPARSE)[case.number % 2]
    path = folder / f"run.{case.ending}"
    path.write_bytes(OLD)
    number = signal.Signals[case.fault]
    moment = case.moment()
    process = started(folder, length, "-o", path.name)
    time.sleep(moment)
    process.send_signal(number)
    code, err = ended(process)
    assert path.read_bytes() == OLD
    partial = folder / f"{path.name}.partial"
    kept = partial.exists()
    assert sorted(found.name for found in folder.iterdir()) == [path.name, partial.name][: 1 + kept]
    if kept:
        assert code == SIGNALS[case.fault]
        assert err == f"lagcli: interrupted; the complete rows are in {partial.name}\n"
        check_table(partial, case.ending, length)
    elif code == SIGNALS[case.fault]:
        assert err == ""
    else:
        # Python itself was not yet up: it dies of the signal, or says where it was.
        assert moment < start_up() / 2
        assert code == -number or "KeyboardInterrupt" in err


@of("SIGKILL")
def test_a_kill_leaves_the_old_file(folder: Path, case: Case) -> None:
    path = folder / f"run.{case.ending}"
    path.write_bytes(OLD)
    process = started(folder, ENDLESS, "-o", path.name)
    time.sleep(case.moment())
    process.kill()
    assert ended(process) == (-9, "")
    assert path.read_bytes() == OLD
    left = [found for found in folder.iterdir() if found != path]
    assert len(left) <= 1
    assert all(TEMPORARY.fullmatch(found.name) for found in left)
    if left and case.ending == "csv":
        text = left[0].read_bytes()
        whole = text[: text.rfind(b"\n") + 1]
        assert whole == expected(**ENDLESS).text(len(whole))


@of("closed")
def test_a_reader_that_goes_away_has_read_the_first_rows(folder: Path, case: Case) -> None:
    arguments = {"stdout": [], "dash": ["-o", "-"], "fifo": ["-o", "run.csv"]}[case.ending]
    deadline = time.monotonic() + case.moment()
    if case.ending == "fifo":
        os.mkfifo(folder / "run.csv")
        end = os.open(folder / "run.csv", os.O_RDONLY | os.O_NONBLOCK)
        process = started(folder, ENDLESS, *arguments)
    else:
        end, other = os.pipe()
        os.set_blocking(end, False)
        process = started(folder, ENDLESS, *arguments, stdout=other)
        os.close(other)
    text = b""
    # A pipe with a name is waited for until it has a reader, so that the reader goes when it has been opened.
    while time.monotonic() < deadline or (case.ending == "fifo" and not text and process.poll() is None):
        with contextlib.suppress(BlockingIOError):
            text += os.read(end, 1 << 20)
        time.sleep(0.001)
    os.close(end)
    assert ended(process) == (141, "")
    assert text == expected(**ENDLESS).text(len(text))
    assert [found.name for found in folder.iterdir()] == ["run.csv"] * (case.ending == "fifo")


@of("full")
def test_a_full_disk_leaves_the_old_file_and_nothing_else(folder: Path, case: Case) -> None:
    path = folder / f"run.{case.ending}"
    path.write_bytes(OLD)
    room = int(case.random.uniform(0.0, 50_000.0))

    def limit() -> None:
        # Python ignores SIGXFSZ, so that the system answers with an error, as it does when a disk is full.
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    process = started(folder, SHORT, "-o", path.name, preexec_fn=limit)
    code, err = ended(process)
    assert code == 74
    assert err.startswith(f"lagcli: cannot write {path.name}: ")
    assert err.count("\n") == 1
    assert path.read_bytes() == OLD
    assert [found.name for found in folder.iterdir()] == [path.name]


@of("gone")
def test_a_folder_that_goes_away_takes_the_old_file_with_it(folder: Path, case: Case) -> None:
    path = folder / f"run.{case.ending}"
    path.write_bytes(OLD)
    elsewhere = folder.with_name("elsewhere")
    process = started(folder, SHORT, "-o", str(path))
    time.sleep(case.moment())
    folder.rename(elsewhere)
    code, err = ended(process)
    assert not folder.exists()
    moved = elsewhere / path.name
    if code == 0:
        assert err == ""
        assert check_table(moved, case.ending, SHORT) == SHORT["samples"]
        return
    assert code == 74
    assert re.fullmatch(rf"lagcli: cannot write {re.escape(str(path))}: .*\n", err)
    assert moved.read_bytes() == OLD
    # Out of reach of the run, what it had begun goes with the folder.
    assert all(TEMPORARY.fullmatch(found.name) for found in elsewhere.iterdir() if found != moved)


# Besides


def await_(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def waiting(end: int) -> int:
    """Bytes in a pipe that nobody has read."""
    import termios

    return int.from_bytes(fcntl.ioctl(end, termios.FIONREAD, b"\0" * 4), sys.byteorder)


def stalled(end: int) -> bool:
    """Whether the writer of the pipe waits for its reader."""
    before = waiting(end)
    time.sleep(0.2)
    return waiting(end) == before > 0


@pytest.mark.parametrize("target", ["stdout", "fifo"])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_one_signal_ends_a_run_whose_reader_has_stopped_to_read(folder: Path, target: str, name: str) -> None:
    if target == "fifo":
        os.mkfifo(folder / "run.csv")
        end = os.open(folder / "run.csv", os.O_RDONLY | os.O_NONBLOCK)
        process = started(folder, ENDLESS, "-o", "run.csv")
    else:
        process = started(folder, ENDLESS)
        assert process.stdout is not None
        end = process.stdout.fileno()
    await_(lambda: stalled(end))
    process.send_signal(signal.Signals[name])
    began = time.monotonic()
    assert process.wait(timeout=30) == 128 + signal.Signals[name]
    assert time.monotonic() - began < 10
    if target == "fifo":
        os.close(end)
    assert process.stderr is not None
    assert "Traceback" not in process.stderr.read().decode()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()


def test_many_signals_are_no_traceback(folder: Path) -> None:
    path = folder / "run.csv"
    path.write_bytes(OLD)
    process = started(folder, ENDLESS, "-o", path.name)
    await_(lambda: any(found.stat().st_size > 1000 for found in folder.glob(".run*.tmp")))
    for _ in range(20):
        process.send_signal(signal.SIGTERM)
        time.sleep(0.002)
    code, err = ended(process)
    assert code in (143, -signal.SIGTERM)
    assert "Traceback" not in err
    assert "Exception ignored" not in err
    assert path.read_bytes() == OLD


def test_an_ignored_signal_stays_ignored(folder: Path) -> None:
    """As under `nohup`."""

    def ignore() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    process = started(folder, ENDLESS, "-o", "run.csv", preexec_fn=ignore)
    await_(lambda: any(found.stat().st_size > 1000 for found in folder.glob(".run*.tmp")))
    process.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert ended(process)[0] == 143


def test_an_interrupt_while_the_figure_is_drawn_leaves_a_whole_table(folder: Path) -> None:
    picture = folder / "run.png"
    picture.write_bytes(OLD)
    process = started(folder, SHORT, "-o", "run.csv", "--plot", "run.png")
    await_((folder / "run.csv").exists)
    process.send_signal(signal.SIGINT)
    assert ended(process) == (130, "lagcli: interrupted; run.csv is complete\n")
    assert check_table(folder / "run.csv", "csv", SHORT) == SHORT["samples"]
    assert picture.read_bytes() == OLD
    assert sorted(found.name for found in folder.iterdir()) == ["run.csv", "run.png"]


def test_output_to_a_pipe_with_a_name_is_the_table(folder: Path) -> None:
    os.mkfifo(folder / "run.csv")
    process = started(folder, SHORT, "-o", "run.csv")
    text = (folder / "run.csv").read_bytes()
    assert ended(process) == (0, "")
    assert text == expected(**SHORT).text(len(text) + 1)
    assert (folder / "run.csv").is_fifo()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
@pytest.mark.parametrize("ending", FORMATS)
def test_a_folder_that_may_not_be_written_is_reported_at_once(folder: Path, ending: str) -> None:
    (folder / f"run.{ending}").write_bytes(OLD)
    folder.chmod(0o500)
    try:
        process = started(folder, SHORT, "-o", f"run.{ending}")
        code, err = ended(process)
    finally:
        folder.chmod(0o700)
    assert code == 74
    assert err.startswith(f"lagcli: cannot write run.{ending}: ")
    assert [found.read_bytes() for found in folder.iterdir()] == [OLD]


@pytest.fixture(autouse=True)
def no_child_left() -> Iterator[None]:
    """A test that fails may leave its run behind; it must not eat the machine."""
    before = set(_children())
    yield
    for pid in set(_children()) - before:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def _children() -> list[int]:
    listed = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children")
    return [int(pid) for pid in listed.read_text().split()] if listed.exists() else []
