"""`lagcli simulate`: a run, its table, its figure and its account."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import pathlib
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from lagcli import pipeline
from lagcli.cli import console, exits, signals
from lagcli.export import aside, columns, endings, tables
from lagcli.integrate import driver
from lagcli.model import Model, Simulation
from lagcli.trajectory import Stats


@dataclasses.dataclass(frozen=True, slots=True)
class Wishes:
    """What the command line asks for besides the settings of the run."""

    output: str | None
    plot: str | None
    stats: str | None
    columns: str | None
    quiet: bool
    verbose: bool

    def check(self) -> None:
        """Refuse what cannot be written before anything is computed. Raises `exits.UsageError`."""
        try:
            if self.output not in (None, "-"):
                endings.of(pathlib.Path(str(self.output)), endings.TABLES)
            if self.plot is not None:
                endings.of(pathlib.Path(self.plot), endings.FIGURES)
        except endings.UnknownFormat as error:
            raise exits.UsageError(str(error)) from None

    @property
    def table(self) -> Any:
        """Where the table goes: a path, stdout, or None."""
        if self.output == "-" or (self.output is None and self.plot is None):
            return sys.stdout.buffer
        return None if self.output is None else pathlib.Path(self.output)


def run(model: Model, chosen: Simulation, wishes: Wishes) -> None:
    """Integrate and write. Raises `exits.Exit` with 3 where the run stopped before its end."""
    ready = pipeline.Running(model, chosen)
    picked = _picked(ready.columns, wishes)
    for warning in () if wishes.quiet else ready.warnings:
        exits.say(warning.render())
    _tell_start(ready, wishes)
    kept: list[Any] = []
    stopped = _write_rows(ready, wishes, picked, kept)
    _finish(ready, wishes, kept, stopped)
    if stopped is not None:
        exits.say(f"lagcli: {stopped.stop.reason}")
        raise exits.Exit(exits.STOPPED)


def _picked(names: tuple[str, ...], wishes: Wishes) -> list[int]:
    try:
        return list(range(len(names))) if wishes.columns is None else columns.select(names, wishes.columns)
    except columns.UnknownColumn as error:
        raise exits.UsageError(str(error)) from None


def _tell_start(ready: pipeline.Running, wishes: Wishes) -> None:
    if wishes.quiet:
        return
    if ready.assembly is not None:
        units = ready.model.units
        exits.say(
            f"assembled: moved by {ready.assembly.moved:.6g} sqrt({units.mass}) {units.length}, velocities by"
            f" {ready.assembly.moved_velocity:.6g} sqrt({units.mass}) {units.length}/{units.time} (mass-weighted norm)"
        )
    if wishes.verbose:
        stats = ready.stats
        exits.say(
            f"compiled in {stats.compile_seconds:.3f} s; {ready.grid.count} rows of {len(ready.columns)} columns"
        )


def _write_rows(
    ready: pipeline.Running, wishes: Wishes, picked: list[int], kept: list[Any]
) -> driver.Stopped | None:
    """Pass the blocks on as they come; the reason if the run stopped before its end."""
    names = [ready.columns[i] for i in picked]
    with (
        _sink(wishes, names) as sink,
        console.progress(ready.grid.start, ready.grid.end, wishes.quiet) as bar,
    ):
        try:
            for block in ready.blocks():
                with signals.shielded():
                    if sink is not None:
                        sink.write(block[:, picked])
                    if wishes.plot is not None:
                        kept.append(block)
                bar.at(ready.t)
        except driver.Stopped as stopped:
            return stopped
        except signals.Interrupted:
            if sink is not None:
                _keep_partial(sink)
            raise
    return None


@contextlib.contextmanager
def _sink(wishes: Wishes, names: list[str]) -> Iterator[tables.Sink | None]:
    """The sink of the table. Trouble with a file is told as such; a closed pipe stays what it is."""
    if wishes.table is None:
        yield None
        return
    try:
        sink = tables.open_sink(wishes.table, names)
    except tables.MissingExtra as error:
        raise exits.UsageError(str(error)) from None
    with sink:
        yield sink


def _keep_partial(sink: tables.Sink) -> None:
    with signals.shielded():
        path = sink.keep_partial()
    if path is not None:
        exits.say(f"lagcli: interrupted; the complete rows are in {path}")


def _finish(ready: pipeline.Running, wishes: Wishes, kept: list[Any], stopped: driver.Stopped | None) -> None:
    stats = ready.stats
    if wishes.plot is not None and kept:
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.export import figure

        title = ready.model.title or pathlib.Path(ready.model.path).stem
        figure.draw(
            pathlib.Path(wishes.plot),
            ready.columns,
            np.concatenate(kept),
            title=title,
            units=ready.model.units,
        )
    if wishes.stats is not None:
        _write_json(wishes.stats, stats.as_json())
    if not wishes.quiet:
        _tell_account(stats, stopped is None)


def _write_json(path: str, value: dict[str, Any]) -> None:
    file = aside.Aside(pathlib.Path(path))
    try:
        file.path.write_text(json.dumps(value, indent=2) + "\n", encoding="utf-8")
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
