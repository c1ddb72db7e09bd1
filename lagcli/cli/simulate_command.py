"""`lagcli simulate`: a run, its table, its figure and its account."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import pathlib
import signal
import sys
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lagcli.api import prepare_run
from lagcli.api.simulation_run import SimulationRun
from lagcli.cli import console, exits, json_output, signals, table_output
from lagcli.cli.preflight import SimulateOptions
from lagcli.equations import rows as row_lengths
from lagcli.model.model import Model, Simulation
from lagcli.output import atomic_file, column_choice, trajectory
from lagcli.output.figures import decimate
from lagcli.output.trajectory import Outcome, Stats, Stopped
from lagcli.simulation import checkpoint, run_stop, step_tolerance
from lagcli.start import assembly_moves

Floats = npt.NDArray[np.float64]


def ready(model: Model, chosen: Simulation, options: SimulateOptions) -> SimulationRun:
    """The run, from its start or from a checkpoint. Raises `exits.UsageError`, `diagnostics.ModelError`."""
    try:
        return prepare_run.prepare(
            model, chosen, options.resume, options.limit, options.digits, may_be_over=True
        )
    except checkpoint.CheckpointError as error:
        raise exits.UsageError(f"--resume {error}") from None
    except FileNotFoundError:
        raise exits.UsageError(f"--resume: there is no file {options.resume}") from None
    except OSError as error:
        raise exits.UsageError(f"--resume: cannot read {options.resume}: {error.strerror}") from None


def run(ready: SimulationRun, options: SimulateOptions) -> None:
    """Integrate and write. Raises `exits.Exit` with 3 where the run stopped before its end."""
    picked = _picked(ready.columns, options, ready.by_name)
    everything = (*ready.columns, *ready.by_name)
    names = [everything[i] for i in picked]
    first = table_output.before(ready, options.resume, options.file, names)
    if first is None:
        _require_rows_left(ready, options)
        table_output.require_kept(ready, options.resume, options.file)
    for warning in () if options.quiet else ready.warnings:
        exits.say(warning.render())
    _tell_start(ready, options, first)
    kept = decimate.Thinned()
    signals.leave()
    outcome = dataclasses.replace(ready.outcome)  # of the rows that have been written
    with signals.unwinding():
        try:
            with table_output.opened(ready, options.file, options.to_stdout, names) as written:
                if options.checkpoint is not None:
                    written.keep_checkpoints(options.checkpoint, names, ready.grid.step, first)
                if first is not None:
                    is_whole = options.plot is not None and names == list(ready.columns)
                    written.begin(first, names, kept.add if is_whole else lambda block: None)
                stopped = _write_rows(ready, options, picked, written, kept, outcome)
        except (signals.Interrupted, exits.WriteError, OSError) as error:
            _account_of_ended(ready, options, outcome, error)
            raise
        _write_account(options, ready.stats)
        _draw(ready, options, kept)
        signals.check()
    if not options.quiet:
        for note in ready.notes:
            exits.say(f"note: {note}")
        _tell_account(ready.stats, step_tolerance.sentence(ready.model.simulation), stopped is None)
    if stopped is not None:
        exits.say(f"lagcli: {stopped.stop.reason}")
        raise exits.Exit(exits.STOPPED)


def _require_rows_left(ready: SimulationRun, options: SimulateOptions) -> None:
    try:
        ready.require_rows_left()
    except checkpoint.CheckpointError as error:
        raise exits.UsageError(f"--resume {options.resume}: {error}") from None


def _picked(names: tuple[str, ...], options: SimulateOptions, by_name: tuple[str, ...] = ()) -> list[int]:
    try:
        if options.columns is None:
            return list(range(len(names)))
        return column_choice.select(names, options.columns, by_name)
    except column_choice.UnknownColumn as error:
        raise exits.UsageError(f"--columns: {error}") from None


def _tell_start(ready: SimulationRun, options: SimulateOptions, first: table_output.Before | None) -> None:
    if options.quiet:
        return
    if first is not None:
        exits.say(f"note: {options.file} begins {first.sentence}")
    elif lost := table_output.elsewhere(ready, options.resume):
        exits.say(f"note: {lost}")
    if ready.assembly is not None:
        exits.say_all(assembly_moves.moves(ready.model, ready.assembly).lines(ready.model.units))
    if ready.passed_over:
        exits.say(
            f"note: {ready.passed_over} rows are skipped: they are from before the state in {options.resume}"
            " and were not asked for in the run before"
        )
    if options.verbose:
        chosen = ready.model.simulation
        exits.say(
            f"compiled in {ready.stats.compile_seconds:.3f} s; {ready.grid.count} rows of"
            f" {len(ready.columns)} columns from t = {ready.grid.start:g} to {ready.grid.end:g};"
            f" {step_tolerance.sentence(chosen)}"
        )


def _write_rows(
    ready: SimulationRun,
    options: SimulateOptions,
    picked: list[int],
    written: table_output.TableOutput,
    kept: decimate.Thinned,
    outcome: Outcome,
) -> run_stop.RunStop | None:
    """Pass the blocks on as they come; the reason if the run stopped before its end.

    A checkpoint is taken when the rows before it have been written, so that they agree.
    """
    stopped: run_stop.RunStop | None = None
    try:
        with _progress(ready, options) as bar:
            for block in _blocks(ready, bar):
                point = ready.checkpoint() if options.checkpoint is not None else None
                written.take(block, ready.taken(block, picked), point)
                outcome.rows, outcome.t_end = ready.outcome.rows, ready.outcome.t_end
                if options.plot is not None:
                    kept.add(block)
    except run_stop.RunStop as stop:
        stopped = stop
    except signals.Interrupted:
        if written.t_end == ready.grid.end:
            written.complete()
        elif (partial := written.keep()) is not None:
            exits.say(f"lagcli: interrupted; the complete rows are in {partial}")
        raise
    if stopped is None:
        written.complete()
    elif (partial := written.keep()) is not None:
        signals.leave(f"lagcli: interrupted; the complete rows are in {partial}")
        exits.say(f"lagcli: the complete rows are in {partial}")
    return stopped


def _blocks(ready: SimulationRun, bar: console.Progress) -> Iterator[Floats]:
    """The blocks of a run; an interrupt breaks off only what computes them."""
    blocks = ready.blocks()
    while True:
        with signals.window():
            bar.at(ready.t)
            block = next(blocks, None)
        if block is None:
            return
        yield block


def _progress(
    ready: SimulationRun, options: SimulateOptions
) -> contextlib.AbstractContextManager[console.Progress]:
    # Rows and a bar on one terminal would overwrite each other.
    silent = options.quiet or (options.to_stdout and sys.stdout.isatty())
    return console.progress(ready.grid.start, ready.grid.end, silent)


def _account_of_ended(
    ready: SimulationRun, options: SimulateOptions, outcome: Outcome, error: BaseException
) -> None:
    """The account of the rows that are kept of a run that this has ended; what fails here does not hide it."""
    reason, code = str(error), trajectory.NOT_WRITTEN
    if isinstance(error, signals.Interrupted):
        reason, code = f"interrupted by {signal.Signals(error.number).name}", trajectory.INTERRUPTED
    elif isinstance(error, BrokenPipeError):
        reason = "the reader of the rows went away"
    if code == trajectory.NOT_WRITTEN and not options.to_stdout:
        outcome = Outcome()  # the file is as it was
    outcome.stopped = ready.outcome.stopped
    if outcome.stopped is None and outcome.t_end != ready.grid.end:
        outcome.stopped = Stopped(ready.t, reason, code)
    account = dataclasses.replace(
        ready.stats, stopped=outcome.stopped, rows=outcome.rows, t_end=outcome.t_end
    )
    try:
        _write_account(options, account)
    except (exits.WriteError, OSError) as error:
        exits.say(f"lagcli: {error}")
    except signals.Interrupted:
        pass  # a later signal; the caller raises the first


def _write_account(options: SimulateOptions, stats: Stats) -> None:
    """Write what `--stats` and `--json` ask for. A signal waits for it, but not long for a reader who takes nothing."""
    account = stats.as_json()
    with signals.shielded(signals.PATIENCE):
        if options.stats is not None:
            with exits.writing(options.stats):
                _write_json(options.stats, account)
        if options.as_json and not options.to_stdout:
            print(json_output.text(account), flush=True)


def _draw(ready: SimulationRun, options: SimulateOptions, kept: decimate.Thinned) -> None:
    """The figure, where one is asked for."""
    rows = kept.rows()
    if options.plot is not None and len(rows):
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.output.figures import panels

        names, drawn = _drawn(ready.columns, rows, options, ready.by_name)
        title = ready.model.title or pathlib.Path(ready.model.path).stem
        with exits.drawing(options.plot):
            from lagcli.output.figures import figure

            figure.draw(
                pathlib.Path(options.plot),
                names,
                drawn,
                title=title,
                units=ready.model.units,
                facts=panels.PanelFacts(
                    ready.stats.indeterminate,
                    _zeros(ready, rows),
                    row_lengths.lengths(ready.model),
                    len(names) < len(ready.columns),
                ),
            )


def _drawn(
    names: tuple[str, ...], rows: Floats, options: SimulateOptions, by_name: tuple[str, ...]
) -> tuple[tuple[str, ...], Floats]:
    """The columns of the figure: those of multipliers and reactions that `--columns` names, all where it names none."""
    if options.columns is None:
        return names, rows
    everything = (*names, *by_name)
    chosen = [everything[i] for i in _picked(names, options, by_name)]
    # A reaction of a particle is drawn with all its components.
    groups = {
        name.removesuffix(f".{name[-1]}") for name in chosen if name.startswith("R.") and name[-2] == "."
    }
    kept = [
        i
        for i, name in enumerate(names)
        if name in chosen or (name.startswith("R.") and name.rpartition(".")[0] in groups)
    ]
    kept = [i for i in kept if names[i].startswith(("lambda.", "R."))]
    if not kept:
        if not options.quiet:
            exits.say("note: --columns names no multiplier and no reaction; the figure shows all of them")
        return names, rows
    kept = [names.index("t"), *kept]
    return tuple(names[i] for i in kept), rows[:, kept]


def _zeros(ready: SimulationRun, rows: Floats) -> list[str]:
    """The columns that are zero to rounding."""
    floors = ready.floors()
    floors.take(rows)
    return [name for name, is_zero in zip(ready.columns, floors.zeros(), strict=True) if is_zero]


def _write_json(path: str, value: dict[str, object]) -> None:
    file = atomic_file.Aside(pathlib.Path(path))
    with atomic_file.undone_by(file.discard):
        text = json.dumps(value, indent=2, allow_nan=False)
        file.path.write_text(text + "\n", encoding="utf-8")
    file.commit()


def _tell_account(stats: Stats, held_to: str, complete: bool) -> None:
    head = "done" if complete else "stopped"
    balance = "not known: the power of rows or forces oscillates too often within a step"
    if stats.energy_imbalance is not None:
        balance = f"to {stats.energy_imbalance:.1e} of the energy exchanged"
    exits.say(
        f"{head}: {stats.steps} steps ({stats.rejected} rejected) of {stats.method} in {stats.solve_seconds:.3g} s,"
        f" {held_to};"
        f" drift {stats.position_drift:.1e} in position, {stats.velocity_drift:.1e} in velocity;"
        f" energy balance {balance}"
    )
    if stats.accuracy is not None and stats.accuracy.sentence:
        exits.say(f"digits: {stats.accuracy.sentence}")
