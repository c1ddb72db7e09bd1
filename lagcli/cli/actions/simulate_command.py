"""`lagcli simulate`: a run, its table, its figure and its account."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import pathlib
import signal
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.api.runs import prepare_run
from lagcli.api.runs.simulation_run import SimulationRun
from lagcli.cli.files import run_figure, table_output
from lagcli.cli.files.table_plan import TablePlan
from lagcli.cli.requests.asked_run import SimulateOptions
from lagcli.cli.terminal import console, exits, json_output
from lagcli.model.model import Model, Simulation
from lagcli.output import run_account
from lagcli.output.figures import decimate
from lagcli.output.files import atomic_file, interrupts, write_guard
from lagcli.output.run_account import Outcome, Stats, Stopped
from lagcli.output.tables import incident_table
from lagcli.simulation.run_state import checkpoint, run_stop
from lagcli.simulation.scheme import step_tolerance

if TYPE_CHECKING:
    # Most runs go on from no checkpoint.
    from lagcli.cli.files.table_plan import RowsBefore

Floats = npt.NDArray[np.float64]


def ready(model: Model, chosen: Simulation, options: SimulateOptions) -> SimulationRun:
    """The run, from its start or from a checkpoint. Raises `exits.UsageError`, `diagnostics.ModelError`."""
    try:
        prepared = prepare_run.prepare(
            model, chosen, options.resume, options.limit, options.digits, may_be_over=True
        )
    except checkpoint.CheckpointError as error:
        raise exits.UsageError(f"--resume {error}") from None
    except FileNotFoundError:
        raise exits.UsageError(f"--resume: there is no file {options.resume}") from None
    except OSError as error:
        raise exits.UsageError(f"--resume: cannot read {options.resume}: {error.strerror}") from None
    if options.event_rows:
        prepared.add_event_rows()
    return prepared


def from_row(model: Model, begin: str, resume: str | None) -> Model:
    """The model with the start of `--from`. Raises `exits.UsageError`."""
    # Other runs read no tables.
    from lagcli.api.runs import start_row

    if resume is not None:
        raise exits.UsageError("--from with --resume: a run goes on from its checkpoint, and not from a row")
    try:
        return start_row.at(model, begin)
    except FileNotFoundError as error:
        raise exits.UsageError(f"--from: there is no file {error.filename}") from None
    except OSError as error:
        raise exits.UsageError(f"--from: cannot read {begin}: {error.strerror}") from None
    except start_row.REFUSALS as error:
        raise exits.UsageError(f"--from {error}") from None


def run(ready: SimulationRun, options: SimulateOptions) -> None:
    """Integrate and write. Raises `exits.Exit` with 3 where the run stopped before its end."""
    picked = run_figure.picked(ready.columns, options, ready.by_name)
    everything = (*ready.columns, *ready.by_name)
    names = [everything[i] for i in picked]
    begun = _begun(ready, options, names)
    for warning in () if options.quiet else ready.warnings:
        exits.say(warning.render())
    _tell_start(ready, options, begun)
    kept = decimate.DecimatedRows()
    interrupts.leave()
    outcome = dataclasses.replace(ready.outcome)  # of the rows that have been written
    with interrupts.unwinding():
        try:
            with table_output.opened(ready, begun.table, begun.events) as written:
                if options.checkpoint is not None:
                    written.keep_checkpoints(options.checkpoint, begun.rows, begun.incidents)
                is_whole = options.plot is not None and names == list(ready.columns)
                is_drawn = is_whole and begun.rows is not None
                written.begin(begun.rows, begun.incidents, kept if is_drawn else None)
                stopped = _write_rows(ready, options, picked, written, kept, outcome)
        except (interrupts.Interrupted, write_guard.WriteError, OSError) as error:
            _account_of_ended(ready, options, outcome, error)
            raise
        _write_account(options, ready.stats)
        run_figure.draw(ready, options, kept)
        interrupts.check()
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


@dataclasses.dataclass(frozen=True, slots=True)
class _Begun:
    """The tables of a run, and what they begin with of the run before."""

    table: TablePlan | None
    events: TablePlan | None
    rows: RowsBefore | None = None
    incidents: RowsBefore | None = None


def _begun(ready: SimulationRun, options: SimulateOptions, names: list[str]) -> _Begun:
    table, events = table_output.table(ready, options, names), table_output.events(ready, options)
    if ready.resumed is None:
        return _Begun(table, events)
    from lagcli.cli.files import rows_before

    plans = [plan for plan in (table, events) if plan is not None]
    found = {plan.option: rows_before.before(ready, options.resume, plan) for plan in plans}
    if not any(found.values()):
        _require_rows_left(ready, options)
    for plan in plans:
        if found[plan.option] is None:
            rows_before.require_kept(ready, options.resume, plan)
    return _Begun(table, events, found.get("--output"), found.get("--events"))


def _tell_start(ready: SimulationRun, options: SimulateOptions, begun: _Begun) -> None:
    if options.quiet:
        return
    if ready.resumed is not None:
        _tell_rows_before(ready, options, begun)
    if ready.assembly is not None:
        from lagcli.start import assembly_moves

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


def _tell_rows_before(ready: SimulationRun, options: SimulateOptions, begun: _Begun) -> None:
    from lagcli.cli.files import rows_before

    for file, first, lost in (
        (options.file, begun.rows, rows_before.elsewhere(ready, options.resume, "table")),
        (options.events_file, begun.incidents, rows_before.elsewhere(ready, options.resume, "events")),
    ):
        if first is not None:
            exits.say(f"note: {file} begins {first.sentence}")
        elif lost:
            exits.say(f"note: {lost}")
    if begun.rows is not None and begun.incidents is None and (late := run_figure.late_marks(ready, options)):
        exits.say(f"note: {late}")


def _write_rows(
    ready: SimulationRun,
    options: SimulateOptions,
    picked: list[int],
    written: table_output.TableOutput,
    kept: decimate.DecimatedRows,
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
                written.take(block, ready.taken(block, picked), point, ready.incidents)
                outcome.rows, outcome.t_end = ready.outcome.rows, ready.outcome.t_end
                if options.plot is not None:
                    # Jumps are drawn upright.
                    is_merged = options.event_rows
                    kept.add(block if is_merged else incident_table.with_event_rows(block, ready.incidents))
                    kept.marks.extend((incident.t, incident.kind) for incident in ready.incidents)
    except run_stop.RunStop as stop:
        stopped = stop
    except interrupts.Interrupted:
        if written.t_end == ready.end:
            written.complete()
        elif kept_in := written.keep():
            exits.say(f"lagcli: interrupted; {kept_in}")
        raise
    if stopped is None:
        written.complete()
    elif kept_in := written.keep():
        interrupts.leave(f"lagcli: interrupted; {kept_in}")
        exits.say(f"lagcli: {kept_in}")
    return stopped


def _blocks(ready: SimulationRun, bar: console.Progress) -> Iterator[Floats]:
    """The blocks of a run; an interrupt breaks off only what computes them."""
    blocks = ready.blocks()
    while True:
        with interrupts.window():
            bar.at(ready.t)
            block = next(blocks, None)
        if block is None:
            return
        yield block


def _progress(
    ready: SimulationRun, options: SimulateOptions
) -> contextlib.AbstractContextManager[console.Progress]:
    # Rows and a bar on one terminal would overwrite each other.
    silent = options.quiet or (options.is_stdout_taken and sys.stdout.isatty())
    return console.progress(ready.grid.start, ready.grid.end, silent)


def _account_of_ended(
    ready: SimulationRun, options: SimulateOptions, outcome: Outcome, error: BaseException
) -> None:
    """The account of the rows that are kept of a run that this has ended; what fails here does not hide it."""
    reason, code = str(error), run_account.NOT_WRITTEN
    if isinstance(error, interrupts.Interrupted):
        reason, code = f"interrupted by {signal.Signals(error.number).name}", run_account.INTERRUPTED
    elif isinstance(error, BrokenPipeError):
        reason = "the reader of the rows went away"
    if code == run_account.NOT_WRITTEN and not options.to_stdout:
        outcome = Outcome()  # the file is as it was
    outcome.stopped = ready.outcome.stopped
    if outcome.stopped is None and outcome.t_end != ready.end:
        outcome.stopped = Stopped(ready.t, reason, code)
    account = dataclasses.replace(
        ready.stats, stopped=outcome.stopped, rows=outcome.rows, t_end=outcome.t_end
    )
    try:
        _write_account(options, account)
    except (write_guard.WriteError, OSError) as error:
        exits.say(f"lagcli: {error}")
    except interrupts.Interrupted:
        pass  # a later signal; the caller raises the first


def _write_account(options: SimulateOptions, stats: Stats) -> None:
    """Write what `--stats` and `--json` ask for. A signal waits for it, but not long for a reader who takes nothing."""
    account = stats.as_json()
    with interrupts.shielded(interrupts.PATIENCE):
        if options.stats is not None:
            with write_guard.writing(options.stats):
                _write_json(options.stats, account)
        if options.as_json and not options.is_stdout_taken:
            print(json_output.text(account), flush=True)


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
    if happened := _incidents(stats):
        exits.say(f"incidents: {happened}")
    if stats.accuracy is not None and stats.accuracy.sentence:
        exits.say(f"digits: {stats.accuracy.sentence}")


def _incidents(stats: Stats) -> str:
    """The incidents that are counted, and the event that ended the run, or nothing."""
    counted = (
        (stats.impacts, "impact"),
        (stats.accumulations, "accumulation of impacts"),
        (stats.releases, "release"),
    )
    parts = [
        f"{count} {noun}" if count == 1 else f"{count} {_plural(noun)}" for count, noun in counted if count
    ]
    if stats.largest_penetration > 0:
        parts.append(f"largest penetration {stats.largest_penetration:.1e}")
    if stats.ended_by is not None and stats.t_end is not None:
        parts.append(f"ended by the event {stats.ended_by} at t = {stats.t_end:.9g}")
    return ", ".join(parts)


def _plural(noun: str) -> str:
    first, _, rest = noun.partition(" ")
    return f"{first}s {rest}".strip()
