"""`lagcli simulate`: a run, its table, its figure and its account."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import pathlib
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli import pipeline, settings
from lagcli.cli import console, exits, machine, signals
from lagcli.digits import estimate
from lagcli.export import aside, checkpoint_file, columns, endings, tables, thinned
from lagcli.integrate import checkpoint, driver
from lagcli.model import Model, Simulation
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
    checkpoint: str | None = None
    resume: str | None = None
    limit: float = settings.LIMIT
    digits: bool = False

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
        if self.digits and self.resume is not None:
            raise exits.UsageError(f"--digits with --resume: {estimate.NOT_RESUMED}")
        try:
            if self.file is not None:
                endings.of(pathlib.Path(self.file), endings.TABLES)
            if self.plot is not None:
                endings.of(pathlib.Path(self.plot), endings.FIGURES)
        except endings.UnknownFormat as error:
            raise exits.UsageError(str(error)) from None
        for option, name, instead in (
            ("--stats", self.stats, "; --json prints the account"),
            ("--checkpoint", self.checkpoint, ""),
            ("--resume", self.resume, ""),
        ):
            if name == "-":
                raise exits.UsageError(f"{option}: a file name is needed{instead}")
        taken = {} if model == "-" else {os.path.realpath(model): "MODEL"}
        for option, name in self._files():
            other = taken.setdefault(os.path.realpath(name), option)
            # A run may go on in the checkpoint it came from.
            if other != option and (other, option) != ("--checkpoint", "--resume"):
                raise exits.UsageError(f"{option} {name}: that is the file of {other}")
            if option != "--resume":
                exits.check_writable(name)

    def _files(self) -> Iterator[tuple[str, str]]:
        for option, name in (
            ("--output", self.file),
            ("--plot", self.plot),
            ("--stats", self.stats),
            ("--checkpoint", self.checkpoint),
            ("--resume", self.resume),
        ):
            if name is not None:
                yield option, name


def ready(model: Model, chosen: Simulation, wishes: Wishes) -> pipeline.Running:
    """The run, from its start or from a checkpoint. Raises `exits.UsageError`, `diagnostics.ModelError`."""
    try:
        return pipeline.running(model, chosen, wishes.resume, wishes.limit, wishes.digits)
    except checkpoint.CheckpointError as error:
        raise exits.UsageError(f"--resume {error}") from None
    except FileNotFoundError:
        raise exits.UsageError(f"--resume: there is no file {wishes.resume}") from None
    except OSError as error:
        raise exits.UsageError(f"--resume: cannot read {wishes.resume}: {error.strerror}") from None


def run(ready: pipeline.Running, wishes: Wishes) -> None:
    """Integrate and write. Raises `exits.Exit` with 3 where the run stopped before its end."""
    picked = _picked(ready.columns, wishes, ready.by_name)
    for warning in () if wishes.quiet else ready.warnings:
        exits.say(warning.render())
    _tell_start(ready, wishes)
    kept = thinned.Thinned()
    with signals.unwinding():
        stopped = _write_rows(ready, wishes, picked, kept)
        try:
            _finish(ready, wishes, kept)
            signals.check()
        except signals.Interrupted:
            _tell_complete(wishes)
            raise
    if not wishes.quiet:
        for note in ready.notes:
            exits.say(f"note: {note}")
        _tell_account(ready.stats, stopped is None)
    if stopped is not None:
        exits.say(f"lagcli: {stopped.stop.reason}")
        raise exits.Exit(exits.STOPPED)


def _picked(names: tuple[str, ...], wishes: Wishes, by_name: tuple[str, ...] = ()) -> list[int]:
    try:
        if wishes.columns is None:
            return list(range(len(names)))
        return columns.select(names, wishes.columns, by_name)
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
    if ready.passed_over:
        exits.say(
            f"note: {ready.passed_over} rows are passed over: they stand before the state in {wishes.resume}"
            " and were not asked for in the run before"
        )
    if wishes.verbose:
        chosen = ready.model.simulation
        exits.say(
            f"compiled in {ready.stats.compile_seconds:.3f} s; {ready.grid.count} rows of"
            f" {len(ready.columns)} columns from t = {ready.grid.start:g} to {ready.grid.end:g};"
            f" rtol {chosen.rtol:g}, atol {chosen.atol:g}"
        )


def _write_rows(
    ready: pipeline.Running, wishes: Wishes, picked: list[int], kept: thinned.Thinned
) -> driver.Stopped | None:
    """Pass the blocks on as they come; the reason if the run stopped before its end.

    A checkpoint is taken when the rows before it have been written, so that they agree.
    """
    everything = (*ready.columns, *ready.by_name)
    names = [everything[i] for i in picked]
    keeper = checkpoint_file.Keeper(wishes.checkpoint) if wishes.checkpoint is not None else None
    over, complete = False, False
    with _sink(wishes, names) as sink:

        def take(block: Floats) -> None:
            if sink is not None:
                sink.write(ready.taken(block, picked))
            if wishes.plot is not None:
                kept.add(block)
            if keeper is not None:
                with exits.writing(wishes.checkpoint or ""):
                    keeper.take(ready.checkpoint())

        try:
            stopped = _stream(ready, wishes, take)
            with signals.shielded():
                over = True
                if sink is not None:
                    sink.commit()
                complete = True
                _keep_checkpoint(keeper, wishes)
        except signals.Interrupted:
            with signals.shielded():
                if complete:
                    _tell_complete(wishes)
                elif sink is not None and wishes.file is not None and not over:
                    _keep_partial(sink)
                if not over:
                    _keep_checkpoint(keeper, wishes)
            raise
    return stopped


def _stream(ready: pipeline.Running, wishes: Wishes, take: Callable[[Floats], None]) -> driver.Stopped | None:
    """Run, and hand over each block; the reason if the run stopped before its end."""
    try:
        with _progress(ready, wishes) as bar:
            for block in ready.blocks():
                signals.check()
                with signals.shielded(signals.PATIENCE):
                    take(block)
                bar.at(ready.t)
    except driver.Stopped as stop:
        return stop
    return None


def _keep_checkpoint(keeper: checkpoint_file.Keeper | None, wishes: Wishes) -> None:
    if keeper is None:
        return
    with exits.writing(wishes.checkpoint or ""):
        keeper.write()


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
    with exits.writing(wishes.file or "standard output"), contextlib.ExitStack() as stack:
        # An interrupt finds a sink that will be discarded, or none: no file stays behind.
        with signals.shielded(signals.PATIENCE):
            try:
                sink = stack.enter_context(tables.open_sink(target, names))
            except tables.MissingExtra as error:
                raise exits.UsageError(str(error)) from None
        yield sink


def _tell_complete(wishes: Wishes) -> None:
    if wishes.file is not None:
        exits.say(f"lagcli: interrupted; {wishes.file} is complete")


def _keep_partial(sink: tables.Sink) -> None:
    path = sink.keep_partial()
    exits.say(f"lagcli: interrupted; the complete rows are in {path}")


def _finish(ready: pipeline.Running, wishes: Wishes, kept: thinned.Thinned) -> None:
    """The figure and the account."""
    account = ready.stats.as_json()
    rows = kept.rows()
    if wishes.plot is not None and len(rows):
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.export import figure

        title = ready.model.title or pathlib.Path(ready.model.path).stem
        with exits.writing(wishes.plot):
            figure.draw(
                pathlib.Path(wishes.plot),
                ready.columns,
                rows,
                title=title,
                units=ready.model.units,
                indeterminate=ready.stats.indeterminate,
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
    if stats.accuracy is not None and stats.accuracy.sentence:
        exits.say(f"digits: {stats.accuracy.sentence}")
