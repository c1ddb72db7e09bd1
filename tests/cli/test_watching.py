"""`--watch`: a command is run again when its file is another one, and not for anything else."""

import os
import pathlib
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable

import pytest

from lagcli.cli.commands import options
from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics

ROOT = pathlib.Path(__file__).parents[2]


class Over(Exception):
    """The end of a script."""


def scripted(steps: Iterable[Callable[[], object] | None]) -> Callable[[], None]:
    """A pause in which one step after the other happens; after the last one the watch ends."""
    waiting = iter(steps)

    def pause() -> None:
        for step in waiting:
            if step is not None:
                step()
            return
        raise Over

    return pause


@pytest.fixture
def model(tmp_path: pathlib.Path) -> pathlib.Path:
    path = tmp_path / "m.yaml"
    path.write_text("one", encoding="utf-8")
    return path


def runs(model: pathlib.Path, steps: Iterable[Callable[[], object] | None], quiet: bool = True) -> list[str]:
    """The texts that a watched command has read."""
    seen: list[str] = []

    def run() -> None:
        seen.append(model.read_text(encoding="utf-8") if model.exists() else "nothing")

    with pytest.raises(Over):
        options.follow([str(model)], run, quiet, scripted(steps))
    return seen


def write(path: pathlib.Path, text: str) -> Callable[[], object]:
    return lambda: path.write_text(text, encoding="utf-8")


def test_a_file_that_stays_is_read_once(model: pathlib.Path) -> None:
    assert runs(model, [None] * 20) == ["one"]


def test_each_change_is_read(model: pathlib.Path) -> None:
    steps = [None, write(model, "second"), None, None, write(model, "the third"), None, None]
    assert runs(model, steps) == ["one", "second", "the third"]


def test_a_file_put_into_the_place_of_the_old_one_is_read(model: pathlib.Path) -> None:
    """As editors do, also where time and size are those of the old one."""
    other = model.with_name("other")

    def replace() -> None:
        other.write_text("two", encoding="utf-8")
        os.utime(other, ns=(model.stat().st_atime_ns, model.stat().st_mtime_ns))
        os.replace(other, model)

    assert runs(model, [None, replace, None, None]) == ["one", "two"]


def test_a_file_that_is_taken_away_first_is_read_when_it_is_back(model: pathlib.Path) -> None:
    assert runs(model, [model.unlink, write(model, "back"), None, None]) == ["one", "back"]


def test_a_file_that_stays_away_is_reported_and_waited_for(model: pathlib.Path) -> None:
    assert runs(model, [model.unlink, None, None, write(model, "back"), None]) == ["one", "nothing", "back"]


def test_a_change_while_the_command_runs_is_not_lost(model: pathlib.Path) -> None:
    seen: list[str] = []

    def run() -> None:
        seen.append(model.read_text(encoding="utf-8"))
        if len(seen) == 1:
            model.write_text("changed", encoding="utf-8")

    with pytest.raises(Over):
        options.follow([str(model)], run, True, scripted([None, None]))
    assert seen == ["one", "changed"]


def test_what_a_command_may_end_with_does_not_end_the_watch(
    model: pathlib.Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = diagnostics.Location("m.yaml", 1, 1, 1, "one")
    ends: list[Exception] = [
        exits.UsageError("no such thing"),
        diagnostics.ModelError([diagnostics.Diagnostic("unknown-key", "wrong", at)]),
        exits.Exit(exits.STOPPED),
    ]
    left = iter(ends)

    def run() -> None:
        raise next(left)

    steps = [write(model, "2"), None, write(model, "33"), None]
    with pytest.raises(Over):
        options.follow([str(model)], run, False, scripted(steps))
    told = capsys.readouterr().err
    assert "no such thing" in told
    assert "m.yaml:1:1: error[unknown-key]" in told
    assert told.count("watching m.yaml; Ctrl-C ends") == 3


def test_any_of_several_files_counts(model: pathlib.Path) -> None:
    second = model.with_name("second.yaml")
    second.write_text("b", encoding="utf-8")
    count = 0

    def run() -> None:
        nonlocal count
        count += 1

    with pytest.raises(Over):
        options.follow([str(model), str(second)], run, True, scripted([write(second, "cc"), None, None]))
    assert count == 2


def test_standard_input_is_refused() -> None:
    with pytest.raises(exits.UsageError, match="standard input"):
        options.follow(["-"], lambda: None)


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_an_interrupt_ends_with_130_and_nothing_is_lost(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("lagcli: 1\nparticles: {a: {mass: 1, position: [0, 0, 0]}}\n", encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, "-m", "lagcli", "check", str(path), "--watch", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        first = process.stdout.readline()
        assert '"configuration_dof": 3' in first
        path.write_text("lagcli: 1\nparticles: {a: {mass: 0, position: [0, 0, 0]}}\n", encoding="utf-8")
        assert '"mass-not-positive"' in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        told = process.stderr.read()
    assert process.returncode == 130
    assert "\x1b" not in told + first
    assert "Traceback" not in told
