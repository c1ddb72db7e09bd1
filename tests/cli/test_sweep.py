"""`lagcli sweep`: points, rows, engines, files that outlive any end."""

import csv
import dataclasses
import io
import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import time
import types
from typing import NamedTuple

import numpy as np
import pytest

import lagcli
from lagcli import memory, progress
from lagcli.analysis.numeric_flag import spans
from lagcli.api import reductions, sweep_points
from lagcli.output.sweeps import sweep_journal, sweep_table, written_sweep
from lagcli.output.sweeps.sweep_table import PointRow
from lagcli.output.tables import table_format
from lagcli.pfaffian.exact import time_limit
from lagcli.start import projection
from tests.helpers import in_process

ROOT = pathlib.Path(__file__).parents[2]
PENDULUM = str(ROOT / "models" / "pendulum.yaml")
DISK = str(ROOT / "models" / "rolling-disk.yaml")
SHORT = ("--duration", "0.3", "--samples", "4")
REDUCE = ("--reduce", "peak=max(abs(lambda.rod))", "--reduce", "end=last(a.x)")


class Ended(NamedTuple):
    """How a command ended, and what it has written."""

    returncode: int
    stdout: str
    stderr: str


def run(*arguments: str, text: str | None = None) -> Ended:
    """A command in this process."""
    with pytest.MonkeyPatch.context() as patch:
        if text is not None:
            patch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8"))
        out, err, code = in_process.run(*arguments)
    return Ended(code or 0, out, err)


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_a_row_is_that_of_simulate_with_set_to_the_last_bit() -> None:
    done = run("sweep", DISK, "--over", "M=1:2:2", "--over", "a=[0.4, 1/2]", *SHORT)
    assert done.returncode == 0
    rows = table(done.stdout)
    assert [(row["point"], row["M"], row["a"]) for row in rows] == [
        ("0", "1.0", "0.4"), ("1", "1.0", "0.5"), ("2", "2.0", "0.4"), ("3", "2.0", "0.5"),
    ]  # fmt: skip
    for row in rows[::3]:
        alone = run("simulate", DISK, "--set", f"M={row['M']}", "--set", f"a={row['a']}", *SHORT)
        last = table(alone.stdout)[-1]
        assert {name: row[name] for name in last if name != "t"} == {
            name: value for name, value in last.items() if name != "t"
        }
        assert row["t_end"] == last["t"]
        assert "t" not in row  # it is `t_end`
        assert (row["status"], row["message"]) == ("0", "")


def test_processes_give_the_file_of_one_process(tmp_path: pathlib.Path) -> None:
    here, there = tmp_path / "one.csv", tmp_path / "two.csv"
    common = ("sweep", PENDULUM, "--over", "L=0.5:2:9", "--over", "theta0=[0.1, 1]", *SHORT)
    assert run(*common, "-o", str(here)).returncode == 0
    assert run(*common, "-o", str(there), "--jobs", "2").returncode == 0
    assert there.read_bytes() == here.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.csv", "two.csv"]


def test_invalid_and_stopped_points_are_rows_and_the_worst_counts(tmp_path: pathlib.Path) -> None:
    model = tmp_path / "fall.yaml"
    # The inverse of a distance ends at its pole where the particle is let go from rest.
    model.write_text(
        "lagcli: 1\nparameters: {k: 1, u: 0}\n"
        "particles:\n  a: {mass: 1, position: [1, 0, 0], velocity: [0, u, 0]}\n"
        "forces:\n  pull: {potential: -k/norm(a)}\n"
    )
    common = ("sweep", str(model), "--duration", "2", "--samples", "3", "--reduce", "r=last(a.x)", "-q")
    stopped = run(*common, "--over", "u=[1, 0, 0.9]")
    assert stopped.returncode == 3
    rows = table(stopped.stdout)
    assert [row["status"] for row in rows] == ["0", "3", "0"]
    assert rows[1]["r"] == "nan"
    assert rows[1]["message"].startswith("stopped at t = 1.11")
    assert float(rows[1]["t_end"]) == 1.0
    both = run(*common, "--over", "u=[1, 0, log(k-1), 0.9]")
    assert both.returncode == 2  # no number of the command line
    invalid = run(*common, "--over", "a.x=[0, 1]", "--over", "u=[0, 1]")
    assert invalid.returncode == 1
    assert [row["status"] for row in table(invalid.stdout)] == ["1", "1", "3", "0"]
    assert "not-finite" in table(invalid.stdout)[0]["message"]


def test_a_point_whose_names_another_value_has_taken_away_is_invalid(tmp_path: pathlib.Path) -> None:
    model = tmp_path / "row.yaml"
    model.write_text(
        "lagcli: 1\nparameters: {N: 3}\n"
        'particles:\n  p[i]: {for: "i = 1..N", mass: 1, position: [i, 0, 0]}\n'
        "simulation: {duration: 1, samples: 2}\n"
    )
    done = run(
        "sweep", str(model), "--over", "N=[1, 2]", "--over", "p[2].vx=[5]", "--reduce", "x=last(p[2].x)"
    )
    assert done.returncode == 1
    rows = table(done.stdout)
    assert [row["status"] for row in rows] == ["1", "0"]
    assert rows[0]["x"] == "nan"
    assert float(rows[1]["x"]) == pytest.approx(7)
    assert "there is no member `p[2]`" in rows[0]["message"]


def test_a_point_that_takes_too_long_is_ended_and_is_a_row() -> None:
    common = ("sweep", PENDULUM, "--over", "g=[9.81, 1]", "--reduce", "x=last(a.x)", *SHORT)
    done = run(*common, "--limit-each", "0")  # which everything takes longer than
    assert done.returncode == 3
    rows = table(done.stdout)
    assert [(row["status"], row["x"]) for row in rows] == [("3", "nan")] * 2
    assert "longer than 0 s" in rows[1]["message"]
    assert "2 points: 0 done, 2 stopped, 0 invalid" in done.stderr
    assert run(*common, "--limit-each", "1e6").returncode == 0


CLOSED = """
lagcli: 1
parameters: {L: 1.1, D: 2}
particles:
  a: {mass: 1, position: [0.3, 0, -0.8]}
  b: {mass: 2, position: [1.6, 0, -0.8]}
holonomic:
  l1: L = distance(a, [0, 0, 0])
  l2: L = distance(a, b)
  l3: L = distance(b, [D, 0, 0])
  pa: a.y = 0
  pb: b.y = 0
simulation: {duration: 0.1, samples: 2, assemble: true}
"""
AXLE = (ROOT / "models" / "two-wheel-axle.yaml").read_text(encoding="utf-8")
# Where the time is spent, and the name that another value makes it spent for.
LONG = {
    "assembly": (CLOSED, "L", lambda: (projection.Surface, "descend")),
    "algebra": (AXLE, "theta.value", lambda: (time_limit, "_limited")),
    "numbers": (AXLE, "theta.value", lambda: (spans, "require_time")),
}


@pytest.mark.parametrize("where", LONG)
def test_a_point_is_ended_before_its_run_too(
    where: str, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its clock stands still but where time is spent there, and goes on by an hour."""
    text, name, place = LONG[where]
    model = tmp_path / "model.yaml"
    model.write_text(text, encoding="utf-8")
    options = ("--duration", "0.1", "--samples", "2", "--reduce", "x=last(t)", "--limit-each", "3600")
    common = ("sweep", str(model), "--over", f"{name}=1.2", *options)
    owner, attribute = place()
    work, clock = getattr(owner, attribute), [0.0]

    def slow(*arguments: object, **named: object) -> object:
        clock[0] += 3600.0
        return work(*arguments, **named)

    monkeypatch.setattr(progress, "time", types.SimpleNamespace(process_time=lambda: clock[0]))
    memory.forget()
    whole = run(*common)
    assert whole.returncode == 0
    monkeypatch.setattr(owner, attribute, slow)
    memory.forget()
    ended = run(*common)
    assert ended.returncode == 3
    told = "it takes longer than 3600 s and was ended before its first row"
    assert [row["message"] for row in table(ended.stdout)] == [told]
    monkeypatch.setattr(owner, attribute, work)
    assert run(*common).stdout == whole.stdout  # nothing was kept of what was ended


def test_reductions_are_expressions_over_columns() -> None:
    t = np.array([0.0, 1.0, 3.0])
    rows = {"lambda.rod[2]": np.array([1.0, -4.0, 2.0]), "R.a.x": np.array([2.0, 2.0, 5.0]), "t": t}
    rows["rate(theta)"] = np.array([0.0, 1.0, 2.0])

    def of(text: str) -> float:
        return reductions.value(reductions.Reduction("x", text), rows, t, {"m": 2.0, "u": (1.0, 2.0, 3.0)})

    assert of("max(abs(lambda.rod[2]))") == 4.0
    assert of("min(lambda.rod[2]) + u.z") == -1.0
    assert of("mean(max(lambda.rod[2], 0.5))") == pytest.approx((1 + 0.5 + 2) / 3)
    assert of("rms(R.a.x)") == pytest.approx(np.sqrt(11))
    assert of("integral(rate(theta))*m") == pytest.approx(2 * (0.5 + 3.0))
    assert (of("first(R.a.x)"), of("last(R.a.x)")) == (2.0, 5.0)
    assert (of("argmax(lambda.rod[2])"), of("argmin(lambda.rod[2])")) == (3.0, 1.0)
    assert of("last(R.a.x)/last(t)**2") == pytest.approx(5 / 9)
    assert of("integral(1)") == 3.0


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--over", "LL=1:2:3"), "--over LL: there is no parameter or initial value of that name; did you mean `L`?"),
        (("--over", "L=1:2"), "a range is LOW:HIGH:COUNT"),
        (("--over", "L=1:2:1.5"), "whole number"),
        (("--over", "L=1:2:1"), "two ends"),
        (("--over", "L=1:q:2"), "--over L:1:1: error[unknown-name]"),
        (("--over", "L=1:2:2", "--over", "L=1:2:3"), "`L` is given twice"),
        (("--over", "L=1:2:2", "--set", "L=3"), "--set has a value for it too"),
        (("--over", "L=1:2:100000", "--over", "g=1:2:10000"), "1000000000 points: --yes"),
        (("--over", "L=1:2:2", "--reduce", "max(t)"), "write NAME=EXPR"),
        (("--over", "L=1:2:2", "--reduce", "p=max(lambda.rodd)"), "did you mean `lambda.rod`?"),
        (("--over", "L=1:2:2", "--reduce", "p=lambda.rod"), "--reduce p:1:1: error[not-a-scalar]"),
        (("--over", "L=1:2:2", "--reduce", "status=max(t)"), "two columns would be called `status`"),
        (("--over", "L=1:2:2", "--shard", "3/2"), "--shard 3/2"),
        (("--over", "L=1:2:2", "--samples", "0"), "samples"),
        (("--over", "L=1:2:2", "--resume"), "-o FILE"),
        (("--over", "L=1:2:2", "--limit-each", "nan"), "limit_each: a number of seconds"),
        (("--over", "L=1:2:2", "-o", "x.txt"), "unknown format"),
        (("--uncertain", "L~gauss(1, 2)"), "the distributions are normal(MEAN, SD)"),
        (("--uncertain", "L~normal(1)"), "write normal(MEAN, SD)"),
        (("--uncertain", "L~normal(1, 0)"), "positive"),
        ((), "no points"),
        (("--points", "nowhere.csv"), "there is no file nowhere.csv"),
        (("--points", os.curdir), "--points: . is a folder, and a table of points is needed"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_with_its_location(
    options: tuple[str, ...], told: str, tmp_path: pathlib.Path
) -> None:
    done = run("sweep", PENDULUM, *options)
    assert done.returncode == 2
    assert told in done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("L,q\n1,2\n", "--points <stdin>: q: there is no parameter"),
        ("L,m\n1,x\n", "row 1: 'x' in the column 'm' is no number"),
        ("L,m\n1,\n", "row 1: the column `m` has no finite number"),
        ("L,m\n", "there are no points"),
    ],
)
def test_tables_of_points_come_through_standard_input(text: str, told: str) -> None:
    done = run("sweep", PENDULUM, "--points", "-", *SHORT, *REDUCE, text="L,m\n1,2\n2,3\n")
    assert [(row["L"], row["m"]) for row in table(done.stdout)] == [("1.0", "2.0"), ("2.0", "3.0")]
    refused = run("sweep", PENDULUM, "--points", "-", *SHORT, text=text)
    assert refused.returncode == 2
    assert told in refused.stderr


def killed(arguments: list[str], journal: pathlib.Path, rows: int) -> bool:
    """Run a sweep and kill it when its journal has so many more lines; False where it came to its end."""
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    there = journal.read_bytes().count(b"\n") if journal.exists() else 0
    while process.poll() is None:
        if journal.exists() and journal.read_bytes().count(b"\n") >= there + rows:
            process.send_signal(signal.SIGKILL)
            process.wait()
            return True
        time.sleep(0.01)
    return False


@pytest.mark.skipif(os.name != "posix", reason="there is no such signal")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_sweep_that_is_killed_goes_on_to_the_file_of_one_that_was_not(
    tmp_path: pathlib.Path, jobs: str
) -> None:
    whole, broken = tmp_path / "whole.csv", tmp_path / "broken.csv"
    common = ["sweep", PENDULUM, "--over", "L=0.5:2:100", *REDUCE, "--duration", "2", "--jobs", jobs]
    assert run(*common[:-1], "1", "-o", str(whole)).returncode == 0
    journal = sweep_journal.path_of(broken)
    choice = random.Random(int(jobs))
    kills = 0
    arguments = [sys.executable, "-m", "lagcli", *common, "-o", str(broken), "--resume"]
    while kills < 2 and killed(arguments, journal, choice.randint(1, 9)):
        kills += 1
        assert not broken.exists()
        with journal.open("ab") as file:  # as a kill within a line would leave it
            file.write(b"0123abcd [3,")
    assert kills  # on a machine that is very fast the second may come too late
    last = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert last.returncode == 0
    assert broken.read_bytes() == whole.read_bytes()
    assert journal.read_bytes().count(b"\n") == 2  # of which sweep the table is, and no row


@pytest.mark.skipif(os.name != "posix", reason="there is no such signal")
def test_an_interrupt_keeps_the_rows_and_names_them(tmp_path: pathlib.Path) -> None:
    target = tmp_path / "rows.csv"
    command = [
        sys.executable,
        "-m",
        "lagcli",
        "sweep",
        PENDULUM,
        "--over",
        "L=0.5:2:4000",
        *REDUCE,
        "-o",
        str(target),
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    journal = sweep_journal.path_of(target)
    while not (journal.exists() and journal.read_bytes().count(b"\n") > 3):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"{target}.partial" in told
    assert "--resume goes on" in told
    rows = table((tmp_path / "rows.csv.partial").read_text())
    assert [row["point"] for row in rows] == [str(i) for i in range(len(rows))]
    assert not target.exists()


def test_rows_of_a_different_sweep_are_not_gone_on_with(tmp_path: pathlib.Path) -> None:
    target = tmp_path / "rows.csv"
    journal = sweep_journal.SweepJournal(
        sweep_journal.path_of(target), {"version": lagcli.__version__, "sha256": "0"}, False
    )
    journal.close()
    done = run("sweep", PENDULUM, "--over", "L=1:2:2", *SHORT, "-o", str(target), "--resume")
    assert done.returncode == 2
    assert "holds rows of a different sweep: the text of the model differs" in done.stderr
    sweep_journal.path_of(target).write_text("my notes\n")
    done = run("sweep", PENDULUM, "--over", "L=1:2:2", *SHORT, "-o", str(target))
    assert done.returncode == 2
    assert "holds no rows of a sweep" in done.stderr
    assert sweep_journal.path_of(target).read_text() == "my notes\n"


def test_rows_of_an_unfinished_sweep_are_not_overwritten(tmp_path: pathlib.Path) -> None:
    target = tmp_path / "rows.csv"
    common = ("sweep", PENDULUM, "--over", "L=1:2:2", *SHORT, "-o", str(target))
    path = sweep_journal.path_of(target)
    sweep_journal.SweepJournal(path, {"version": "1"}, False).close()  # killed before its first row
    journal = sweep_journal.SweepJournal(path, {"version": "2"}, False)
    journal.write([PointRow(0, (1.0,), (2.0,), 0, "", 3.0)])
    journal.close()
    before = path.read_bytes()
    refused = run(*common)
    assert refused.returncode == 2
    assert (
        f"{path} holds the rows of a sweep that has not come to its end: --resume goes on" in refused.stderr
    )
    assert path.read_bytes() == before
    path.unlink()
    assert run(*common).returncode == 0


@pytest.mark.parametrize(
    ("name", "shard"),
    [
        ("rows.csv", ("--shard", "2/3")),
        ("rows/", ("--shard", "2/3")),
        ("rows.json", ()),
        ("rows.npz", ()),
        ("rows.csv", ()),
    ],
)
def test_what_is_finished_is_not_run_again(name: str, shard: tuple[str, ...], tmp_path: pathlib.Path) -> None:
    asked = f"{tmp_path}/{name}"
    common = ("sweep", PENDULUM, "--over", "L=[1, -1, 2, -2, 3]", *SHORT, *shard, "-o", asked, "--resume")
    first = run(*common, *REDUCE)
    (path,) = (path for path in tmp_path.rglob("*") if path.is_file() and path.suffix != ".points")
    before = path.stat()
    again = run(*common, *REDUCE)
    after = path.stat()
    assert (after.st_mtime_ns, after.st_ino) == (before.st_mtime_ns, before.st_ino)
    assert f"{path} holds all rows of this sweep already" in again.stderr
    assert "already" not in first.stderr
    assert again.returncode == first.returncode == 1
    assert again.stderr.split("\n")[-3] == first.stderr.split("\n")[-3]  # how many points ended how
    other = run(*common, *REDUCE[:2])
    assert "already" not in other.stderr
    assert path.stat().st_mtime_ns > before.st_mtime_ns


@pytest.mark.parametrize("name", ["rows.csv", "rows.tsv"])
def test_a_table_that_does_not_say_of_which_sweep_it_is_is_neither_trusted_nor_replaced(
    name: str, tmp_path: pathlib.Path
) -> None:
    path = tmp_path / name
    common = ("sweep", PENDULUM, "--over", "L=[1, 2]", *SHORT, *REDUCE, "-o", str(path))
    assert run(*common).returncode == 0
    assert [each.name for each in tmp_path.iterdir()] == [name]
    before = path.read_bytes()
    unknown = run(*common, "--resume")
    assert unknown.returncode == 2
    assert f"--resume: {path} holds a row of every point, and nothing says" in unknown.stderr
    path.unlink()
    assert run(*common, "--resume").returncode == 0
    assert path.read_bytes() == before
    settled = run(*common, "--resume", "--rtol", "1e-8")  # of other settings, in the same columns
    assert settled.returncode == 2
    assert "already" in run(*common, "--resume").stderr
    path.write_bytes(before.replace(b"1.0", b"1.5", 1))  # by somebody's hand: no row of this sweep is lost
    assert run(*common, "--resume").returncode == 2
    path.unlink()
    assert "already" not in run(*common, "--resume").stderr
    assert path.read_bytes() == before
    assert run(*common).returncode == 0  # what a resumed sweep leaves beside its table is in nobody's way


@pytest.mark.skipif(os.name != "posix", reason="there is no such signal")
def test_rows_so_far_are_no_part_of_a_dataset_and_go_when_it_is_complete(tmp_path: pathlib.Path) -> None:
    dataset = pytest.importorskip("pyarrow.dataset")
    folder = tmp_path / "rows"
    command = [sys.executable, "-m", "lagcli", "sweep", PENDULUM, "--over", "L=0.5:2:60", *REDUCE]
    command += ["--duration", "1", "-o", f"{folder}/"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    part = folder / "part-00001-of-00001.parquet"
    journal = sweep_journal.path_of(part)
    while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") > 3):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    assert sorted(path.name for path in folder.iterdir()) == [
        f".{part.name}.partial", f".{part.name}.points",
    ]  # fmt: skip
    assert dataset.dataset(folder).files == []
    done = run(*command[3:], "--resume")
    assert done.returncode == 0
    assert [path.name for path in folder.iterdir()] == [part.name]
    assert dataset.dataset(folder).count_rows() == 60


def test_shards_merge_to_the_file_of_the_whole(tmp_path: pathlib.Path) -> None:
    common = ("sweep", PENDULUM, "--over", "L=0.5:2:7", *REDUCE, *SHORT)
    whole = tmp_path / "whole.csv"
    assert run(*common, "-o", str(whole)).returncode == 0
    parts = [tmp_path / f"part-{i}.{ending}" for i, ending in enumerate(("csv", "json", "csv"), 1)]
    for i, part in enumerate(parts, 1):
        assert run(*common, "--shard", f"{i}/3", "-o", str(part)).returncode == 0
    merged = tmp_path / "merged.csv"
    names = [str(part) for part in parts]
    assert run("sweep", "--merge", *reversed(names), "-o", str(merged)).returncode == 0
    assert merged.read_bytes() == whole.read_bytes()
    missing = run("sweep", "--merge", *names[:2])
    assert missing.returncode == 2
    assert "2 of 7 points are missing: 2, 5" in missing.stderr
    assert "is in another file too" in run("sweep", "--merge", *names, names[0]).stderr
    assert run(*common[:-1], "5", "--shard", "3/3", "-o", names[2]).returncode == 0
    assert "a shard of a different sweep" in run("sweep", "--merge", *names).stderr
    assert "no table of a shard" in run("sweep", "--merge", str(whole)).stderr


SHARDS = ("point,L,x,status,message,t_end,shard_of\n0,1.0,5.0,0,ok,1.0,abc 3\n2,2.0,5.5,0,,1.0,abc 3\n",
          "point,L,x,status,message,t_end,shard_of\n1,1.5,6.0,3,stopped,0.5,abc 3\n")  # fmt: skip


@pytest.mark.parametrize(
    ("which", "old", "new", "told"),
    [
        (1, "1,1.5", "7,1.5", "the point 7 is none of the sweep, which has 3"),
        (1, "1,1.5", "-1,1.5", "the point -1 is none of the sweep, which has 3"),
        (1, "1,1.5", "1.5,1.5", "the column `point` holds a number that is not whole"),
        (1, "1,1.5", "nan,1.5", "the column `point` holds a number that is not whole"),
        (1, "1,1.5", "2,1.5", "the point 2 is in another file too"),
        (1, "3,stopped", "3.5,stopped", "the column `status` holds a number that is not whole"),
        (1, "3,stopped", "bad,stopped", "status"),
        (1, "abc 3", "abd 3", "is a shard of a different sweep than"),
        (1, "abc 3", "abc three", "its rows are not of one sweep"),
        (0, "2,2.0,5.5,0,,1.0,abc 3", "2,2.0,5.5,0,,1.0,abd 3", "its rows are not of one sweep"),
        (1, "L,x", "M,x", "has other columns than"),
        (1, ",shard_of", ",part", "it is no table of a shard: it has no column `shard_of`"),
        (0, "abc 3", "abc 99999999999999999999", "is a shard of a different sweep than"),
        (1, "1,1.5,6.0,3,stopped,0.5,abc 3\n", "", "1 of 3 points are missing: 1; have all shards run"),
    ],
)
def test_tables_that_are_not_the_shards_of_one_sweep_are_refused(
    which: int, old: str, new: str, told: str, tmp_path: pathlib.Path
) -> None:
    paths = [tmp_path / "one.csv", tmp_path / "two.csv"]
    for path, text in zip(paths, SHARDS, strict=True):
        path.write_text(text)
    merged = tmp_path / "merged.csv"
    command = ("sweep", "--merge", *map(str, paths), "-o", str(merged))
    assert run(*command).returncode == 3
    assert [(row["point"], row["x"]) for row in table(merged.read_text())] == [
        ("0", "5.0"),
        ("1", "6.0"),
        ("2", "5.5"),
    ]
    merged.unlink()
    changed = SHARDS[which].replace(old, new)
    assert changed != SHARDS[which]
    paths[which].write_text(changed)
    refused = run(*command)
    assert refused.returncode == 2
    assert told in refused.stderr
    assert not merged.exists()


def test_a_changed_digit_of_a_shard_is_refused(tmp_path: pathlib.Path) -> None:
    """Any digit of any cell, but one that leaves the number what it is."""
    parts = [tmp_path / f"part-{i}.csv" for i in (1, 2)]
    for i, part in enumerate(parts, 1):
        common = ("sweep", PENDULUM, "--over", "L=[1.1, -1, 0.1, 2]", *REDUCE, *SHORT)
        assert run(*common, "--shard", f"{i}/2", "-o", str(part)).returncode in (0, 1)
    names = [str(part) for part in parts]
    expected = written_sweep.merged(names)
    _, _, has_checksums = expected
    assert has_checksums
    text, merged = parts[0].read_text(), []
    digits = [i for i, letter in enumerate(text) if letter.isdigit() and i > text.index("\n")]
    for i in digits:
        parts[0].write_text(text[:i] + str((int(text[i]) + 1) % 10) + text[i + 1 :])
        try:
            merged.append(repr(written_sweep.merged(names)) == repr(expected))
        except (written_sweep.BadShards, *table_format.UNREADABLE):
            continue
    assert len(digits) > 100
    assert all(merged)
    assert len(merged) <= 4  # digits below the rounding of a number
    parts[0].write_text(text.replace("0,", "9,", 1))
    assert run("sweep", "--merge", *names, "-o", f"{tmp_path}/all.csv").returncode == 2
    assert not (tmp_path / "all.csv").exists()


@pytest.mark.parametrize("ending", ["csv", "tsv", "json", "npz", "parquet"])
def test_a_row_that_was_changed_is_named_in_any_format(ending: str, tmp_path: pathlib.Path) -> None:
    planned = sweep_table.PlannedRows({"a": 1}, ("L",), ("p",), 4, 2, 2)
    rows = [
        PointRow(1, (-0.0,), (0.1 + 0.2,), 0, "", 1e-300),
        PointRow(3, (2.0,), (float("nan"),), 3, 'it says "no", and ends', float("nan")),
    ]
    path = tmp_path / f"part.{ending}"

    def written(shown: list[PointRow]) -> list[PointRow]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sweep_table, "checksum", lambda shard, row: sums[row.number])
            table = sweep_table.SweepTable(path, planned.columns, None, planned.shard_of)
            table.write(shown)
            table.sink.commit(planned=len(shown))
        return sweep_table.rows(path, table_format.opened(path), 1)

    sums = {row.number: sweep_table.checksum(planned.shard_of, row) for row in rows}
    assert repr(written(rows)).replace("(-0.0,)", "(0.0,)") == repr(rows).replace("(-0.0,)", "(0.0,)")
    for changed in (
        dataclasses.replace(rows[0], point=(1e-17,)),
        dataclasses.replace(rows[0], results=(0.3,)),
        dataclasses.replace(rows[0], t_end=1.1e-300),
        dataclasses.replace(rows[0], status=1),
        dataclasses.replace(rows[0], message="x"),
    ):
        with pytest.raises(table_format.UnreadableTable, match="the row of the point 1 was changed after"):
            written([changed, rows[1]])


def test_shards_without_checksums_are_merged_with_a_note_and_never_beside_others(
    tmp_path: pathlib.Path,
) -> None:
    paths = [tmp_path / "one.csv", tmp_path / "two.csv"]
    for path, text in zip(paths, SHARDS, strict=True):
        path.write_text(text)
    done = run("sweep", "--merge", *map(str, paths))
    assert done.returncode == 3
    assert "no column `checksum`: a digit that was changed in them is not seen" in done.stderr
    row = PointRow(1, (1.5, 6.0), (), 3, "stopped", 0.5)
    paths[1].write_text(
        SHARDS[1]
        .replace("shard_of\n", "shard_of,checksum\n")
        .replace("abc 3\n", f"abc 3,{sweep_table.checksum('abc 3', row)}\n")
    )
    mixed = run("sweep", "--merge", *map(str, paths))
    assert mixed.returncode == 2
    assert "one of them has a column `checksum`" in mixed.stderr


def test_a_finished_shard_that_was_changed_is_run_again(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "part.csv"
    common = ("sweep", PENDULUM, "--over", "L=[1, 2]", *SHORT, *REDUCE, "--shard", "1/2", "--resume")
    assert run(*common, "-o", str(path)).returncode == 0
    before = path.read_text()
    path.write_text(before.replace("0,1.0,", "0,1.5,", 1))
    assert "already" not in run(*common, "-o", str(path)).stderr
    assert path.read_text() == before


def test_a_sweep_of_which_nearly_all_is_missing_is_reported_at_once(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "one.csv"
    path.write_text(SHARDS[0].replace("abc 3", "abc 99999999999999999999"))
    refused = run("sweep", "--merge", str(path))
    assert (
        "99999999999999999997 of 99999999999999999999 points are missing: 1, 3, 4, 5, 6, ..."
        in refused.stderr
    )


def test_every_format_holds_the_same_numbers(tmp_path: pathlib.Path) -> None:
    common = ("sweep", PENDULUM, "--over", "L=1:2:3", *REDUCE, *SHORT)
    found = []
    for ending in ("csv", "tsv", "json", "npz", "parquet"):
        path = tmp_path / f"rows.{ending}"
        assert run(*common, "-o", str(path)).returncode == 0
        read = table_format.opened(path)
        names = ("point", "L", "peak", "end", "status", "t_end")
        found.append(read.take(names).tobytes())
        assert read.words("message") == ["", "", ""]
    assert len(set(found)) == 1
    assert json.loads((tmp_path / "rows.json").read_text())["provenance"]["count"] == 3


def test_a_folder_is_a_dataset_with_a_part_for_each_shard(tmp_path: pathlib.Path) -> None:
    dataset = pytest.importorskip("pyarrow.dataset")
    folder = tmp_path / "rows"
    for i in (1, 2):
        common = ("sweep", PENDULUM, "--over", "L=1:2:5", *REDUCE, *SHORT, "--shard", f"{i}/2")
        assert run(*common, "-o", f"{folder}/").returncode == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        "part-00001-of-00002.parquet", "part-00002-of-00002.parquet",
    ]  # fmt: skip
    rows = dataset.dataset(folder).to_table().sort_by("point")
    assert rows["L"].to_pylist() == [1.0, 1.25, 1.5, 1.75, 2.0]


def test_full_tables_are_those_of_simulate(tmp_path: pathlib.Path) -> None:
    tables = tmp_path / "tables"
    done = run(
        "sweep", PENDULUM, "--over", "L=[1, 2]", *REDUCE, *SHORT, "--tables", f"{tables}/", "--jobs", "2"
    )
    assert done.returncode == 0
    alone = tmp_path / "alone.csv"
    assert run("simulate", PENDULUM, "--set", "L=2.0", *SHORT, "-o", str(alone)).returncode == 0
    assert (tables / "point-0000001.csv").read_bytes() == alone.read_bytes()
    assert len(list(tables.iterdir())) == 2


def test_draws_are_those_of_the_seed_and_their_quantiles_are_reported(tmp_path: pathlib.Path) -> None:
    common = ("sweep", PENDULUM, "--uncertain", "m~normal(2, 0.1)", "--uncertain", "g~uniform(9, 10)",
              "--draws", "128", "--reduce", "twice=2*first(energy)/first(energy)*m", "--duration", "0",
              "--json", "-o")  # fmt: skip
    one = tmp_path / "one.csv"
    first = run(*common, str(one))
    assert first.returncode == 0
    laws = [sweep_points.read_law(lagcli.load(PENDULUM), text) for text in (common[3], common[5])]
    assert table_format.opened(one).take(("m", "g")).tolist() == [
        list(sweep_points.draw(laws, 128, 0).point(i)) for i in range(128)
    ]
    account = json.loads(first.stdout)
    # Of twice a normal variable: quasi-random draws meet quantiles to a part of a hundred of the deviation.
    assert account["results"]["twice"]["quantiles"]["0.5"] == pytest.approx(4.0, abs=0.002)
    assert account["results"]["twice"]["quantiles"]["0.95"] == pytest.approx(4 + 1.6448536 * 0.2, abs=0.01)
    assert account["results"]["twice"]["sd"] == pytest.approx(0.2, rel=0.01)
    assert "twice: mean 4" in first.stderr
    rows = table(one.read_text())
    assert len({row["g"] for row in rows}) == 128
    assert all(9 < float(row["g"]) < 10 for row in rows)


def test_python_gives_a_frame_and_takes_any_executor() -> None:
    pandas = pytest.importorskip("pandas")
    from concurrent.futures import ThreadPoolExecutor

    options = {"reduce": {"peak": "max(lambda.rod)"}, "duration": 0.3, "samples": 4}
    grid = {"L": "0.5:2:3", "m": [1, 2]}
    alone = lagcli.sweep(PENDULUM, grid, **options)
    assert list(alone.columns) == ["point", "L", "m", "peak", "status", "message", "t_end"]
    with ThreadPoolExecutor(2) as executor:
        pandas.testing.assert_frame_equal(lagcli.sweep(PENDULUM, grid, executor=executor, **options), alone)
    again = lagcli.sweep(lagcli.load(PENDULUM), alone[["L", "m"]], **options)
    pandas.testing.assert_frame_equal(again, alone)
    for row in alone.itertuples():
        one = lagcli.simulate(lagcli.load(PENDULUM, {"L": row.L, "m": row.m}), duration=0.3, samples=4)
        assert one["lambda.rod"].max() == row.peak
    assert alone.attrs["done"] == 6
    for wrong, told in (
        ({"points": []}, "there are none"),
        ({"points": {}}, "there are none"),
        ({"points": grid, "jobs": 0}, "jobs: a whole number"),
        ({"points": grid, "limit_each": -1}, "limit_each: a number of seconds"),
        ({"uncertain": {"L": "normal(1, 0.1)"}, "draws": 1.5}, "--draws: a whole number"),
    ):
        with pytest.raises(ValueError, match=told):
            lagcli.sweep(PENDULUM, **wrong, **options)
    with pytest.raises(ValueError, match="points LL: there is no parameter"):
        lagcli.sweep(PENDULUM, {"LL": [1]})
