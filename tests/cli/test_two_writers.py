"""Two writers at one file: one is refused with exit 74, or both leave whole files; no row is lost.

No verdict hangs on who comes first. Where an order is needed another process has the lock, and says so.
"""

import contextlib
import errno
import itertools
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

import lagcli
from lagcli.output.files import atomic_file
from lagcli.output.sweeps import sweep_journal
from lagcli.output.tables import sinks, table_format
from tests.helpers import in_process
from tests.helpers.pendulum import PENDULUM

ROOT = pathlib.Path(lagcli.__file__).parents[1]
POINTS = 24
SWEEP = (
    "sweep", "m.yaml", "--over", f"L=1:2:{POINTS}", "--reduce", "p=max(lambda.rod)", "--duration", "0.5",
    "--samples", "11",
)  # fmt: skip
SHORT = ("simulate", "m.yaml", "--duration", "0.2", "--samples", "5", "-q")
GAPS = (0.0, 0.3)  # seconds between two starts; whatever they are, the same holds
WRITTEN = "another run or sweep is writing it"

HOLDER = """import sys, pathlib
from lagcli.output.files.atomic_file import FileLock
lock = FileLock(pathlib.Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
lock.release()
"""
# A command that waits where it has taken the lock on the file of this name.
WAITING = """import sys
from lagcli.output.files import atomic_file
name, *arguments = sys.argv[1:]
begin = atomic_file.FileLock.__init__

def waiting(lock, target):
    begin(lock, target)
    if target.name == name:
        print("held", file=sys.stderr, flush=True)
        sys.stdin.readline()

atomic_file.FileLock.__init__ = waiting
sys.argv = ["lagcli", *arguments]
from lagcli.__main__ import main
main()
"""
posix = pytest.mark.skipif(os.name != "posix", reason="signals and forks of POSIX")


@pytest.fixture(autouse=True)
def folder(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    (tmp_path / "m.yaml").write_text(PENDULUM)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(folder: pathlib.Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file() and path.name != "m.yaml")


def started(*arguments: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "lagcli", *arguments]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env)


def both(one: tuple[str, ...], other: tuple[str, ...], gap: float) -> list[tuple[int, str]]:
    """Exit codes and messages of two commands, of which the second begins a little later."""
    first = started(*one)
    time.sleep(gap)
    second = started(*other)
    return [
        (process.wait(60), err) for process in (first, second) if (err := process.communicate()[1]) or True
    ]


def require_order(ends: list[tuple[int, str]], name: str) -> list[int]:
    """One ends well at least, and who does not says which file it is; the codes."""
    codes = [code for code, _ in ends]
    assert 0 in codes, ends
    assert set(codes) <= {0, 74}, ends
    for code, err in ends:
        assert (f"cannot write {name}: {WRITTEN}" in err) == (code == 74), ends
        assert "Traceback" not in err
    return codes


@contextlib.contextmanager
def held(path: str) -> Iterator["subprocess.Popen[str]"]:
    """Another process has the lock on a file."""
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", HOLDER, path]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=env
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        if process.poll() is None:
            process.communicate("")


def refused(*arguments: str, name: str) -> None:
    """The command exits 74 with the name of the file, and every file is as it was."""
    before = {path: path.read_bytes() for path in pathlib.Path().rglob("*") if path.is_file()}
    done = in_process.completed(*arguments)
    assert (done.returncode, done.stdout) == (74, ""), done.stderr
    assert f"cannot write {name}: {WRITTEN}" in done.stderr
    assert {path: path.read_bytes() for path in pathlib.Path().rglob("*") if path.is_file()} == before


# Races of real processes.


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of the sweep."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "m.yaml").write_text(PENDULUM)
    assert in_process.completed(*SWEEP, "-o", "w.csv", folder=folder).returncode == 0
    return (folder / "w.csv").read_bytes()


def test_two_sweeps_at_one_file_leave_all_rows(folder: pathlib.Path, whole: bytes) -> None:
    for gap in GAPS:
        ends = both((*SWEEP, "-o", "w.csv"), (*SWEEP, "-o", "w.csv"), gap)
        require_order(ends, "w.csv")
        assert all(f"{POINTS} points: {POINTS} done" in err for code, err in ends if code == 0)
        assert (folder / "w.csv").read_bytes() == whole
        assert names(folder) == ["w.csv"]
        (folder / "w.csv").unlink()


def test_two_resumes_of_one_sweep_end_in_its_table(folder: pathlib.Path, whole: bytes) -> None:
    assert in_process.completed(*SWEEP, "-o", "w.csv", "--resume").returncode == 0
    journal = sweep_journal.path_of(folder / "w.csv")
    header = journal.read_bytes().splitlines(keepends=True)[0]
    for gap in GAPS:
        (folder / "w.csv").unlink(missing_ok=True)
        journal.write_bytes(header)  # as a kill has left it
        resumed = (*SWEEP, "-o", "w.csv", "--resume")
        require_order(both(resumed, resumed, gap), "w.csv")
        assert (folder / "w.csv").read_bytes() == whole
        assert names(folder) == [journal.name, "w.csv"]


def test_twins_of_one_shard_and_shards_side_by_side(folder: pathlib.Path) -> None:
    one, two = ((*SWEEP, "--shard", f"{i}/2", "-o", "rows/") for i in (1, 2))
    part = os.path.join("rows", "part-00001-of-00002.parquet")
    require_order(both(one, one, 0.0), part)
    assert [code for code, _ in both(one, two, 0.0)] == [0, 0]
    assert names(folder) == [f"part-0000{i}-of-00002.parquet" for i in (1, 2)]
    for i in (1, 2):
        read = table_format.opened(folder / "rows" / f"part-0000{i}-of-00002.parquet")
        assert read.take(["point"])[:, 0].tolist() == list(range(i - 1, POINTS, 2))


def test_two_runs_with_one_checkpoint_leave_what_one_leaves(folder: pathlib.Path) -> None:
    command = ("simulate", "m.yaml", "--duration", "20", "--samples", "2001", "-q", "--checkpoint", "c.json")
    assert in_process.completed(*command, "-o", "alone.csv").returncode == 0
    expected = (folder / "alone.csv").read_bytes()
    (folder / "alone.csv").unlink()
    for one, other in ((("t.csv",), ("u.csv",)), (("t.csv",), ("t.csv",))):
        ends = both((*command, "-o", *one), (*command, "-o", *other), 0.0)
        require_order(ends, "c.json")
        done = {name for (code, _), (name,) in zip(ends, (one, other), strict=True) if code == 0}
        assert names(folder) == ["c.json", *sorted(done)]
        for name in done:
            assert (folder / name).read_bytes() == expected
            (folder / name).unlink()


@pytest.mark.parametrize("extra", [(), ("--checkpoint", "c.json")])
def test_two_runs_at_one_table_leave_one_of_both(folder: pathlib.Path, extra: tuple[str, ...]) -> None:
    runs = [
        ("simulate", "m.yaml", "--duration", d, "--samples", "801", "-q", "-o", "t.csv") for d in ("4", "5")
    ]
    tables = []
    for run in runs:
        assert in_process.completed(*run).returncode == 0
        tables.append((folder / "t.csv").read_bytes())
    codes = require_order(both((*runs[0], *extra), runs[1], 0.0), "t.csv")
    assert (folder / "t.csv").read_bytes() in [
        table for table, code in zip(tables, codes, strict=True) if not code
    ]
    assert names(folder) == sorted(["t.csv", *(["c.json"] if extra and codes[0] == 0 else [])])


# Two commands, of which the second runs to its end while the first has the lock.

FEW = (*SWEEP[:3], "L=1:2:4", *SWEEP[4:])
PARTS = tuple((*FEW, "--shard", f"{i}/2", "-o", f"part-{i}.csv") for i in (1, 2))
MERGE = ("sweep", "--merge", "part-1.csv", "part-2.csv", "-o", "all.csv")
AT_TABLE = (*FEW, "-o", "w.csv")
KEPT = (*SHORT, "--checkpoint", "c.json")
PAIRS = {
    "two sweeps": ("w.csv", (), AT_TABLE, AT_TABLE),
    "two resumes": ("w.csv", (), (*AT_TABLE, "--resume"), (*AT_TABLE, "--resume")),
    "resume beside sweep": ("w.csv", (), AT_TABLE, (*AT_TABLE, "--resume")),
    "sweep beside resume": ("w.csv", (), (*AT_TABLE, "--resume"), AT_TABLE),
    "run beside sweep": ("w.csv", (), AT_TABLE, (*SHORT, "-o", "w.csv")),
    "twins of a shard": ("part-1.csv", (), PARTS[0], PARTS[0]),
    "merge beside shard": ("part-1.csv", PARTS[1:], PARTS[0], MERGE),
    "two merges": ("all.csv", PARTS, MERGE, MERGE),
    "sweep beside merge": ("all.csv", PARTS, MERGE, (*FEW, "-o", "all.csv")),
    "two runs with one checkpoint": ("c.json", (), (*KEPT, "-o", "t.csv"), (*KEPT, "-o", "u.csv")),
    "two runs with a checkpoint each": (
        "t.csv", (), (*KEPT, "-o", "t.csv"), (*SHORT, "--checkpoint", "d.json", "-o", "t.csv"),
    ),
    "run beside run with checkpoint": ("t.csv", (), (*KEPT, "-o", "t.csv"), (*SHORT, "-o", "t.csv")),
}  # fmt: skip


@pytest.mark.parametrize("pair", PAIRS)
def test_the_second_of_two_commands_is_refused_while_the_first_has_the_file(
    folder: pathlib.Path, pair: str
) -> None:
    """The first ends as if it had been alone."""
    name, before, one, other = PAIRS[pair]
    for command in (*before, one):
        assert in_process.completed(*command).returncode == 0
    alone = {path.name: path.read_bytes() for path in folder.iterdir()}
    for path in folder.iterdir():
        if path.name != "m.yaml":
            path.unlink()
    for command in before:
        assert in_process.completed(*command).returncode == 0
    with subprocess.Popen(
        [sys.executable, "-c", WAITING, name, *one],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        assert process.stderr.readline() == "held\n"
        try:
            refused(*other, name=name)
        finally:
            _, err = process.communicate("\n")
    assert process.returncode == 0, err
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert after.keys() == alone.keys()
    assert after[name] == alone[name] or name.endswith(".json")


# Another process is at it.


def test_a_sweep_and_its_resume_are_refused_beside_another() -> None:
    with held("w.csv"):
        refused(*SWEEP, "-o", "w.csv", name="w.csv")
        refused(*SWEEP, "-o", "w.csv", "--resume", name="w.csv")
        refused(*SHORT, "-o", "w.csv", name="w.csv")  # it would be replaced when the sweep ends
    assert in_process.completed(*SHORT, "-o", "w.csv").returncode == 0


def test_a_link_is_the_file_it_leads_to(folder: pathlib.Path) -> None:
    (folder / "link.csv").symlink_to("w.csv")
    with held("w.csv"):
        done = in_process.completed(*SWEEP, "-o", "link.csv")
    assert done.returncode == 74
    assert WRITTEN in done.stderr


def test_a_merge_is_refused_beside_a_sweep_at_its_table_or_at_a_shard(folder: pathlib.Path) -> None:
    parts = [f"part-{i}.csv" for i in (1, 2)]
    for i, part in enumerate(parts, 1):
        assert in_process.completed(*SWEEP, "--shard", f"{i}/2", "-o", part).returncode == 0
    merge = ("sweep", "--merge", *parts, "-o", "all.csv")
    for name in ("all.csv", parts[1]):
        with held(name):
            refused(*merge, name=name)
    assert in_process.completed(*merge).returncode == 0
    assert names(folder) == ["all.csv", *parts]


def test_a_run_is_refused_beside_another_at_its_checkpoint_or_a_table(folder: pathlib.Path) -> None:
    run = (*SHORT, "-o", "t.csv", "--events", "e.csv", "--checkpoint", "c.json")
    for name in ("c.json", "t.csv", "e.csv"):
        with held(name):
            refused(*run, name=name)
    assert in_process.completed(*run).returncode == 0
    longer = ("simulate", "m.yaml", "--duration", "0.4", "--output-step", "0.05", "-q", "--resume", "c.json")
    with held("c.json"):
        refused(*longer, "-o", "u.csv", name="c.json")
        with pytest.raises(OSError, match=WRITTEN):
            lagcli.simulate("m.yaml", duration=0.1, checkpoint="c.json")
    # Runs that only begin where another one has stood do not exclude each other.
    assert in_process.completed(*longer, "-o", "u.csv").returncode == 0
    assert names(folder) == ["c.json", "e.csv", "t.csv", "u.csv"]


def test_full_tables_are_of_one_sweep(folder: pathlib.Path) -> None:
    pytest.importorskip("pandas")
    full = (*SWEEP[:3], "L=1:2:3", *SWEEP[4:], "--tables", "full/")
    (folder / "full").mkdir()
    with held("full/point-part-00001-of-00001.csv"):
        done = in_process.completed(*full)
        assert (done.returncode, done.stdout) == (74, "")
        assert WRITTEN in done.stderr
        with pytest.raises(OSError, match=WRITTEN):
            lagcli.sweep("m.yaml", {"L": [1, 2]}, tables="full/")
        assert in_process.completed(*full, "--shard", "1/2").returncode == 0
    assert in_process.completed(*full, "--jobs", "2").returncode == 0
    assert names(folder) == [f"point-{i:07d}.csv" for i in range(3)]


@posix
def test_a_lock_ends_with_its_process(folder: pathlib.Path) -> None:
    with held("w.csv") as process:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert names(folder) == [".w.csv.lock"]  # a file, and no lock
    assert in_process.completed(*SHORT, "-o", "w.csv").returncode == 0
    assert in_process.completed(*SWEEP, "-o", "w.csv").returncode == 0
    assert names(folder) == ["w.csv"]


# The lock itself.


def test_threads_exclude_each_other_and_one_of_many_has_the_lock(folder: pathlib.Path) -> None:
    target, inside, most = folder / "w.csv", [], []

    def take() -> None:
        for _ in range(200):
            with contextlib.suppress(OSError), atomic_file.FileLock(target):
                inside.append(1)
                most.append(len(inside))
                inside.pop()

    threads = [threading.Thread(target=take) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert max(most) == 1
    assert names(folder) == []


@posix
def test_a_forked_process_neither_has_nor_gives_back_the_lock(folder: pathlib.Path) -> None:
    target = folder / "w.csv"
    lock = atomic_file.FileLock(target)
    child = os.fork()
    if child == 0:
        atomic_file.release_all()
        time.sleep(60)
        os._exit(0)
    try:
        with pytest.raises(OSError, match=WRITTEN):
            atomic_file.FileLock(target)
        lock.release()
        atomic_file.FileLock(target).release()  # the child is there still
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert names(folder) == []


@posix
def test_a_lock_on_a_file_that_went_is_none(folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever had the lock removes its file between the opening of the next and its lock."""
    target, lock, calls = folder / "w.csv", atomic_file._lock, []

    def late(number: int) -> None:
        if not calls:
            atomic_file.lock_path(target).unlink()
        calls.append(number)
        lock(number)

    monkeypatch.setattr(atomic_file, "_lock", late)
    with atomic_file.FileLock(target):
        assert names(folder) == [".w.csv.lock"]
        monkeypatch.undo()
        with pytest.raises(OSError, match=WRITTEN):
            atomic_file.FileLock(target)
    assert len(calls) == 2


def test_without_locks_of_the_system_the_file_is_one(
    folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(number: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(atomic_file, "_lock", none)
    monkeypatch.setattr(atomic_file, "_unlock", none)
    with atomic_file.FileLock(folder / "w.csv"):
        with pytest.raises(OSError, match=f"if nothing writes it, remove .*{'.w.csv.lock'}"):
            atomic_file.FileLock(folder / "w.csv")
        atomic_file.PendingFile(folder / "w.csv").discard()  # its own writer passes
    assert names(folder) == []
    (folder / ".w.csv.lock").touch()  # as a kill has left it
    done = in_process.completed(*SWEEP, "-o", "w.csv")
    assert done.returncode == 74
    assert "this file system has no locks" in done.stderr
    assert in_process.completed(*SHORT, "-o", "w.csv").returncode == 74
    assert names(folder) == [".w.csv.lock"]


def test_a_folder_that_takes_no_file_is_named(folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = os.open

    def closed(path: str, flags: int, *arguments: object, **options: object) -> int:
        if flags & os.O_CREAT:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return opened(path, flags, *arguments, **options)

    monkeypatch.setattr(os, "open", closed)
    for command in ((*SWEEP, "-o", "w.csv"), (*SHORT, "-o", "w.csv", "--checkpoint", "c.json")):
        done = in_process.completed(*command)
        assert done.returncode == 74
        assert f": {os.strerror(errno.EACCES)}" in done.stderr
    assert names(folder) == []


@pytest.mark.parametrize("length", [4, 236, 255])
def test_any_name_has_a_lock(folder: pathlib.Path, length: int) -> None:
    target = folder / ("x" * (length - 4) + ".csv")
    with atomic_file.FileLock(target), pytest.raises(OSError, match=WRITTEN):
        atomic_file.FileLock(target)
    other = target.with_name("y" + target.name[1:])
    with atomic_file.FileLock(target), atomic_file.FileLock(other):
        pass
    assert names(folder) == []


# Rows that are written are those that were planned.


@pytest.mark.parametrize("ending", ["csv", "json", "npz", "parquet"])
def test_a_table_without_all_of_its_rows_takes_no_place(folder: pathlib.Path, ending: str) -> None:
    path = folder / f"t.{ending}"
    path.write_text("old")
    sink = sinks.open_sink(path, ["t", "x"])
    sink.write(np.zeros((3, 2)))
    with pytest.raises(OSError, match="3 rows were written of 4"):
        sink.commit(planned=4)
    assert path.read_text() == "old"
    assert names(folder) == [path.name]


@pytest.mark.parametrize("damage", ["short", "torn", "twice"])
def test_a_journal_that_lost_rows_is_no_table(
    folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    """As two writers without locks have left it."""
    (folder / "w.csv").write_text("old")
    close = sweep_journal.SweepJournal.sync

    def damaged(self: sweep_journal.SweepJournal) -> None:
        close(self)
        lines = self.path.read_bytes().splitlines(keepends=True)
        lines[7:8] = {"short": [], "torn": [lines[7][:-3]], "twice": [lines[6]]}[damage]
        self.path.write_bytes(b"".join(lines))

    monkeypatch.setattr(sweep_journal.SweepJournal, "sync", damaged)
    monkeypatch.setattr("lagcli.output.sweeps.written_sweep.SYNC", 1e9)
    done = in_process.completed(*SWEEP, "-o", "w.csv")
    assert done.returncode == 74
    assert "cannot write w.csv" in done.stderr
    assert (folder / "w.csv").read_text() == "old"


def test_rows_of_a_run_that_get_lost_are_seen(folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write, calls = sinks.Sink.write, itertools.count()
    monkeypatch.setattr(
        sinks.Sink,
        "write",
        lambda self, rows, texts=(): write(self, rows[min(1, next(calls)) - 1 :], texts),
    )
    (folder / "t.csv").write_text("old")
    done = in_process.completed(*SHORT, "-o", "t.csv")
    assert done.returncode == 74
    assert "rows were written of 5" in done.stderr
    assert (folder / "t.csv").read_text() == "old"
