"""The command line as a contract: what is typed, what comes out where, and with which exit code.

Most commands run in this process, with streams of their own; signals, pipes and terminals need a process.
"""

import array
import csv
import dataclasses
import errno
import fcntl
import io
import json
import os
import pty
import re
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow.parquet
import pytest

import lagcli as package
from lagcli import __main__ as entry
from lagcli.api import cache, prepare_run
from lagcli.cli.terminal import console, exits
from lagcli.errors import catalogue, diagnostics
from lagcli.output.figures import figure_page
from lagcli.output.files import formats, interrupts
from lagcli.output.tables import sinks, table_format
from tests.helpers import pendulum

PENDULUM = pendulum.PENDULUM + "simulation: {duration: 0.5, samples: 6}\n"
ANGLE = """\
lagcli: 1
parameters: {m: 1, L: 1, g: 9.81}
coordinates:
  theta: {value: 0.5, rate: 0}
lagrangian: m*L**2*rate(theta)**2/2 + m*g*L*cos(theta)
outputs: {height: -L*cos(theta)}
simulation: {duration: 0.5, samples: 6}
"""
DISK = """\
lagcli: 1
coordinates:
  x: {}
  y: {}
  theta: {}
  phi: {rate: 1}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(theta)**2 + rate(phi)**2)/2
differential:
  roll_x: d(x) - cos(theta)*d(phi) = 0
  roll_y: d(y) - sin(theta)*d(phi) = 0
"""
COLLINEAR = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
  b: {mass: 1, position: [1, 0, 0]}
  c: {mass: 1, position: [2, 0, 0]}
holonomic:
  ab: distance(a, b) = 1
  bc: distance(b, c) = 1
  ac: distance(a, c) = 2
"""
CUBED = """\
lagcli: 1
coordinates: {x: {}, y: {}}
lagrangian: (rate(x)**2 + rate(y)**2)/2
holonomic: {p: x**3 = 0}
"""
KNIFE = """\
lagcli: 1
coordinates:
  x: {rate: 1}
  y: {}
  theta: {rate: 1}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(theta)**2)/2
differential:
  edge: sin(theta)*d(x) - cos(theta)*d(y) = 0
"""
SPOKE = """\
lagcli: 1
coordinates:
  x: {value: 1}
  y: {value: 1}
lagrangian: (rate(x)**2 + rate(y)**2)/2
differential:
  spoke: x*d(y) - y*d(x) = 0
"""
COLLAPSE = """\
lagcli: 1
coordinates: {x: {value: 1}}
lagrangian: rate(x)**2/2 + 1/x
simulation: {duration: 2, samples: 41}
"""
LONG = PENDULUM.replace("{duration: 0.5, samples: 6}", "{duration: 1.8e5, samples: 9000001}")
WARNED = PENDULUM.replace("velocity: [0, 0, -1]", "velocity: [1, 0, -1]")
BROKEN = PENDULUM.replace("norm(a)", "norm(b)").replace("velocity", "velocty")


@dataclasses.dataclass(frozen=True)
class Result:
    code: int
    out: str
    err: str

    @property
    def json(self) -> object:
        return json.loads(self.out)


Lagcli = Callable[..., Result]


@pytest.fixture
def lagcli(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Lagcli:
    """Runs a command line in this process, in an empty folder. Signal handlers stay pytest's."""
    folder = tmp_path / "streams"
    folder.mkdir()
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr(interrupts, "install", lambda: None)

    def call(*arguments: str | os.PathLike[str], stdin: str = "") -> Result:
        with monkeypatch.context() as patch:
            patch.setattr(sys, "argv", ["lagcli", *map(os.fspath, arguments)])
            patch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin.encode())))
            with open(folder / "out", "w+") as out, open(folder / "err", "w+") as err:
                patch.setattr(sys, "stdout", out)
                patch.setattr(sys, "stderr", err)
                with pytest.raises(SystemExit) as end:
                    entry.main()
        assert isinstance(end.value.code, int)
        return Result(
            end.value.code, (folder / "out").read_text("utf-8"), (folder / "err").read_text("utf-8")
        )

    return call


def file(text: str, name: str = "model.yaml") -> Path:
    """A model file in the current folder."""
    path = Path(name)
    path.write_text(text, encoding="utf-8")
    return path


def table(text: str) -> tuple[list[str], np.ndarray]:
    header, *rows = csv.reader(io.StringIO(text))
    return header, np.array(rows, dtype=float)


def folder() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


Started = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Started]:
    """Starts the program in a process of its own, in a folder with models; ends it with the test."""
    (tmp_path / "m.yaml").write_text(PENDULUM)
    (tmp_path / "long.yaml").write_text(LONG)
    (tmp_path / "disk.yaml").write_text(DISK)
    processes: list[subprocess.Popen[bytes]] = []

    def start(
        *arguments: str, environment: dict[str, str] | None = None, **streams: Any
    ) -> subprocess.Popen[bytes]:
        root = str(Path(package.__file__).parent.parent)
        env = os.environ | {"PYTHONPATH": root} | (environment or {})
        command = [sys.executable, "-m", "lagcli", *arguments]
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = subprocess.Popen(command, env=env, cwd=tmp_path, **(pipes | streams))
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()
        process.wait()


def waiting(stream: int | IO[bytes] | None) -> int:
    """Bytes that wait in a pipe to be read."""
    count = array.array("i", [0])
    assert stream is not None
    fcntl.ioctl(stream, termios.FIONREAD, count)
    return count[0]


def await_(condition: Callable[[], bool]) -> None:
    """Wait until the condition holds; on a busy machine a process may take its time."""
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


# Exit codes and streams


@pytest.mark.parametrize("arguments", [["dof"], ["check"], ["simulate"], ["dof", "--json"], ["dof", "-v"]])
def test_a_good_model_exits_0(lagcli: Lagcli, arguments: list[str]) -> None:
    result = lagcli(*arguments, file(PENDULUM))
    assert result.code == 0
    assert result.out


def test_dof_prints_one_integer_and_nothing_else(lagcli: Lagcli) -> None:
    assert lagcli("dof", file(PENDULUM)) == Result(0, "1\n", "")
    assert lagcli("dof", file(ANGLE)) == Result(0, "1\n", "")
    assert lagcli("dof", file(KNIFE)) == Result(0, "3\n", "")


@pytest.mark.parametrize("command", ["dof", "check", "simulate"])
def test_an_invalid_model_exits_1_with_all_errors_and_writes_nothing(lagcli: Lagcli, command: str) -> None:
    result = lagcli(command, file(BROKEN))
    assert result.code == 1
    assert result.out == ""
    assert "model.yaml:5:37: error[unknown-key]: " in result.err
    assert "model.yaml:9:17: error[unknown-name]: " in result.err
    assert "      rod: L = norm(b)\n                    ^\n" in result.err
    assert "hint: " in result.err
    assert folder() == ["model.yaml"]


@pytest.mark.parametrize("command", ["dof", "check", "simulate"])
def test_a_directory_an_empty_and_a_binary_file_are_invalid_models(lagcli: Lagcli, command: str) -> None:
    Path("sub").mkdir()
    file("", "empty.yaml")
    Path("binary.yaml").write_bytes(bytes(range(256)))
    for name, code in (("sub", "not-a-file"), ("empty.yaml", "empty-model"), ("binary.yaml", "not-text")):
        result = lagcli(command, name)
        assert (result.code, result.out) == (1, "")
        assert re.match(rf"{name}:\d+:\d+: error\[{code}\]: ", result.err)


@pytest.mark.parametrize("command", ["dof", "check", "simulate"])
def test_a_model_that_does_not_exist_is_a_wrong_command_line(lagcli: Lagcli, command: str) -> None:
    assert lagcli(command, "nothing.yaml") == Result(2, "", "lagcli: there is no file nothing.yaml\n")


def test_check_tells_of_a_missing_file_before_it_works_on_the_others(lagcli: Lagcli) -> None:
    assert lagcli("check", file(PENDULUM), "nothing.yaml") == Result(
        2, "", "lagcli: there is no file nothing.yaml\n"
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ["dof"],
        ["dof", "model.yaml", "--nonsense"],
        ["nonsense"],
        ["simulate", "model.yaml", "--duration", "long"],
        ["simulate", "model.yaml", "--duration", "-1"],
        ["simulate", "model.yaml", "--duration", "nan"],
        ["simulate", "model.yaml", "--limit", "nan"],
        ["dof", "model.yaml", "--limit", "nan"],
        ["simulate", "model.yaml", "--samples", "1"],
        ["simulate", "model.yaml", "--samples", "5", "--output-step", "0.1"],
        ["simulate", "model.yaml", "--output-step", "0"],
        ["simulate", "model.yaml", "--method", "magic"],
        ["simulate", "model.yaml", "--rtol", "0"],
        ["simulate", "model.yaml", "--columns", "lambda.*,nonsense.*"],
        ["simulate", "model.yaml", "-o", "run.xls"],
        ["simulate", "model.yaml", "-o", "run"],
        ["simulate", "model.yaml", "--plot", "run.gif"],
        ["simulate", "model.yaml", "--stats", "-"],
        ["simulate", "model.yaml", "-o", "run.csv", "--stats", "./run.csv"],
        ["simulate", "model.yaml", "--stats", "model.yaml"],
        ["dof", "model.yaml", "--set", "m"],
        ["dof", "model.yaml", "--set", "=3"],
        ["check", "-", "-"],
        ["explain", "nonsense"],
        [],
    ],
)
def test_a_wrong_command_line_exits_2_and_does_nothing(lagcli: Lagcli, arguments: list[str]) -> None:
    file(PENDULUM)
    result = lagcli(*arguments)
    assert (result.code, result.out) == (2, "")
    assert result.err
    assert folder() == ["model.yaml"]
    assert Path("model.yaml").read_text(encoding="utf-8") == PENDULUM


def test_an_undecided_count_exits_4_with_the_range_on_stderr(lagcli: Lagcli) -> None:
    result = lagcli("dof", file(CUBED))
    assert (result.code, result.out) == (4, "")
    assert "undecided, between 0 and 2" in result.err
    explained = lagcli("dof", "--explain", "model.yaml")
    assert explained.code == 4
    assert "n - rows = 2 - 1 = 1 by" in explained.out
    assert "n - rank = 2 - 0 = 2 by" in explained.out
    assert "degrees of freedom: undecided, between 0 and 2" in explained.out
    result = lagcli("dof", "--json", "model.yaml")
    assert result.code == 4
    assert result.json == {
        "particles": 0,
        "coordinates": 2,
        "holonomic": None,
        "nonholonomic": None,
        "redundant": None,
        "configuration_dof": None,
        "velocity_dof": None,
        "proof": "none",
        "notes": [],
    }


def test_all_counts_are_shown_where_the_rank_is_below_the_codimension(lagcli: Lagcli) -> None:
    result = lagcli("dof", file(COLLINEAR))
    assert (result.code, result.out) == (0, "5\n")
    assert "note: the rows `ab`, `bc`, `ac` take more freedoms than their gradients say" in result.err
    assert "4 by second derivatives, 2 by rank" in result.err
    out = lagcli("dof", "--explain", "model.yaml").out
    assert "3N - rows = 9 - 3 = 6 by" in out
    assert "3N - rank = 9 - 2 = 7 by" in out
    assert "degrees of freedom: 3N - s = 9 - 4 = 5\n" in out
    assert "4 by second derivatives, 2 by rank" in out
    assert lagcli("dof", "--json", "model.yaml").json["configuration_dof"] == 5
    # One line is enough where all counts are the same.
    assert "rows" not in lagcli("dof", "--explain", file(PENDULUM)).out


def test_a_stopped_run_exits_3_and_keeps_its_complete_rows_in_partial(lagcli: Lagcli) -> None:
    result = lagcli("simulate", file(COLLAPSE), "-o", "run.csv", "--stats", "stats.json", "--plot", "run.png")
    assert result.code == 3
    assert result.out == ""
    # Free fall into 1/x**2 from rest at 1 ends at t = pi/sqrt(8) = 1.1107.
    assert "stopped at t = 1.1107" in result.err
    assert "the complete rows are in " in result.err
    header, rows = table(Path("run.csv.partial").read_text(encoding="utf-8"))
    assert len(header) == rows.shape[1]
    assert rows[-1, 0] == pytest.approx(1.1)
    assert len(rows) == 23
    assert np.isfinite(rows).all()
    assert json.loads(Path("stats.json").read_text(encoding="utf-8"))["steps"] > 0
    assert folder() == ["model.yaml", "run.csv.partial", "run.png", "stats.json"]


def test_a_stopped_run_on_stdout_exits_3_after_its_rows(lagcli: Lagcli) -> None:
    result = lagcli("simulate", file(COLLAPSE))
    assert result.code == 3
    assert len(table(result.out)[1]) == 23


@pytest.mark.parametrize("command", ["dof", "check", "simulate"])
def test_a_bug_exits_70_with_one_line_and_a_traceback_only_on_request(
    lagcli: Lagcli, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*arguments: object) -> None:
        raise RuntimeError("out of order\nwith more lines")

    monkeypatch.setattr(cache, "compiled", broken)
    result = lagcli(command, file(PENDULUM))
    assert (result.code, result.out) == (70, "")
    assert result.err.count("\n") == 1
    assert "this is a bug in lagcli (RuntimeError: out of order)" in result.err
    assert "report" in result.err
    result = lagcli(command, "model.yaml", "--debug")
    assert result.code == 70
    assert "Traceback" in result.err
    assert "in broken" in result.err


def test_standard_input_is_a_model_called_stdin(lagcli: Lagcli) -> None:
    assert lagcli("dof", "-", stdin=PENDULUM) == Result(0, "1\n", "")
    result = lagcli("dof", "-", stdin=BROKEN)
    assert result.code == 1
    assert result.err.startswith("<stdin>:5:37: error[unknown-key]: ")
    assert lagcli("check", "-", stdin="").err.startswith("<stdin>:1:1: error[empty-model]")
    assert len(table(lagcli("simulate", "-", stdin=PENDULUM).out)[1]) == 6


def test_data_goes_to_stdout_and_everything_else_to_stderr(lagcli: Lagcli) -> None:
    loud = lagcli("simulate", file(PENDULUM), "-v")
    quiet = lagcli("simulate", "model.yaml", "-q")
    assert loud.out == quiet.out
    assert quiet.err == ""
    assert re.search(r"^compiled in .* 6 rows of \d+ columns", loud.err, re.MULTILINE)
    assert re.search(
        r"^done: \d+ steps .* dop853 .* drift \S+ in position, .* energy balance", loud.err, re.MULTILINE
    )


def test_an_energy_balance_that_is_not_known_is_said_and_is_null(lagcli: Lagcli) -> None:
    motor = (
        'lagcli: 1\ncoordinates: {th: {rate: 10}}\nparticles: {a: {mass: 1, position: "[cos(th), 0, sin(th)]"}}\n'
        'forces: {w: {to: a, force: "[0, 0, -9.81]"}}\nholonomic: {motor: th = 10*t}\n'
    )
    done = lagcli("simulate", file(motor), "--duration", "1e6", "--samples", "3", "--stats", "s.json")
    assert done.code == 0
    assert "energy balance not known: the power of rows or forces oscillates too often" in done.err
    assert json.loads(Path("s.json").read_text())["energy_imbalance"] is None


def test_quiet_leaves_errors_and_takes_warnings(lagcli: Lagcli) -> None:
    warned = lagcli("check", file(WARNED))
    quiet = lagcli("check", "model.yaml", "-q")
    assert "warning[inconsistent-start]" in warned.err
    assert quiet.err == ""
    assert quiet.out == warned.out
    assert "error[" in lagcli("check", file(BROKEN), "-q").err


def test_verbose_dof_says_on_stderr_what_explain_says_on_stdout(lagcli: Lagcli) -> None:
    result = lagcli("dof", file(PENDULUM), "-v")
    explained = lagcli("dof", "model.yaml", "--explain")
    assert result.out == "1\n"
    assert result.err == explained.out
    assert "1 particle, 3 coordinates (3N = 3)" in explained.out
    assert "degrees of freedom: 3N - s = 3 - 2 = 1" in explained.out
    assert explained.err == ""


@pytest.mark.parametrize("command", [[], ["dof"], ["check"], ["simulate"], ["explain"]])
@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_every_command_has_help_on_stdout(lagcli: Lagcli, command: list[str], flag: str) -> None:
    result = lagcli(*command, flag)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("Usage: lagcli")
    # A sentence that does not fit is cut by the library that lays out the help.
    assert "..." not in result.out.replace("MODEL...", "").replace("[ARGS]...", "")
    if command in (["dof"], ["check"], ["simulate"]):
        assert all(option in result.out for option in ("--set", "--json", "--quiet", "--verbose"))


def test_version_is_that_of_the_package(lagcli: Lagcli) -> None:
    assert lagcli("--version") == Result(0, f"lagcli {package.__version__}\n", "")


def test_explain_gives_the_page_of_a_code_or_all_codes(lagcli: Lagcli) -> None:
    result = lagcli("explain", "unknown-name")
    assert result.code == 0
    assert "unknown-name" in result.out
    assert "Example" in result.out
    listed = [line.split(maxsplit=1) for line in lagcli("explain").out.splitlines()]
    assert [code for code, _ in listed] == list(catalogue.codes())
    for code, told in listed:
        page = catalogue.page(code)
        assert told == (page.meaning if page.severity == "error" else f"({page.severity}) {page.meaning}")
    result = lagcli("explain", "unknwon-name")
    assert result.code == 2
    assert "did you mean `unknown-name`?" in result.err


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["monkey2.yaml"], "did you mean `lagcli simulate monkey2.yaml`?"),
        (["simulte", "model.yaml"], "did you mean `simulate`?"),
        (["run", "model.yaml"], "did you mean `lagcli simulate MODEL`?"),
        (["help"], "did you mean `lagcli --help`?"),
        (["nonsense"], "the commands are `dof`, `check`"),
        (["a\x1b[2Jb.yaml"], "did you mean `lagcli simulate a\N{REPLACEMENT CHARACTER}[2Jb.yaml`?"),
        (["explain", "nope"], "unknown error code `nope`; `lagcli explain` lists all codes"),
    ],
)
def test_an_unknown_word_has_a_hint_that_leads_out(lagcli: Lagcli, arguments: list[str], meant: str) -> None:
    result = lagcli(*arguments)
    assert (result.code, result.out) == (2, "")
    assert meant in result.err
    assert "\x1b" not in result.err


def test_tables_go_to_the_null_device_and_have_tabs_on_request(lagcli: Lagcli) -> None:
    result = lagcli("simulate", file(PENDULUM), "-q", "--samples", "3", "-o", os.devnull)
    assert (result.code, result.out, result.err) == (0, "", "")
    csv, tsv = (
        lagcli("simulate", "model.yaml", "-q", "--samples", "3", "-o", f"run.{ending}")
        for ending in ("csv", "tsv")
    )
    assert (csv.code, tsv.code) == (0, 0)
    text = Path("run.tsv").read_text(encoding="utf-8")
    assert text == Path("run.csv").read_text(encoding="utf-8").replace(",", "\t")
    assert "," not in text


# JSON

DOF_KEYS = [
    "particles",
    "coordinates",
    "holonomic",
    "nonholonomic",
    "redundant",
    "configuration_dof",
    "velocity_dof",
    "proof",
    "notes",
]
CONSTRAINT_KEYS = [
    *["name", "declared", "verdict", "integral", "integrating_factor", "redundant", "method", "unique"]
]
ERROR_KEYS = ["code", "message", "line", "column", "path", "hint"]


def test_dof_as_json_holds_the_count(lagcli: Lagcli) -> None:
    result = lagcli("dof", "--json", file(PENDULUM))
    assert result.out.count("\n") == 1
    assert list(result.json) == DOF_KEYS
    assert result.json == dict(zip(DOF_KEYS, [1, 3, 2, 0, 0, 1, 1, "numeric", []], strict=True))
    assert lagcli("dof", "--json", file(KNIFE)).json == dict(
        zip(DOF_KEYS, [0, 3, 0, 1, 0, 3, 2, "symbolic", []], strict=True)
    )


def test_check_as_json_holds_the_report(lagcli: Lagcli) -> None:
    report = lagcli("check", "--json", file(SPOKE)).json
    assert list(report) == ["dof", "constraints", "joint", "initial", "warnings", "dependences"]
    assert list(report["dof"]) == DOF_KEYS
    assert list(report["joint"]) == ["derived_flag", "integrals", "growth_vector", "proof"]
    assert list(report["initial"]) == ["position_residual", "velocity_residual", "consistent"]
    (row,) = report["constraints"]
    assert list(row) == CONSTRAINT_KEYS
    assert (row["name"], row["declared"], row["verdict"]) == ("spoke", "differential", "integrable")
    assert row["integral"] is not None
    assert row["integrating_factor"] is not None
    assert row["redundant"] is False
    assert row["unique"] is True
    assert report["dependences"] == []
    assert report["warnings"] == []
    (edge,) = lagcli("check", "--json", file(KNIFE)).json["constraints"]
    assert (edge["verdict"], edge["integral"], edge["integrating_factor"]) == ("nonholonomic", None, None)


def test_check_as_json_of_several_models_is_a_list_in_their_order(lagcli: Lagcli) -> None:
    paths = [file(PENDULUM, "a.yaml"), file(BROKEN, "b.yaml"), file(KNIFE, "c.yaml")]
    result = lagcli("check", "--json", *paths)
    assert (result.code, result.err) == (1, "")
    good, bad, knife = result.json
    assert good["dof"]["configuration_dof"] == 1
    assert list(bad) == ["path", "errors"]
    assert [one["path"] for one in result.json] == [str(path) for path in paths]
    assert "title" in good
    assert knife["dof"]["velocity_dof"] == 2


@pytest.mark.parametrize("command", ["dof", "check", "simulate"])
def test_errors_as_json_go_to_stdout(lagcli: Lagcli, command: str) -> None:
    result = lagcli(command, "--json", file(BROKEN))
    assert (result.code, result.err) == (1, "")
    assert list(result.json) == ["errors"]
    errors = result.json["errors"]
    assert [(e["code"], e["line"], e["column"]) for e in errors] == [
        ("unknown-key", 5, 37),
        ("unknown-name", 9, 17),
    ]
    assert all(list(e) == ERROR_KEYS and e["path"] == "model.yaml" for e in errors)
    assert errors[0]["hint"] == "did you mean `velocity`?"


def test_warnings_stand_in_the_json_of_check(lagcli: Lagcli) -> None:
    result = lagcli("check", "--json", file(WARNED))
    assert result.code == 0
    assert result.json["initial"]["consistent"] is False
    assert result.json["initial"]["velocity_residual"] == pytest.approx(1)
    assert [list(w) for w in result.json["warnings"]] == [ERROR_KEYS]


def test_simulate_as_json_gives_the_account_where_stdout_is_free(lagcli: Lagcli) -> None:
    result = lagcli("simulate", "--json", "-q", "-o", "run.csv", file(PENDULUM))
    assert result.code == 0
    assert result.json["method"] == "dop853"
    assert len(table(lagcli("simulate", "--json", "model.yaml").out)[1]) == 6


def test_json_is_ascii_safe_for_terminals_and_keeps_letters(lagcli: Lagcli) -> None:
    hostile = PENDULUM.replace(
        "plane: a.y = 0", '"gr\\u00f6\\u00dfe": a.y = 0\n  "x\\u009b31m\\e[31m": a.x = 0'
    )
    result = lagcli("check", "--json", file(hostile))
    assert result.code == 1
    assert result.out.rstrip("\n").isprintable()
    assert "error" in result.out


# check


def test_check_reports_verdict_integral_count_and_start(lagcli: Lagcli) -> None:
    result = lagcli("check", file(SPOKE))
    assert result.code == 0
    assert re.search(r"^constraint +declared +verdict +integral +factor *$", result.out, re.MULTILINE)
    assert re.search(r"^spoke +differential +integrable +\S+ = const", result.out, re.MULTILINE)
    assert re.search(r"^spoke: .*integrating factor", result.out, re.MULTILINE)
    assert "degrees of freedom: n - s = 2 - 1 = 1\n" in result.out
    assert result.out.endswith("initial values: consistent\n")


def test_check_names_redundant_rows(lagcli: Lagcli) -> None:
    result = lagcli("check", file(PENDULUM.replace("plane:", "twice: norm(a)**2 = L**2\n  plane:")))
    assert re.search(r"^twice +holonomic +holonomic +yes", result.out, re.MULTILINE)
    assert "left out as redundant: 1 row: twice" in result.out


TWINS = PENDULUM.replace("plane:", "twice: norm(a)**2 = L**2\n  plane:")


def test_check_tells_which_multipliers_are_not_unique(lagcli: Lagcli) -> None:
    result = lagcli("check", file(TWINS))
    assert re.search(r"^rod +holonomic +holonomic +not unique *$", result.out, re.MULTILINE)
    assert re.search(r"^twice +holonomic +holonomic +yes +not unique *$", result.out, re.MULTILINE)
    assert re.search(r"^plane +holonomic +holonomic *$", result.out, re.MULTILINE)
    assert "`rod` and `twice` share one force\n" in result.out
    assert "unique" not in lagcli("check", file(PENDULUM)).out


def test_check_as_json_holds_null_vectors(lagcli: Lagcli) -> None:
    report = lagcli("check", "--json", file(TWINS)).json
    assert {row["name"]: row["unique"] for row in report["constraints"]} == {
        "rod": False,
        "twice": False,
        "plane": True,
    }
    (vector,) = report["dependences"]
    assert vector["rows"] == ["rod", "twice"]
    # With L = 1 the gradient of norm(a)**2 - L**2 is minus twice that of L - norm(a).
    assert vector["weights"] == pytest.approx([1, 0.5], abs=1e-12)


def test_many_null_vectors_are_reported_in_a_few_lines(lagcli: Lagcli) -> None:
    text = """lagcli: 1
particles:
  p[i]: {for: i = 1..21, mass: 1, position: "[i, 0, 0]"}
holonomic:
  rod[i]: {for: i = 1..20, equation: "distance(p[i], p[i+1]) = 1"}
  twin[i]: {for: i = 1..20, equation: "distance(p[i], p[i+1])**2 = 1"}
"""
    out = lagcli("check", file(text)).out
    assert out.count("share one force") == 6
    assert "and 14 more\n" in out
    assert len(lagcli("check", "--json", "model.yaml").json["dependences"]) == 20


def test_inconsistent_initial_values_are_a_warning_of_check_and_an_error_of_simulate(lagcli: Lagcli) -> None:
    checked = lagcli("check", file(WARNED))
    assert checked.code == 0
    assert "inconsistent, by 0 in position and 1 in velocity" in checked.out
    assert "warning[inconsistent-start]" in checked.err
    simulated = lagcli("simulate", "model.yaml")
    assert (simulated.code, simulated.out) == (1, "")
    assert "error[inconsistent-start]" in simulated.err
    assert "`rod`" in simulated.err
    assert "--assemble" in simulated.err
    assert lagcli("dof", "model.yaml") == Result(0, "1\n", "")
    assembled = lagcli("simulate", "model.yaml", "--assemble")
    assert assembled.code == 0
    assert re.search(r"^assembled: moved by .* velocities by 1 ", assembled.err, re.MULTILINE)


def test_strict_makes_warnings_fail(lagcli: Lagcli) -> None:
    assert lagcli("check", "--strict", file(WARNED)).code == 1
    assert lagcli("check", "--strict", file(PENDULUM)).code == 0


def test_several_models_are_reported_under_their_names_and_the_worst_counts(lagcli: Lagcli) -> None:
    result = lagcli("check", file(PENDULUM, "a.yaml"), file(BROKEN, "b.yaml"), file(SPOKE, "c.yaml"))
    assert result.code == 1
    assert "a.yaml: A pendulum\n" in result.out
    assert "\nc.yaml\n" in result.out
    assert "b.yaml:5:37: error[unknown-key]" in result.err


def test_piped_tables_are_never_cut_or_folded(lagcli: Lagcli) -> None:
    name = "n" * 400
    result = lagcli("check", file(PENDULUM.replace("rod:", f"{name}:")))
    assert re.search(rf"^{name} +holonomic +holonomic *$", result.out, re.MULTILINE)


def test_user_texts_are_no_markup_and_do_not_steer_the_terminal(lagcli: Lagcli) -> None:
    title = r'"[red]title[/red] $x$ :smile: \e[31m\u009b31m größe"'
    result = lagcli("check", file(PENDULUM.replace("A pendulum", title)))
    first = result.out.splitlines()[0]
    assert first.startswith("[red]title[/red] $x$ :smile: ")
    assert first.endswith(" größe")
    assert first.isprintable()
    missing = lagcli("dof", "no\x1b[31m.yaml")
    assert missing.code == 2
    assert missing.err.rstrip("\n").isprintable()


# --set


def first_row(result: Result) -> dict[str, float]:
    header, rows = table(result.out)
    return dict(zip(header, rows[0], strict=True))


def test_set_overrides_parameters_and_initial_values(lagcli: Lagcli) -> None:
    row = first_row(lagcli("simulate", file(PENDULUM), "--set", "m=2", "--set", "L = 1 + 1/2"))
    assert row["a.x"] == 1.5
    assert row["energy"] == pytest.approx(1)
    row = first_row(lagcli("simulate", "model.yaml", "--set", "a.z=-1", "--set", "a.x=0", "--set", "a.vz=0"))
    assert (row["a.x"], row["a.z"], row["a.vz"]) == (0, -1, 0)
    assert row["lambda.rod"] == pytest.approx(9.81)
    row = first_row(
        lagcli("simulate", "model.yaml", "--set", "a.position=[0, 0, L]", "--set", "a.velocity=[2, 0, 0]")
    )
    assert (row["a.z"], row["a.vx"]) == (1, 2)
    row = first_row(lagcli("simulate", file(ANGLE), "--set", "theta.value=pi/3", "--set", "theta.rate=-1"))
    assert row["theta"] == pytest.approx(np.pi / 3)
    assert row["rate(theta)"] == -1
    assert row["height"] == pytest.approx(-0.5)


def test_the_last_of_two_settings_of_one_name_counts(lagcli: Lagcli) -> None:
    row = first_row(lagcli("simulate", file(ANGLE), "--set", "theta.value=1", "--set", "theta.value=0.25"))
    assert row["theta"] == 0.25


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("mm=2", "did you mean `m`?"),
        ("a.mass=2", "`a.position`"),
        ("nobody.x=2", "--set nobody.x"),
        ("m=", "--set m"),
        ("m=2+", "--set m:1:2: error[syntax]"),
        ("m=nobody", "--set m:1:1: error[unknown-name]"),
        ("m=2^3", "`**`"),
        ("m=9**9**9", "--set m:1:"),
        ("a.x=[1, 2]", "--set a.x"),
    ],
)
@pytest.mark.parametrize("command", ["dof", "check", "simulate"])
def test_a_wrong_setting_is_a_wrong_command_line(
    lagcli: Lagcli, command: str, change: str, said: str
) -> None:
    result = lagcli(command, file(PENDULUM), "--set", change)
    assert (result.code, result.out) == (2, "")
    assert said in result.err


def test_a_setting_that_the_model_cannot_bear_is_an_error_of_the_model(lagcli: Lagcli) -> None:
    result = lagcli("dof", file(PENDULUM), "--set", "m=-1")
    assert result.code == 1
    assert "model.yaml:5:13: error[mass-not-positive]" in result.err


def test_a_wrong_setting_is_reported_as_json_too(lagcli: Lagcli) -> None:
    result = lagcli("dof", "--json", file(PENDULUM), "--set", "m=2+")
    assert result.code == 2
    assert [(e["code"], e["path"]) for e in result.json["errors"]] == [("syntax", "--set m")]


# simulate


def test_simulate_writes_csv_with_the_columns_of_the_contract(lagcli: Lagcli) -> None:
    header, rows = table(lagcli("simulate", file(PENDULUM)).out)
    assert header == [
        *["t", "a.x", "a.y", "a.z", "a.vx", "a.vy", "a.vz", "lambda.rod", "lambda.plane"],
        *["R.a.x", "R.a.y", "R.a.z", "energy"],
    ]
    assert rows[:, 0] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert lagcli("simulate", "model.yaml", "-o", "-").out == lagcli("simulate", "model.yaml").out
    header, _ = table(lagcli("simulate", file(ANGLE)).out)
    assert header == ["t", "theta", "rate(theta)", "R.theta", "energy", "height"]


def read(path: Path) -> tuple[list[str], np.ndarray]:
    match path.suffix:
        case ".csv":
            return table(path.read_text(encoding="utf-8"))
        case ".tsv":
            return table(path.read_text(encoding="utf-8").replace("\t", ","))
        case ".json":
            content = json.loads(path.read_text(encoding="utf-8"))
            assert list(content) == ["columns", "rows", "provenance"]
            return content["columns"], np.array(content["rows"])
        case ".npz":
            with np.load(path) as archive:
                return list(archive.files), np.stack([archive[name] for name in archive.files], axis=1)
        case _:
            content = pyarrow.parquet.read_table(path)
            return content.column_names, np.stack([c.to_numpy() for c in content.columns], axis=1)


@pytest.mark.parametrize("ending", formats.TABLES)
def test_the_ending_picks_the_format_and_the_values_are_those_of_stdout(lagcli: Lagcli, ending: str) -> None:
    path = Path(f"run.{ending}")
    written = lagcli("simulate", file(PENDULUM), "-o", path)
    assert (written.code, written.out) == (0, "")
    names, values = read(path)
    expected_names, expected = table(lagcli("simulate", "model.yaml").out)
    assert names == expected_names
    assert np.array_equal(values, expected)
    assert folder() == ["model.yaml", f"run.{ending}"]


@pytest.mark.parametrize("ending", formats.FIGURES)
def test_plot_alone_writes_a_figure_and_no_table(lagcli: Lagcli, ending: str) -> None:
    result = lagcli("simulate", file(PENDULUM), "--plot", f"run.{ending}")
    assert (result.code, result.out) == (0, "")
    start = Path(f"run.{ending}").read_bytes()[:5]
    assert start[:4] == b"\x89PNG" if ending == "png" else start in (b"<?xml", b"%PDF-")
    both = lagcli("simulate", "model.yaml", "--plot", f"run.{ending}", "-o", "-")
    assert len(table(both.out)[1]) == 6


def test_options_win_over_the_section_simulation(lagcli: Lagcli) -> None:
    file(PENDULUM)
    _, rows = table(lagcli("simulate", "model.yaml", "--duration", "1", "--samples", "3").out)
    assert rows[:, 0].tolist() == [0, 0.5, 1]
    _, rows = table(lagcli("simulate", "model.yaml", "--output-step", "0.2").out)
    assert rows[:, 0].tolist() == [0, 0.2, 0.4, 0.5]
    loose = lagcli("simulate", "model.yaml", "--rtol", "1e-4", "--atol", "1e-6", "--method", "dop853")
    assert loose.code == 0
    assert loose.out != lagcli("simulate", "model.yaml").out


def test_columns_choose_by_name_where_brackets_are_letters(
    lagcli: Lagcli, monkeypatch: pytest.MonkeyPatch
) -> None:
    header, rows = table(lagcli("simulate", file(PENDULUM), "--columns", "t,lambda.*,R.a.?").out)
    assert header == ["t", "lambda.rod", "lambda.plane", "R.a.x", "R.a.y", "R.a.z"]
    assert rows.shape == (6, 6)
    wrong = lagcli("simulate", "model.yaml", "--columns", "lambda.rodd")
    assert "lambda.rod" in wrong.err
    # Names with brackets, as of families: the whole contract of the patterns is tested with the export.
    assert table_format.select(("t", "p[1].x", "p1.x"), "p[1].*", ()) == [1]


STATS_KEYS = [
    *["steps", "rejected", "evaluations", "compile_seconds", "solve_seconds", "method"],
    *["position_drift", "velocity_drift", "energy_imbalance", "indeterminate", "singular_times"],
    *["stopped", "ended_by", "rows", "t_end", "provenance"],
    *["rtol", "atol"],
    *["impacts", "releases", "accumulations", "largest_penetration", "warnings", "native_steps"],
]


def test_stats_hold_the_account(lagcli: Lagcli) -> None:
    result = lagcli("simulate", file(PENDULUM), "--stats", "stats.json", "-o", "run.npz")
    assert result.code == 0
    stats = json.loads(Path("stats.json").read_text(encoding="utf-8"))
    assert list(stats) == STATS_KEYS
    assert stats["steps"] > 0
    assert stats["evaluations"] > 12 * stats["steps"]
    assert stats["method"] == "dop853"
    assert 0 <= stats["position_drift"] < 1e-14
    assert 0 <= stats["velocity_drift"] < 1e-14
    assert 0 <= stats["energy_imbalance"] < 1e-10


# Files


@pytest.mark.parametrize("option", ["-o", "--plot", "--stats"])
def test_a_file_that_cannot_be_made_exits_74_before_the_run(
    lagcli: Lagcli, option: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ending = {"-o": "csv", "--plot": "png", "--stats": "json"}[option]
    file(PENDULUM)
    monkeypatch.setattr(prepare_run, "prepare", None)
    for place in (f"missing/run.{ending}", f"model.yaml/run.{ending}"):
        result = lagcli("simulate", "model.yaml", option, place)
        assert (result.code, result.out) == (74, "")
        assert result.err.startswith(f"lagcli: cannot write {place}: ")
        assert result.err.count("\n") == 1
    Path(f"run.{ending}").mkdir()
    assert lagcli("simulate", "model.yaml", option, f"run.{ending}").code == 74


@pytest.mark.parametrize("ending", formats.TABLES)
def test_a_full_disk_exits_74_and_names_the_file(lagcli: Lagcli, ending: str) -> None:
    path = Path(f"run.{ending}")
    path.symlink_to("/dev/full")
    result = lagcli("simulate", file(PENDULUM), "-q", "-o", path)
    assert result.code == 74
    assert result.err.startswith(f"lagcli: cannot write run.{ending}: ")
    assert result.err.endswith(f"{os.strerror(errno.ENOSPC)}\n")


def test_a_disk_that_fills_up_leaves_the_old_file(lagcli: Lagcli, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("run.csv").write_text("old")

    def full(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sinks.Sink, "write", full)
    result = lagcli("simulate", file(PENDULUM), "-q", "-o", "run.csv")
    assert result.code == 74
    assert "cannot write run.csv" in result.err
    assert Path("run.csv").read_text() == "old"
    assert folder() == ["model.yaml", "run.csv"]
    lagcli("simulate", "model.yaml", "-q", "-o", "run.csv", "--stats", "stats.json")
    account = json.loads(Path("stats.json").read_text())
    assert (account["rows"], account["t_end"]) == (0, None)
    assert account["stopped"]["code"] == "not-written"
    assert "cannot write run.csv" in account["stopped"]["reason"]


def test_a_figure_that_cannot_be_written_leaves_the_table(
    lagcli: Lagcli, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(figure_page, "write", full)
    result = lagcli("simulate", file(PENDULUM), "-q", "-o", "run.csv", "--plot", "run.png")
    assert result.code == 74
    assert "cannot write run.png" in result.err
    assert folder() == ["model.yaml", "run.csv"]


@pytest.mark.parametrize(
    "arguments", [["dof", "m.yaml"], ["dof", "disk.yaml", "--json"], ["--help"], ["--version"]]
)
def test_a_full_stdout_exits_74(started: Started, arguments: list[str]) -> None:
    with open("/dev/full", "w") as full:
        process = started(*arguments, stdout=full)
    err = process.communicate()[1].decode()
    assert process.returncode == 74
    assert err.splitlines()[-1] == f"lagcli: cannot write standard output: {os.strerror(errno.ENOSPC)}"
    assert "Traceback" not in err


@pytest.mark.parametrize("arguments", [["dof", "m.yaml"], ["simulate", "m.yaml"]])
def test_a_closed_stdout_exits_74(started: Started, arguments: list[str]) -> None:
    process = started(*arguments, stdout=None, preexec_fn=lambda: os.close(1))
    err = process.communicate()[1].decode()
    assert process.returncode == 74
    assert "cannot write standard output" in err
    assert err.count("\n") == 1


def test_with_a_closed_stderr_errors_do_not_go_to_stdout(started: Started) -> None:
    process = started("dof", "missing.yaml", stderr=None, preexec_fn=lambda: os.close(2))
    assert process.communicate()[0] == b""
    assert process.returncode == 2


# Pipes, signals, terminals


def test_a_reader_that_goes_away_ends_the_run_quietly_with_141(started: Started, tmp_path: Path) -> None:
    process = started("simulate", "long.yaml", "--stats", "stats.json")
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline().startswith(b"t,a.x,")
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() == 141
    stopped = json.loads((tmp_path / "stats.json").read_text())["stopped"]
    assert (stopped["code"], stopped["reason"]) == ("not-written", "the reader of the rows went away")


@pytest.mark.parametrize("arguments", [["simulate", "m.yaml", "-q"], ["check", "m.yaml"], ["--help"]])
def test_a_pipe_that_nobody_reads_is_quiet_too(started: Started, arguments: list[str]) -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    process = started(*arguments, stdout=write_end)
    os.close(write_end)
    assert process.communicate()[1] == b""
    assert process.returncode == 141


def test_a_table_leaves_a_closed_pipe_to_the_exit(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in `check | head -1`, where the title is read and the table finds the pipe closed."""

    class Closed(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stdout", Closed())
    with pytest.raises(BrokenPipeError):
        console.table(["a"], [["b"]], {})


@pytest.mark.parametrize(
    ("number", "code", "ending"),
    [(signal.SIGINT, 130, "csv"), (signal.SIGTERM, 143, "csv"), (signal.SIGINT, 130, "npz")],
)
def test_an_interrupted_run_keeps_its_rows_in_partial_and_leaves_the_file(
    started: Started, tmp_path: Path, number: int, code: int, ending: str
) -> None:
    path = tmp_path / f"run.{ending}"
    path.write_text("old")
    process = started("simulate", "long.yaml", "-o", path.name, "--stats", "stats.json", "--json")
    if ending == "csv":
        await_(lambda: written_aside(tmp_path) > 10_000)
    else:  # a format by columns keeps its rows to itself for a while
        await_(lambda: written_aside(tmp_path) >= 0)
        time.sleep(0.7)
    process.send_signal(number)
    out, err = (stream.decode() for stream in process.communicate())
    assert process.returncode == code
    assert err == f"lagcli: interrupted; the complete rows are in run.{ending}.partial\n"
    assert path.read_text() == "old"
    assert sorted(p.name for p in tmp_path.glob("*run*")) == [path.name, f"{path.name}.partial"]
    partial = path.with_name(path.name + ".partial").rename(tmp_path / f"partial.{ending}")
    names, rows = read(partial)
    assert names[:2] == ["t", "a.x"]
    assert len(rows) > 10
    assert np.diff(rows[:, 0]) == pytest.approx(0.02)
    account = json.loads((tmp_path / "stats.json").read_text())
    assert json.loads(out) == account
    assert (account["rows"], account["t_end"]) == (len(rows), rows[-1, 0])
    assert account["stopped"]["code"] == "interrupted"
    assert account["stopped"]["reason"] == f"interrupted by {signal.Signals(number).name}"
    assert account["stopped"]["t"] >= account["t_end"]


def written_aside(folder: Path) -> int:
    """Bytes in the file that will become run.*, -1 before there is one."""
    return max((path.stat().st_size for path in folder.glob(".run*.tmp")), default=-1)


def test_rows_found_between_two_blocks_are_kept(started: Started, tmp_path: Path) -> None:
    """A run of few rows that takes long: what is there when it is interrupted is not lost."""
    process = started("simulate", "m.yaml", "-o", "run.csv", "--duration", "1e5", "--samples", "4001")
    await_(lambda: written_aside(tmp_path) > 500)
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == 143
    assert 1 < len(table((tmp_path / "run.csv.partial").read_text())[1]) < 4001


def test_an_interrupt_before_the_run_is_quiet(started: Started) -> None:
    read_end, write_end = os.pipe()
    process = started("dof", "-", stdin=read_end)
    os.write(write_end, b"lagcli: 1\n")
    await_(lambda: waiting(read_end) == 0)  # now it waits for the rest of the model
    process.send_signal(signal.SIGINT)
    assert process.communicate() == (b"", b"")
    assert process.returncode == 130
    os.close(read_end)
    os.close(write_end)


def test_a_second_signal_ends_a_run_that_is_stuck_in_a_full_pipe(started: Started) -> None:
    process = started("simulate", "long.yaml")
    await_(lambda: waiting(process.stdout) > 60_000)
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    # Where the first one was enough, the second one may meet the interpreter on its way out.
    assert process.wait(timeout=20) in (143, -signal.SIGTERM)


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return 2


def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Make stdout and stderr a terminal for the rest of the test."""
    stream = Terminal()
    for name in ("NO_COLOR", "FORCE_COLOR", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setattr(console, "DELAY", 0.0)
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(sys, "stdout", stream)
    return stream


def some_progress(quiet: bool = False) -> None:
    with console.progress(0.0, 2.0, quiet) as bar:
        for t in (0.5, 1.0, 1.5, 2.0):
            bar.at(t)


def test_a_bar_shows_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    some_progress()
    assert "100%" in stream.getvalue()
    assert stream.getvalue().count("\x1b[?25l") == stream.getvalue().count("\x1b[?25h") == 1


@pytest.mark.parametrize(("name", "value"), [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_no_bar_on_a_terminal_that_takes_none(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    stream = terminal(monkeypatch)
    monkeypatch.setenv(name, value)
    some_progress()
    assert stream.getvalue() == ""


def test_no_bar_where_it_is_quiet_or_stderr_is_piped(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    some_progress(quiet=True)
    monkeypatch.setattr(stream, "isatty", lambda: False)
    monkeypatch.setenv("FORCE_COLOR", "1")
    some_progress()
    assert stream.getvalue() == ""


def shown_table(monkeypatch: pytest.MonkeyPatch, tty: bool = True, **environment: str) -> str:
    with monkeypatch.context() as patch:
        stream = terminal(patch)
        patch.setattr(stream, "isatty", lambda: tty)
        for name, value in environment.items():
            patch.setenv(name, value)
        rows = [["[red]a[/red]", "differential", "nonholonomic"]]
        console.table(["constraint", "declared", "verdict"], rows, {"nonholonomic": "yellow"})
    assert "[red]a[/red]" in stream.getvalue()
    return stream.getvalue()


def test_tables_have_colour_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "\x1b[33mnonholonomic" in shown_table(monkeypatch)
    assert "\x1b" not in shown_table(monkeypatch, NO_COLOR="1")
    assert "\x1b" not in shown_table(monkeypatch, TERM="dumb")
    assert "\x1b" not in shown_table(monkeypatch, tty=False, FORCE_COLOR="1")


@pytest.mark.parametrize("columns", [30, 50, 80, 120])
def test_a_report_on_a_terminal_folds_and_loses_nothing(
    lagcli: Lagcli, monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    """Formulas and reasons stand whole, whatever the width; no line is wider than the terminal."""
    long = SPOKE.replace("x*d(y) - y*d(x) = 0", "d(x**3*y + sin(x*y) + exp(x)*cos(y) + x**5*y**7) = 0")
    wide = lagcli("check", file(long)).out
    stream = Terminal()
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        from lagcli.cli.commands import check_command

        check_command.print_report(package.check(package.load("model.yaml")), heading=False)
    lines = stream.getvalue().splitlines()
    assert max(map(len, lines)) <= columns

    def words(text: str) -> set[str]:
        return set(text.split()) - {"constraint", "declared", "verdict", "integral", "differential"}

    assert words(wide) - {"spoke"} <= words(stream.getvalue()) | {"exact"}


def test_a_long_run_shows_its_progress_on_a_terminal_and_an_interrupt_restores_it(started: Started) -> None:
    master, slave = pty.openpty()
    environment = {"TERM": "xterm", "COLUMNS": "80", "NO_COLOR": ""}
    process = started("simulate", "long.yaml", "-o", "run.csv", stderr=slave, environment=environment)
    os.close(slave)
    shown = b""

    def more() -> bool:
        """Take in what is shown; whether the other end is still open."""
        nonlocal shown
        try:
            got = os.read(master, 4096)
        except OSError:  # how Linux tells that the other end is closed
            got = b""
        shown += got
        return bool(got)

    while b"%" not in shown and more():
        pass
    process.send_signal(signal.SIGINT)
    while more():
        pass
    os.close(master)
    assert process.wait() == 130
    assert shown.count(b"\x1b[?25l") == shown.count(b"\x1b[?25h") == 1
    assert b"interrupted; the complete rows are in run.csv.partial" in shown


# The parts


def test_an_invalid_model_is_the_command_lines_fault_only_if_all_of_it_is() -> None:
    def found(*paths: str) -> diagnostics.ModelError:
        return diagnostics.ModelError(
            diagnostics.Diagnostic("syntax", "", diagnostics.Location(path, 1, 1)) for path in paths
        )

    assert exits.of(found("--set m", "--set L")) == 2
    assert exits.of(found("--set m", "model.yaml")) == 1


def test_a_signal_waits_for_the_end_of_what_is_shielded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_raised", [])  # nothing of it is left for others
    reached = []

    def shielded() -> None:
        with interrupts.shielded():
            with interrupts.shielded():
                interrupts._handle(signal.SIGTERM, None)
            reached.append("the end of what is inside")
        reached.append("more")

    with pytest.raises(interrupts.Interrupted) as caught:
        shielded()
    assert caught.value.number == signal.SIGTERM
    assert reached == ["the end of what is inside"]
    with interrupts.shielded():
        pass


def test_a_second_signal_does_not_wait_for_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_raised", [])

    def stuck() -> None:
        with interrupts.shielded(interrupts.PATIENCE):
            interrupts._handle(signal.SIGTERM, None)
            with pytest.raises(interrupts.Interrupted):
                interrupts._handle(signal.SIGINT, None)

    stuck()  # and nothing is left over for its end
