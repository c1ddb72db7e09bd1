"""`lagcli simulate`: a run, its table, its figure and its account."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import pathlib
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli import pipeline
from lagcli.cli import console, exits, machine, signals
from lagcli.export import aside, columns, endings, tables
from lagcli.integrate import driver
from lagcli.trajectory import Stats

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class Wishes:
    """What the command line asks for besides the settings of the run."""

    output: str | None
    plot: str | None
    stats: str | None
    columns: str | None
    as_json: bool
    quiet: bool
    verbose: bool

    @property
    def to_stdout(self) -> bool:
        """Whether the table goes to standard output."""
        return self.output == "-" or (self.output is None and self.plot is None)

    @property
    def file(self) -> str | None:
        """The file of the table, if it goes to one."""
        return None if self.output == "-" else self.output

    def check(self, model: str) -> None:
        """Refuse what cannot be written before anything is computed.

        Raises `exits.UsageError`, and `exits.WriteError` for a folder that is missing or closed.
        """
        try:
            if self.file is not None:
                endings.of(pathlib.Path(self.file), endings.TABLES)
            if self.plot is not None:
                endings.of(pathlib.Path(self.plot), endings.FIGURES)
        except endings.UnknownFormat as error:
            raise exits.UsageError(str(error)) from None
        if self.stats == "-":
            raise exits.UsageError("--stats: a file name is needed; --json prints the account")
        taken = {} if model == "-" else {os.path.realpath(model): "MODEL"}
        for option, name in (("--output", self.file), ("--plot", self.plot), ("--stats", self.stats)):
            if name is None:
                continue
            other = taken.setdefault(os.path.realpath(name), option)
            if other != option:
                raise exits.UsageError(f"{option} {name}: that is the file of {other}")
            exits.check_writable(name)


def run(ready: pipeline.Running, wishes: Wishes) -> None:
    """Integrate and write. Raises `exits.Exit` with 3 where the run stopped before its end."""
    picked = _picked(ready.columns, wishes)
    for warning in () if wishes.quiet else ready.warnings:
        exits.say(warning.render())
    _tell_start(ready, wishes)
    kept: list[Floats] = []
    stopped = _write_rows(ready, wishes, picked, kept)
    try:
        _finish(ready, wishes, kept)
    except signals.Interrupted:
        if wishes.file is not None:
            exits.say(f"lagcli: interrupted; {wishes.file} is complete")
        raise
    if not wishes.quiet:
        _tell_account(ready.stats, stopped is None)
    if stopped is not None:
        exits.say(f"lagcli: {stopped.stop.reason}")
        raise exits.Exit(exits.STOPPED)


def _picked(names: tuple[str, ...], wishes: Wishes) -> list[int]:
    try:
        return list(range(len(names))) if wishes.columns is None else columns.select(names, wishes.columns)
    except columns.UnknownColumn as error:
        raise exits.UsageError(f"--columns: {error}") from None


def _tell_start(ready: pipeline.Running, wishes: Wishes) -> None:
    if wishes.quiet:
        return
    if ready.assembly is not None:
        units = ready.model.units
        exits.say(
            f"assembled: moved by {ready.assembly.moved:.6g} sqrt({units.mass}) {units.length}, velocities by"
            f" {ready.assembly.moved_velocity:.6g} sqrt({units.mass}) {units.length}/{units.time}"
            " (mass-weighted norm)"
        )
    if wishes.verbose:
        chosen = ready.model.simulation
        exits.say(
            f"compiled in {ready.stats.compile_seconds:.3f} s; {ready.grid.count} rows of"
            f" {len(ready.columns)} columns from t = {ready.grid.start:g} to {ready.grid.end:g};"
            f" rtol {chosen.rtol:g}, atol {chosen.atol:g}"
        )


def _write_rows(
    ready: pipeline.Running, wishes: Wishes, picked: list[int], kept: list[Floats]
) -> driver.Stopped | None:
    """Pass the blocks on as they come; the reason if the run stopped before its end."""
    names = [ready.columns[i] for i in picked]
    stopped = None
    with _sink(wishes, names) as sink:
        try:
            with _progress(ready, wishes) as bar:
                for block in ready.blocks():
                    with signals.shielded():
                        if sink is not None:
                            sink.write(block[:, picked])
                        if wishes.plot is not None:
                            kept.append(block)
                    bar.at(ready.t)
        except driver.Stopped as stop:
            stopped = stop
        except signals.Interrupted:
            if sink is not None and wishes.file is not None:
                _keep_partial(sink)
            raise
        with signals.shielded():
            if sink is not None:
                sink.commit()
    return stopped


def _progress(ready: pipeline.Running, wishes: Wishes) -> contextlib.AbstractContextManager[console.Progress]:
    # Rows and a bar on one terminal would overwrite each other.
    silent = wishes.quiet or (wishes.to_stdout and sys.stdout.isatty())
    return console.progress(ready.grid.start, ready.grid.end, silent)


@contextlib.contextmanager
def _sink(wishes: Wishes, names: list[str]) -> Iterator[tables.Sink | None]:
    """The sink of the table; trouble with it is told with its name."""
    if wishes.file is None and not wishes.to_stdout:
        yield None
        return
    target = sys.stdout.buffer if wishes.file is None else pathlib.Path(wishes.file)
    with exits.writing(wishes.file or "standard output"):
        try:
            sink = tables.open_sink(target, names)
        except tables.MissingExtra as error:
            raise exits.UsageError(str(error)) from None
        with sink:
            yield sink


def _keep_partial(sink: tables.Sink) -> None:
    with signals.shielded():
        path = sink.keep_partial()
        exits.say(f"lagcli: interrupted; the complete rows are in {path}")


def _finish(ready: pipeline.Running, wishes: Wishes, kept: list[Floats]) -> None:
    """The figure and the account."""
    account = ready.stats.as_json()
    if wishes.plot is not None and kept:
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.export import figure

        title = ready.model.title or pathlib.Path(ready.model.path).stem
        with exits.writing(wishes.plot):
            figure.draw(
                pathlib.Path(wishes.plot),
                ready.columns,
                np.concatenate(kept),
                title=title,
                units=ready.model.units,
            )
    if wishes.stats is not None:
        with exits.writing(wishes.stats):
            _write_json(wishes.stats, account)
    if wishes.as_json and not wishes.to_stdout:
        print(machine.text(account))


def _write_json(path: str, value: dict[str, Any]) -> None:
    file = aside.Aside(pathlib.Path(path))
    try:
        text = json.dumps(value, indent=2, allow_nan=False)
        file.path.write_text(text + "\n", encoding="utf-8")
    except BaseException:
        file.discard()
        raise
    file.commit()


def _tell_account(stats: Stats, complete: bool) -> None:
    head = "done" if complete else "stopped"
    exits.say(
        f"{head}: {stats.steps} steps ({stats.rejected} rejected) of {stats.method} in {stats.solve_seconds:.3g} s;"
        f" drift {stats.position_drift:.1e} in position, {stats.velocity_drift:.1e} in velocity;"
        f" energy balance to {stats.energy_imbalance:.1e} of the energy exchanged"
    )
