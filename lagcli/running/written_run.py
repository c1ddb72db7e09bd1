"""A run on its way into files: its tables, its figure and its account, as they were asked for."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import math
import pathlib
import signal
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from lagcli.output.files import atomic_file, formats, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest, WriteError
from lagcli.output.tables import incident_table, provenance
from lagcli.running import run_tables
from lagcli.running.run_account import INTERRUPTED, NOT_WRITTEN, Outcome, Stats, Stopped
from lagcli.running.run_request import RunRequest
from lagcli.running.run_tables import RowsBefore, RunTables, TablePlan
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import checkpoint, run_stop
from lagcli.simulation.run_state.statistics import KINDS
from lagcli.simulation.scheme import step_tolerance

if TYPE_CHECKING:
    from lagcli.output.figures.chart import DecimatedRows


LARGE = (
    10**9
)  # bytes of the numbers of a table of which the size is told: a part of a usual disk that is missed


class RunEnding(NamedTuple):
    """The end of a run, whose files are written: its account, remarks on it, the tolerance of its steps in words, a
    sentence on its digits, and why it stopped before its end; the last two may be nothing."""

    stats: Stats
    notes: tuple[str, ...]
    tolerance_text: str
    digits: str
    reason: str


# A step on the way: the time that is reached, something to print, and last the ending.
RunStep: TypeAlias = float | str | RunEnding


class WrittenRun:
    """A run and the files it goes into: iterate `steps` once; all else is data.

    messages: what there is to print before it begins; start, end: the times of its first and last row; is_stdout_taken:
    a table goes to standard output.
    """

    def __init__(self, run: SimulationRun, request: RunRequest) -> None:
        """Raises `BadRequest` for columns and files that cannot be, and where rows of the run before would be lost;
        `WriteError` for a file that another run or sweep is writing."""
        self._run, self._request = run, request
        if request.event_rows:
            run.add_event_rows()
        # Columns that are given by name alone are looked for where columns are named.
        by_name = () if request.columns is None else run.by_name
        self._picked = [i for i, name in enumerate(run.columns) if name not in run.left_out]
        if request.columns is not None:
            from lagcli.output.tables import table_format

            try:
                self._picked = table_format.select(run.columns, request.columns, by_name)
            except table_format.UnknownColumn as error:
                raise BadRequest(f"--columns: {error}") from None
        everything = (*run.columns, *by_name)
        self._names = tuple(everything[i] for i in self._picked)
        self._table: TablePlan | None = None
        if request.file is not None or request.to_stdout:
            self._table = TablePlan(
                "--output", request.file, self._names, {}, run.grid.step, request.event_rows
            )
        self._events = None if request.events is None else _plan_of_events(run, request)
        self._is_over = False  # every file of it is complete
        with request.locked() as locks:
            self._first, self._happened = self._before()
            self._locks = locks.pop_all()
        # Rows of the run before are a part of its account, and of its table where that begins with them.
        self._elsewhere = run.outcome.rows - (0 if self._first is None else self._first.rows.count)
        self._outcome = dataclasses.replace(run.outcome)  # of the rows that have been written
        self._complete_files: Sequence[str] = ()
        self._reason = ""
        self.start, self.end = run.grid.start, run.grid.end
        self.is_stdout_taken = request.is_stdout_taken
        self.messages = () if request.quiet else tuple(self._beginning())

    def _before(self) -> tuple[RowsBefore | None, RowsBefore | None]:
        """The rows and the incidents of the run before, with which the tables of a run that is resumed begin."""
        run, resume = self._run, self._request.resume
        if run.resumed is None or resume is None:
            return None, None
        # Most runs go on from no checkpoint.
        from lagcli.running import rows_before

        plans = [plan for plan in (self._table, self._events) if plan is not None]
        found = {plan.option: rows_before.before(run, resume, plan) for plan in plans}
        if not any(found.values()):
            try:
                run.require_rows_left()
            except checkpoint.CheckpointError as error:
                if reason := rows_before.unfinished(run, self._request, plans):
                    raise BadRequest(f"--resume {resume}: {error}; {reason}") from None
                self._is_over = True
                return None, None
        for plan in plans:
            is_known = found[plan.option] is None and rows_before.record(run, resume, plan) is not None
            if is_known and plan.path.is_file():
                raise BadRequest(
                    f"{plan.option} {plan.file}: that is the table of the run before, and a resumed run has only the"
                    f" {plan.noun} after t = {run.resumed.t_end:.9g}: give another file, or move that one away"
                )
        return found.get("--output"), found.get("--events")

    def _beginning(self) -> Iterator[str]:
        """The lines to be printed before the run begins."""
        run, request, model = self._run, self._request, self._run.model
        for warning in run.warnings:
            yield warning.render()
        if self._is_over:
            files = [name for name in (request.file, request.events_file) if name is not None]
            yield f"note: nothing is left to do: {run_tables.completed(files)}, with all rows of this run"
            return
        if run.resumed is not None and request.resume is not None:
            from lagcli.running import rows_before

            for file, first, noun in (
                (request.file, self._first, "rows"),
                (request.events_file, self._happened, "events"),
            ):
                if first is not None:
                    yield (
                        f"note: {file} begins with the {first.rows.count} {noun} up to t = {first.t_end:.9g} of"
                        f" the run before, from {first.path}"
                    )
                elif lost := rows_before.elsewhere(run.resumed, request.resume, noun):
                    yield f"note: {lost}"
            reported = run.resumed.run_state.reported
            is_drawn = self._first is not None and self._happened is None and request.plot is not None
            if is_drawn and reported.incidents:
                t = max(run.resumed.t_end, reported.last or -math.inf)
                yield (
                    f"note: marks of incidents in {request.plot} begin after t = {t:.9g}: those before are in no file"
                    " that goes on"
                )
        if run.moves is not None:
            yield from run.moves.lines(model.units)
        size = 8 * run.grid.count * len(self._names)
        if self._table is not None and size > LARGE:
            yield (
                f"note: {run.grid.count} rows of {len(self._names)} columns are {size / 10**9:.3g} GB of numbers;"
                " --samples, --output-step and --columns ask for fewer"
            )
        if run.skipped_rows:
            yield (
                f"note: {run.skipped_rows} rows are skipped: they are from before the state in {request.resume}"
                " and were not asked for in the run before"
            )
        if request.verbose:
            yield (
                f"compiled in {run.stats.compile_seconds:.3f} s; {run.grid.count} rows of"
                f" {len(run.columns)} columns from t = {self.start:g} to {self.end:g};"
                f" {step_tolerance.sentence(model.simulation)}"
            )

    def steps(self) -> Iterator[RunStep]:
        """Integrate and write. Interrupts break off only what computes rows.

        Raises `BadRequest`, `WriteError`, `interrupts.Interrupted`; what there is of the run is in order then.
        """
        run, request = self._run, self._request
        if self._is_over:
            self._locks.close()
            return
        decimated: DecimatedRows | None = None
        if request.plot is not None:
            from lagcli.output.figures.chart import DecimatedRows

            decimated = DecimatedRows()
        interrupts.leave()
        with self._locks, interrupts.unwinding():
            try:
                yield from self._tables(decimated)
            except (interrupts.Interrupted, WriteError, OSError) as error:
                failed = self._account_of_ended(error)
                if failed:
                    yield f"lagcli: {failed}"
                if not isinstance(error, interrupts.Interrupted):
                    yield from self._complete()
                raise
            stats = run.stats
            try:
                self._write_account(stats)
                if decimated is not None and request.plot is not None:
                    yield from self._figure(request.plot, decimated)
            except WriteError:
                yield from self._complete()
                raise
            interrupts.check()
        digits = stats.accuracy.sentence if stats.accuracy is not None else ""
        tolerance_text = step_tolerance.sentence(run.model.simulation)
        yield RunEnding(stats, run.notes, tolerance_text, digits, self._reason)

    def _complete(self) -> Iterator[str]:
        """The files that stand in their place, where another one cannot be written."""
        if self._complete_files:
            yield f"lagcli: {run_tables.completed(self._complete_files)}"

    def _tables(self, decimated: DecimatedRows | None) -> Iterator[RunStep]:
        """Write the tables, and keep what is drawn."""
        request = self._request
        whence = provenance.of(self._run.model).as_json()
        with contextlib.ExitStack() as stack, interrupts.shielded():
            rows, events = (
                None if plan is None else stack.enter_context(run_tables.opened_table(plan, whence, first))
                for plan, first in ((self._table, self._first), (self._events, self._happened))
            )
            tables = RunTables(self._run.incident_columns, rows, events, request.checkpoint)
            with atomic_file.undone_by(tables.abandon):
                self._complete_files = tables.complete_files
                is_drawn = self._names == self._run.columns and self._first is not None
                tables.begin(decimated if is_drawn else None)
                try:
                    yield from self._rows(tables, decimated)
                except run_stop.RunStop as stop:
                    self._reason = stop.stop.reason
                    if saved_in := tables.keep():
                        interrupts.leave(f"lagcli: interrupted; {saved_in}")
                        yield f"lagcli: {saved_in}"
                except interrupts.Interrupted:
                    if tables.t_end == self._run.end:
                        tables.complete()
                    elif saved_in := tables.keep():
                        yield f"lagcli: interrupted; {saved_in}"
                    raise
                else:
                    tables.complete(self._run.outcome.rows - self._elsewhere)

    def _rows(self, tables: RunTables, decimated: DecimatedRows | None) -> Iterator[float]:
        """Pass the blocks on as they come. Raises `run_stop.RunStop` where the run stops before its end.

        A checkpoint is taken when the rows before it have been written, so that they agree.
        """
        run, request = self._run, self._request
        blocks = run.blocks()
        while True:
            yield float(run.t)
            with interrupts.window():
                block = next(blocks, None)
            if block is None:
                return
            point = run.checkpoint() if request.checkpoint is not None else None
            tables.take(block, run.taken(block, self._picked), point, run.incidents)
            self._outcome.rows, self._outcome.t_end = run.outcome.rows, run.outcome.t_end
            if decimated is not None:
                # Jumps are drawn upright.
                decimated.add(
                    block if request.event_rows else incident_table.with_event_rows(block, run.incidents)
                )
                decimated.marks.extend((incident.t, incident.kind) for incident in run.incidents)

    def _figure(self, path: str, decimated: DecimatedRows) -> Iterator[str]:
        """Draw the rows, of multipliers and reactions those that are written, and where none is written all.

        Yields what there is to tell; raises `WriteError`.
        """
        run, rows = self._run, decimated.rows()
        if not len(rows):
            yield f"lagcli: there is no row to draw: {path} is not written"
            return
        picked = list(range(len(run.columns)))
        if self._request.columns is not None:
            # A reaction of a particle is drawn with all its components.
            written = [name for name in self._names if name.startswith(("lambda.", "R."))]
            groups = {name[:-2] for name in written if name.startswith("R.") and name[-2] == "."}
            needed = [
                i
                for i, name in enumerate(run.columns)
                if name in written or (name.startswith("R.") and name.rpartition(".")[0] in groups)
            ]
            if needed:
                picked = [run.columns.index("t"), *needed]
            elif not self._request.quiet:
                yield "note: --columns names no multiplier and no reaction; the figure shows all of them"
        with write_guard.drawing(path):
            # matplotlib takes a third of a second to load.
            from lagcli.model import dimension_facts
            from lagcli.output.figures import chart_figure, figure_page, panels

            floors = run.floors()
            floors.take(rows)
            drawn = chart_figure.compose_run(
                tuple(run.columns[i] for i in picked),
                rows[:, picked],
                title=run.model.title or pathlib.Path(run.model.path).stem,
                units=run.model.units,
                facts=panels.PanelFacts(
                    run.stats.indeterminate,
                    list(itertools.compress(run.columns, floors.zeros())),
                    dimension_facts.of(run.model),
                    len(picked) < len(run.columns),
                    decimated.marks,
                ),
            )
            figure_page.write(path, drawn)

    def _account_of_ended(self, error: BaseException) -> str:
        """Write the account of a run that this has ended; what fails here does not hide it, and is returned."""
        run, outcome = self._run, self._outcome
        reason, code = str(error), NOT_WRITTEN
        if isinstance(error, interrupts.Interrupted):
            reason, code = f"interrupted by {signal.Signals(error.number).name}", INTERRUPTED
        elif isinstance(error, BrokenPipeError):
            reason = "the reader of the rows went away"
        if code == NOT_WRITTEN and not self._request.to_stdout and not self._complete_files:
            outcome = Outcome()  # the file is as it was
        outcome.stopped = run.outcome.stopped
        if outcome.stopped is None and outcome.t_end != run.end:
            outcome.stopped = Stopped(run.t, reason, code)
        account = dataclasses.replace(
            run.stats, stopped=outcome.stopped, rows=outcome.rows, t_end=outcome.t_end
        )
        try:
            self._write_account(account)
        except (WriteError, OSError) as failed:
            return str(failed)
        except interrupts.Interrupted:
            pass  # a later signal; the caller raises the first
        return ""

    def _write_account(self, stats: Stats) -> None:
        """Write what `--stats` and `--json` ask for. A signal waits for it, but not long for a reader."""
        request = self._request
        with interrupts.shielded(interrupts.PATIENCE):
            if request.stats is not None:
                with write_guard.writing(request.stats):
                    text = json.dumps(stats.as_json(), indent=2, allow_nan=False)
                    atomic_file.write(pathlib.Path(request.stats), f"{text}\n".encode())
            if request.as_json and not request.is_stdout_taken:
                print(formats.json_line(stats.as_json()), flush=True)


def _plan_of_events(run: SimulationRun, request: RunRequest) -> TablePlan:
    """The table of incidents. Raises `BadRequest` where two of its columns have one name."""
    names, impulse = run.incident_columns.names, incident_table.IMPULSE
    twice = [name for name in names if names.count(name) > 1] if len(set(names)) < len(names) else []
    if twice:
        raise BadRequest(
            f"--events {request.events}: two of its columns would be called `{twice[0]}`: rename the particle or the"
            " constraint"
        )
    multipliers = [name.removeprefix(impulse) for name in names if name.startswith(impulse)]
    words = {"kind": KINDS, "name": [*multipliers, *(event.name for event in run.model.events)]}
    return TablePlan("--events", request.events_file, names, words, noun="events")
