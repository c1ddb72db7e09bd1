"""Rows that are safe: beside FILE at every checkpoint, in FILE.partial after a stop; and where tables come from."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

import lagcli
from lagcli.api import prepare_run
from lagcli.output.files import atomic_file, interrupts
from lagcli.output.tables import parquet_format, row_file, sinks, table_format
from lagcli.running import run_tables, simulation_run
from lagcli.simulation import loop
from lagcli.simulation.run_state import checkpoint
from lagcli.simulation.scheme import controller
from tests.helpers import in_process, pendulum
from tests.helpers.in_process import command

__all__ = ["command"]

PENDULUM = (
    pendulum.PENDULUM.replace("g: 9.81}", "g: 9.81, k: [1, 2, 3]}")
    + "simulation: {duration: 2, samples: 201}\n"
)
COLLAPSE = """\
lagcli: 1
coordinates: {x: {value: 1}}
lagrangian: rate(x)**2/2 + 1/x
simulation: {duration: 2, samples: 41}
"""
FORMATS = ("csv", "json", "npz", "parquet")
every_format = pytest.mark.parametrize("ending", FORMATS)
posix = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(PENDULUM)
    Path("stops.yaml").write_text(COLLAPSE)
    return tmp_path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def read(path, ending=""):
    """A table, whatever its name ends with."""
    copy = Path(f"copy.{ending or Path(path).suffix[1:]}")
    shutil.copy(path, copy)
    found = table_format.read(copy)
    copy.unlink()
    return found


class Killed(BaseException):
    """The end of the process, as far as this process can play it: nothing is put in order."""


def killer(patch):
    """A function that raises `Killed`; what the system would close is closed, and nothing is written."""
    opened, open_rows = [], row_file.RowFile.__init__

    def noted(file, *arguments):
        open_rows(file, *arguments)
        opened.append(file)

    def closed(sink):
        # A Parquet file would get its end.
        if not isinstance(sink._writer, parquet_format.ParquetWriter):
            sink._writer.abandon()

    def kill(*_, **options):
        for file in opened:
            file.close()
        raise Killed

    patch.setattr(row_file.RowFile, "__init__", noted)
    patch.setattr(sinks.Sink, "discard", closed)
    return kill


@pytest.fixture
def killed(monkeypatch):
    """killed(after): every run from now on is killed outright after so many blocks; its files stay as they are."""

    def arm(after, at=None):
        monkeypatch.setattr(loop, "PAUSE", 0.0)
        monkeypatch.setattr(loop, "BLOCK_VALUES", 200)
        monkeypatch.setattr(run_tables, "EVERY", 0.0)
        monkeypatch.setattr(atomic_file, "sweep", lambda: None)
        kill, taken = killer(monkeypatch), []
        take = run_tables.RunTables.take

        def counted(self, *arguments):
            take(self, *arguments)
            taken.append(1)
            if len(taken) == after:
                kill()

        monkeypatch.setattr(run_tables.RunTables, "take", counted)

    return arm


# Killed outright.


@every_format
def test_rows_that_a_checkpoint_has_passed_survive_a_kill(command, here, ending, killed, monkeypatch):
    whole = lagcli.simulate(lagcli.load("m.yaml"))
    file = f"run.{ending}"
    with monkeypatch.context():
        killed(7)
        with pytest.raises(Killed):
            command("simulate", "m.yaml", "-q", "-o", file, "--checkpoint", "ck")
    monkeypatch.undo()
    os.chdir(here)
    point = checkpoint.read("ck")
    safe = np.load(f"{file}.rows", max_header_size=10**6)
    assert list(safe.dtype.names) == list(whole.columns)
    assert len(safe) >= point.table.count == np.searchsorted(whole.t, point.run_state.row) + 1
    assert np.array_equal(np.stack([safe[n] for n in whole.columns], 1), whole.rows[: len(safe)])
    # The rows after the checkpoint alone, as ever; the others stay where they are.
    assert cli("-o", f"rest.{ending}", "--resume", "ck").returncode == 0
    assert np.array_equal(read(f"rest.{ending}")[1], whole.rows[point.table.count :])
    assert Path(f"{file}.rows").exists()
    # Or all of them, where the same table is asked for.
    done = cli("-o", file, "--resume", "ck", "--checkpoint", "ck")
    assert done.returncode == 0, done.stderr
    assert (
        f"with the {point.table.count} rows up to t = {point.run_state.row:.9g} of the run before"
        in done.stderr
    )
    assert np.array_equal(read(file)[1], whole.rows)
    assert not Path(f"{file}.rows").exists()
    again = cli("-o", file, "--resume", "ck")
    assert (again.returncode, f"nothing is left to do: {file} is complete" in again.stderr) == (0, True)
    assert np.array_equal(read(file)[1], whole.rows)


@every_format
def test_a_finished_run_that_is_resumed_has_nothing_left_to_do(command, here, ending):
    """A script may always give `--resume`: the exit code is 0, and no table and no checkpoint is touched."""
    files = ["-o", f"run.{ending}", "--events", f"e.{ending}", "--event-rows", "--checkpoint", "ck"]
    assert cli(*files, "--stats", "s.json").returncode == 0
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in here.iterdir()}
    for options in ([], ["-q"], ["--stats", "s.json"]):
        done = cli(*files, *options, "--resume", "ck")
        assert done.returncode == 0, done.stderr
        tables = f"run.{ending} and e.{ending}"
        sentence = f"note: nothing is left to do: {tables} are complete, with all rows of this run\n"
        assert done.stderr.endswith("" if "-q" in options else sentence)
    assert {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in here.iterdir()} == before


@every_format
def test_a_table_that_is_not_proved_to_be_of_the_finished_run_is_refused(command, here, ending):
    file, options = f"run.{ending}", ("--resume", "ck")
    assert cli("-q", "-o", file, "--checkpoint", "ck").returncode == 0
    assert cli("-q", "-o", "few.csv", "--samples", "3", "--stats", "few.json").returncode == 0
    for arguments, reason in (
        (("-o", f"other.{ending}"), "the run before did not write it"),
        (("-o", file, "--events", "e.csv"), "--events e.csv: the run before did not write it"),
        (("-o", file, "--duration", "1"), f"--output {file}: the run before ended at t = "),
        (("-o", file, "--samples", "11"), "the run before wrote other rows into it"),
        (("-o", file, "--event-rows"), "the run before wrote other rows into it"),
        (("-o", file, "--columns", "t"), "it has other columns"),
        (("-o", file, "--plot", "f.svg"), "--plot f.svg: `lagcli plot` draws a table"),
        (("-o", file, "--checkpoint", "second"), "--checkpoint second: ck is the checkpoint of the end"),
        (("-o", file, "--json"), "--json: the account was printed by the run before"),
        (("-o", file, "--stats", "s.json"), "--stats s.json: it is not the account of this run"),
        (("-o", file, "--stats", "few.json"), "--stats few.json: it is not the account of this run"),
        (("-o", "-"), "rows that went to standard output are not there"),
    ):
        before = {path: path.read_bytes() for path in here.iterdir()}
        done = cli(*arguments, *options)
        assert (done.returncode, done.stdout) == (2, ""), arguments
        assert "--resume ck: nothing is left to do" in done.stderr
        assert reason in done.stderr
        assert {path: path.read_bytes() for path in here.iterdir()} == before
    columns, rows = read(file)
    whole = rows.copy()
    rows[-1, 1] = np.nextafter(rows[-1, 1], np.inf)
    for damaged in (rows, rows[:-1]):
        with sinks.open_sink(Path(file), columns) as sink:
            sink.write(damaged)
            sink.finish()
            sink.commit()
        done = cli("-o", file, *options)
        assert (done.returncode, "its rows are not those of the run before" in done.stderr) == (2, True)
    Path(file).unlink()
    done = cli("-o", file, *options)
    assert (done.returncode, "No such file" in done.stderr) == (2, True)
    if ending != "csv":  # which has no place for a provenance
        with sinks.open_sink(Path(file), columns, provenance={"sha256": "0"}) as sink:
            sink.write(whole)
            sink.finish()
            sink.commit()
        done = cli("-o", file, *options)
        assert (done.returncode, "provenance is that of a different model" in done.stderr) == (2, True)


def cli(*arguments):
    return in_process.completed("simulate", "m.yaml", *arguments)


@every_format
def test_a_table_that_only_had_to_be_moved_is_completed(command, here, ending, monkeypatch):
    """Killed between the last checkpoint and the move: nothing is left to compute."""
    file = f"run.{ending}"
    with monkeypatch.context() as patch:
        patch.setattr(run_tables, "EVERY", 0.0)
        patch.setattr(sinks.Sink, "commit", killer(patch))
        with pytest.raises(Killed):
            command("simulate", "m.yaml", "-q", "-o", file, "--checkpoint", "ck")
    assert not Path(file).exists()
    out, err, code = command("simulate", "m.yaml", "-o", file, "--resume", "ck", "--stats", "s.json")
    assert (out, code) == ("", 0), err
    assert np.array_equal(read(file)[1], lagcli.simulate(lagcli.load("m.yaml")).rows)
    assert json.loads(Path("s.json").read_text())["rows"] == 201


@pytest.mark.parametrize("options", [[], ["--checkpoint", "ck"]], ids=["ends", "goes on"])
def test_a_table_that_is_completed_leaves_nothing_of_the_part_before(command, here, options, monkeypatch):
    """The rows and the events of a run that was interrupted, which are in the tables."""
    files = ["-q", "-o", "run.csv", "--events", "e.csv"]
    interrupted_once(command, monkeypatch, *files)
    before = ["ck", "e.csv.partial", "e.csv.rows", "m.yaml", "run.csv.partial", "run.csv.rows", "stops.yaml"]
    assert names(here) == before
    # A table of the rows after the checkpoint alone leaves those before it.
    assert cli("-q", "-o", "rest.csv", "--resume", "ck").returncode == 0
    assert names(here) == sorted([*before, "rest.csv"])
    done = cli(*files, "--resume", "ck", *options)
    assert done.returncode == 0, done.stderr
    assert names(here) == ["ck", "e.csv", "m.yaml", "rest.csv", "run.csv", "stops.yaml"]
    assert np.array_equal(read("run.csv")[1], lagcli.simulate(lagcli.load("m.yaml")).rows)


def test_a_run_that_ends_before_the_rows_of_its_table_is_refused(command, here, monkeypatch):
    """Interrupted between two rows: the table would go beyond what is asked for, or end without the row at its end."""
    grid = ["-q", "-o", "run.csv", "--events", "e.csv", "--output-step", "0.5"]
    interrupted_once(command, monkeypatch, *grid, after=60)
    state = checkpoint.read("ck").run_state
    assert state.row < state.t < 2
    left = names(here)
    contents = [Path(name).read_bytes() for name in left]
    short, between = state.row / 2, (state.row + state.t) / 2
    for duration, sentence in (
        (short, f"wrote rows up to t = {state.row:.9g} into it, and this one ends at {short:.9g}"),
        (between, f"went on to t = {state.t:.9g} without a row at {between:.9g}, where this one ends"),
    ):
        done = cli(*grid, "--duration", repr(duration), "--resume", "ck")
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith(f"lagcli: --output run.csv: the run before {sentence}: give ")
        assert names(here) == left
        assert [Path(name).read_bytes() for name in left] == contents
    done = cli(*grid, "--duration", repr(state.row), "--resume", "ck")
    assert done.returncode == 0, done.stderr
    assert read("run.csv")[1][-1, 0] == state.row


def interrupted_once(command, monkeypatch, *options, after=7):
    """A run that keeps a checkpoint and is interrupted after some rows."""
    take, taken = run_tables.RunTables.take, []

    def counted(self, *arguments):
        take(self, *arguments)
        taken.append(1)
        if len(taken) == after:
            interrupts._handle(signal.SIGINT, None)

    with monkeypatch.context() as patch:
        patch.setattr(loop, "PAUSE", 0.0)  # behind each step, of which native code takes many at once
        patch.setattr(loop.paying, "pays", lambda steps: False)
        patch.setattr(loop, "BLOCK_VALUES", 200)
        patch.setattr(run_tables.RunTables, "take", counted)
        assert command("simulate", "m.yaml", *options, "--checkpoint", "ck")[2] == 130


def test_the_rows_are_on_the_disk_before_the_checkpoint_is(here, monkeypatch):
    order = []
    sync, write = os.fsync, atomic_file.PendingFile.commit
    monkeypatch.setattr(os, "fsync", lambda number: (order.append("sync"), sync(number)))
    monkeypatch.setattr(
        atomic_file.PendingFile, "commit", lambda *a, **k: (order.append("move"), write(*a, **k))[1]
    )
    model = lagcli.load("m.yaml")
    running = prepare_run.start(model, model.simulation)
    plan = run_tables.TablePlan("--output", "run.csv", running.columns, step=running.grid.step)
    with run_tables.opened_table(plan, {}) as table:
        table.keep_rows()
        keeper = run_tables.CheckpointWriter(here / "ck", table)
        order.clear()
        block = next(running.blocks())
        table.write(block)
        keeper.take(running.checkpoint())
        of_checkpoint = list(order)
        table.leave_rows(is_complete=False)
    # The rows, their number, then the checkpoint, its file and its name.
    assert of_checkpoint[:3] == ["sync", "sync", "move"]
    assert of_checkpoint[3:] == ["sync", "sync"][: 1 + (os.name == "posix")]
    assert checkpoint.read("ck").table == checkpoint.CheckpointTable(
        "run.csv", 0.01, len(block), row_file.of_rows(running.columns, block).checksum
    )


def test_a_checkpoint_costs_the_same_however_many_rows_there_are(here, monkeypatch):
    file = row_file.RowFile(here / "rows", ("t", "x"))
    written = []
    put = row_file.RowFile._put
    monkeypatch.setattr(
        row_file.RowFile, "_put", lambda f, place, data: (written.append(len(data)), put(f, place, data))
    )
    for _ in range(3):
        for _ in range(50):
            file.write(np.ones((10, 2)))
        file.sync()
    assert set(written) == {160, len(row_file._header(("t", "x"), 0))}
    assert np.load("rows").shape == (1500,)
    file.remove()
    assert not Path("rows").exists()


# What does not fit is refused, for its rows would be lost.


@pytest.fixture
def broken_off(command, here, killed, monkeypatch):
    """A run that was killed, with its checkpoint `ck` and its rows in `run.csv.rows`."""
    killed(5)
    with pytest.raises(Killed):
        command("simulate", "m.yaml", "-q", "-o", "run.csv", "--checkpoint", "ck")
    monkeypatch.undo()
    monkeypatch.chdir(here)
    return command


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--columns", "t,lambda.*"], "has other columns"),
        (["--output-step", "0.5"], "wrote rows 0.01 apart into it, and this one 0.5"),
    ],
)
def test_a_table_of_other_rows_is_not_gone_on_with(broken_off, here, options, sentence):
    before = Path("run.csv.rows").read_bytes()
    monkey = cli(*options, "-o", "run.csv", "--resume", "ck", "--checkpoint", "ck")
    assert monkey.returncode == 2
    assert sentence in monkey.stderr
    assert "give another file" in monkey.stderr
    assert Path("run.csv.rows").read_bytes() == before
    assert cli(*options, "-o", "other.csv", "--resume", "ck").returncode == 0


def test_rows_that_are_damaged_or_gone_are_known(broken_off, here):
    rows = Path("run.csv.rows")
    data = bytearray(rows.read_bytes())
    data[-9] ^= 1
    damaged, torn = here / "damaged", bytes(data[: -8 * 40])
    rows.write_bytes(data)
    point = checkpoint.read("ck").table
    columns = lagcli.simulate(lagcli.load("m.yaml"), duration=0).columns
    assert len(data) == len(row_file._header(columns, 0)) + 8 * len(columns) * point.count
    cases = (data, "different run, or is damaged"), (torn, "less rows"), (b"t,x\n", "no rows of a run")
    for content, sentence in cases:
        rows.write_bytes(content)
        done = cli("-o", "run.csv", "--resume", "ck")
        assert done.returncode == 2
        assert sentence in done.stderr
    assert not damaged.exists()
    rows.unlink()
    assert cli("-q", "-o", "run.csv", "--resume", "ck").returncode == 0
    assert len(read("run.csv")[1]) == 201 - point.count


def test_a_file_of_another_kind_is_not_taken_for_rows(command, here):
    Path("run.csv.rows").write_text("my notes")
    _, err, code = command("simulate", "m.yaml", "-o", "run.csv", "--checkpoint", "ck")
    assert code == 74
    assert "run.csv.rows: the file exists and holds no rows of a run" in err
    assert Path("run.csv.rows").read_text() == "my notes"
    _, err, code = command("simulate", "m.yaml", "-o", "run.csv", "--checkpoint", "run.csv.rows")
    assert code == 2


def test_a_run_that_ends_leaves_no_rows_behind(command, here):
    assert command("simulate", "m.yaml", "-q", "-o", "run.npz", "--checkpoint", "ck")[2] == 0
    assert names(here) == ["ck", "m.yaml", "run.npz", "stops.yaml"]


# A checkpoint names its version.


def test_a_checkpoint_of_a_different_version_is_refused_with_both(here):
    model = lagcli.load("m.yaml")
    lagcli.simulate(model, duration=1, checkpoint="ck")
    whole = json.loads(Path("ck").read_text())
    assert whole["version"] == lagcli.__version__
    Path("ck").write_text(json.dumps({**whole, "version": "0.0.7"}))
    with pytest.raises(
        ValueError, match=r"written by lagcli 0\.0\.7, and this is lagcli .*pip install"
    ) as caught:
        lagcli.simulate(model, duration=2, resume="ck")
    assert lagcli.__version__ in str(caught.value)
    Path("ck").write_text(json.dumps({**whole, "version": "\x1b[2J" * 50}))
    with pytest.raises(ValueError, match="written by lagcli") as caught:
        lagcli.simulate(model, duration=2, resume="ck")
    assert "\x1b" not in str(caught.value)
    del whole["version"]
    Path("ck").write_text(json.dumps({**whole, "lagcli-checkpoint": 3}))
    with pytest.raises(ValueError, match=r"of a different version, of format 3, and this is lagcli"):
        lagcli.simulate(model, duration=2, resume="ck")


# A run that stops.


@every_format
def test_a_stopped_run_leaves_the_file_and_keeps_its_rows_in_partial(command, here, ending):
    file = Path(f"run.{ending}")
    file.write_text("old")
    out, err, code = command("simulate", "stops.yaml", "-o", str(file), "--stats", "s.json")
    assert (out, code) == ("", 3)
    assert f"the complete rows are in {file}.partial" in err
    assert file.read_text() == "old"
    stats = json.loads(Path("s.json").read_text())
    columns, rows = read(f"{file}.partial", ending)
    assert stats["rows"] == len(rows) == 23
    assert stats["t_end"] == rows[-1, columns.index("t")] == 1.1
    assert stats["stopped"]["code"] == "step-too-small"
    assert stats["stopped"]["t"] == pytest.approx(np.pi / np.sqrt(8), rel=1e-6)
    assert stats["stopped"]["reason"] in err
    assert stats["ended_by"] is None


def test_json_and_python_say_that_a_run_has_stopped(command, here):
    out, _, code = command("simulate", "stops.yaml", "-q", "--json", "-o", "run.csv")
    assert code == 3
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(lagcli.load("stops.yaml"))
    stats = caught.value.stats.as_json()
    for key in ("stopped", "ended_by", "rows", "t_end", "provenance"):
        assert json.loads(out)[key] == stats[key]
    assert caught.value.trajectory.stats.stopped.reason == str(caught.value)
    assert caught.value.code == "step-too-small"


def test_a_finished_run_says_so(command, here):
    out, _, code = command("simulate", "m.yaml", "-q", "--json", "-o", "run.csv")
    stats = json.loads(out)
    assert code == 0
    assert (stats["stopped"], stats["ended_by"], stats["rows"], stats["t_end"]) == (None, None, 201, 2.0)
    assert command("simulate", "stops.yaml", "-q")[2] == 3  # rows on stdout have left


# Provenance.


def provenance(path):
    match path.suffix:
        case ".json":
            return json.loads(path.read_text())["provenance"]
        case ".npz":
            with zipfile.ZipFile(path) as archive:
                return json.loads(archive.comment)
        case _:
            return json.loads(pyarrow.parquet.read_schema(path).metadata[b"provenance"])


@pytest.mark.parametrize("ending", FORMATS[1:])
def test_tables_say_where_they_come_from(command, here, ending):
    file = Path(f"run.{ending}")
    line = ["simulate", "m.yaml", "-q", "--set", "m=2", "--set", "a.vz=-3/2", "--rtol", "1e-9", "-o"]
    assert command(*line, str(file), "--stats", "s.json")[2] == 0
    found = provenance(file)
    assert found == json.loads(Path("s.json").read_text())["provenance"]
    assert found["version"] == lagcli.__version__
    assert found["sha256"] == hashlib.sha256(Path("m.yaml").read_bytes()).hexdigest()
    assert found["parameters"] == {"m": 2.0, "L": 1.0, "g": 9.81, "k": [1.0, 2.0, 3.0]}
    assert found["set"] == {"m": "2", "a.vz": "-3/2"}
    assert (found["method"], found["rtol"]) == ("dop853", 1e-9)
    assert found["atol"] is None  # it follows the sizes of the motion
    assert command(*line, f"again.{ending}")[2] == 0
    assert Path(f"again.{ending}").read_bytes() == file.read_bytes()
    columns, rows = table_format.read(file)
    assert columns == lagcli.simulate(lagcli.load("m.yaml"), duration=0).columns
    assert rows.shape == (201, len(columns))
    if ending == "npz":
        with np.load(file) as arrays:
            assert list(arrays) == list(columns)
            assert json.loads(arrays.zip.comment) == found


def test_the_hash_is_that_of_the_bytes_of_the_file(here):
    data = PENDULUM.replace("\n", "\r\n").encode()
    Path("crlf.yaml").write_bytes(data)
    run = lagcli.simulate(lagcli.load("crlf.yaml"), duration=0)
    assert run.stats.provenance.sha256 == hashlib.sha256(data).hexdigest()
    text = lagcli.simulate(lagcli.loads(PENDULUM, parameters={"m": 3}), duration=0)
    assert text.stats.provenance.sha256 == hashlib.sha256(PENDULUM.encode()).hexdigest()
    assert text.stats.provenance.set == {"m": "3"}


def test_more_parameters_than_an_archive_has_room_for_are_left_out(tmp_path):
    whence = {"version": "1", "parameters": {f"p{i}": 0.1 for i in range(10_000)}}
    with sinks.open_sink(tmp_path / "run.npz", ("t",), provenance=whence):
        pass
    assert provenance(tmp_path / "run.npz") == {"version": "1", "parameters": None}
    assert table_format.read(tmp_path / "run.npz")[0] == ("t",)


# Signals.


@posix
@every_format
@pytest.mark.parametrize("more", [[], [signal.SIGTERM], [signal.SIGHUP, signal.SIGINT]])
def test_signals_while_the_rows_are_being_written_lose_none(command, here, ending, more, monkeypatch):
    """The first one in mid-run, others at every moment until the rows are in FILE.partial."""
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    monkeypatch.setattr(loop, "BLOCK_VALUES", 200)
    taken = []
    take, keep = run_tables.RunTables.take, run_tables.RunTables.keep
    rename = os.replace

    def raising(*arguments):
        take(*arguments)
        taken.append(len(arguments[1]))
        if len(taken) == 6:
            interrupts._handle(signal.SIGINT, None)

    def more_of_them(*arguments):
        for number in more:
            interrupts._handle(number, None)
        found = keep(*arguments)
        for number in more:
            interrupts._handle(number, None)
        return found

    def moved(*arguments):
        for number in more:
            interrupts._handle(number, None)
        rename(*arguments)

    monkeypatch.setattr(run_tables.RunTables, "take", raising)
    monkeypatch.setattr(run_tables.RunTables, "keep", more_of_them)
    monkeypatch.setattr(os, "replace", moved)
    _, err, code = command("simulate", "m.yaml", "-q", "-o", f"run.{ending}")
    assert code == 130
    assert "interrupted; the complete rows are in" in err
    assert len(read(f"run.{ending}.partial", ending)[1]) == sum(taken)
    assert names(here) == ["m.yaml", f"run.{ending}.partial", "stops.yaml"]


@posix
def test_a_signal_at_the_last_row_completes_the_file(command, here, monkeypatch):
    blocks = simulation_run.SimulationRun.blocks

    def last(self):
        yield from blocks(self)
        interrupts._handle(signal.SIGTERM, None)

    monkeypatch.setattr(simulation_run.SimulationRun, "blocks", last)
    _, err, code = command("simulate", "m.yaml", "-q", "-o", "run.csv", "--checkpoint", "ck")
    assert code == 143
    assert err == "lagcli: interrupted; run.csv is complete\n"
    assert len(read("run.csv")[1]) == 201
    assert names(here) == ["ck", "m.yaml", "run.csv", "stops.yaml"]


@posix
def test_a_signal_after_everything_was_written_says_so_or_changes_nothing(here):
    script = (
        "import os, signal, sys, time\n"
        "from lagcli import __main__ as entry\n"
        "from lagcli.cli.commands import simulate_command\nfrom lagcli.output.files import interrupts\n"
        "when = sys.argv.pop(1)\n"
        "def then(number):\n"
        "    os.kill(os.getpid(), number)\n"
        "    time.sleep(1)\n"  # whichever thread is given it, the main one hears of it by then
        "if when == 'told':\n"
        "    tell = simulate_command._print_account\n"
        "    simulate_command._print_account = lambda *a: (tell(*a), then(signal.SIGTERM))\n"
        "else:\n"
        "    release = interrupts.release\n"
        "    interrupts.release = lambda: (release(), then(signal.SIGTERM))\n"
        "entry.main()\n"
    )
    for when, code, said in (("told", 143, True), ("released", 0, False)):
        done = subprocess.run(
            [sys.executable, "-c", script, when, "simulate", "m.yaml", "-o", "run.csv"],
            capture_output=True, text=True, timeout=60, check=False,
            env=os.environ | {"PYTHONPATH": str(Path(lagcli.__file__).parent.parent)},
        )  # fmt: skip
        assert done.returncode == code, done.stderr
        assert ("lagcli: interrupted; run.csv is complete" in done.stderr) is said


@posix
def test_waiting_is_reported_once_and_a_pipe_is_given_up(monkeypatch, capfd):
    monkeypatch.setattr(interrupts, "_raised", [])
    monkeypatch.setattr(interrupts, "_printed", [])
    monkeypatch.setattr(sys, "stderr", sys.__stderr__)

    def file():
        with interrupts.unwinding(), interrupts.shielded():
            for _ in range(4):
                interrupts._handle(signal.SIGINT, None)

    with pytest.raises(interrupts.Interrupted):
        file()
    assert capfd.readouterr().err.count(interrupts.WAIT) == 1


# Smaller.


@posix
def test_a_home_that_cannot_be_written_is_no_reason_for_noise(here):
    home = here / "home"
    home.write_text("no folder, for root too")
    done = subprocess.run(
        [sys.executable, "-m", "lagcli", "simulate", "m.yaml", "-q", "--plot", "run.png"],
        capture_output=True, text=True, timeout=120, check=False,
        env={k: v for k, v in os.environ.items() if not k.startswith(("XDG_", "MPL"))}
        | {"PYTHONPATH": str(Path(lagcli.__file__).parent.parent), "HOME": str(home)},
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert Path("run.png").stat().st_size > 1000


def test_a_comparison_that_would_never_end_stops_as_a_run_does(here, monkeypatch):
    monkeypatch.setattr(controller.StepLengthParameters, "pace", 20)
    found = lagcli.compare(lagcli.load("m.yaml"), duration=1e12, rtol=1e-6)
    reduced = next(one for one in found.formulations if one.name == "reduced")
    assert "the run is too long" in reduced.stopped
    assert found.stopped


GIVEN_UP = """
import functools, lagcli
from lagcli.api import run_settings
from lagcli.api import prepare_run

@functools.cache
def begun():
    model = lagcli.load({path!r})
    run = prepare_run.start(model, run_settings.chosen(model, {{"duration": 1e5, "samples": 1000001}}))
    blocks = run.blocks()
    next(blocks)
    return run, blocks

begun()
"""


def test_a_run_that_is_given_up_where_python_ends_is_quiet() -> None:
    root = Path(lagcli.__file__).parent.parent
    code = GIVEN_UP.format(path=str(root / "models" / "pendulum.yaml"))
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
