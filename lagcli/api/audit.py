"""`lagcli.audit`: a second opinion on a run, from its table and the model alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Unpack

import numpy as np

from lagcli import progress
from lagcli.api import prepare_run, run_settings
from lagcli.api.load import Path, as_model
from lagcli.api.simulate import simulate
from lagcli.arrays import Floats
from lagcli.auditing import all_checks, rest_audit
from lagcli.auditing.checks.audit_report import Audit
from lagcli.auditing.evidence import table_input, tolerances
from lagcli.equations import system
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings, Simulation
from lagcli.output.tables import incident_table, table_format
from lagcli.output.tables.incident_table import IncidentTable
from lagcli.running import table_columns
from lagcli.running.trajectory import SimulationStopped, Trajectory
from lagcli.simulation import error_estimate
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.scheme import step_tolerance

MOST_AUDITED = 20001  # rows of a run that is made to be audited, where the model asks for fewer


@progress.phase("auditing")
@run_settings.keywords()
def audit(
    model: Model | Path,
    run: Trajectory | Path | None = None,
    *,
    digits: bool = False,
    events: IncidentTable | Path | None = None,
    **settings: Unpack[RunSettings],
) -> Audit:
    """Check a run by its table and the model alone, without the functions that made it.

    `run`: a trajectory, or the file of a table, which may be one of `equilibrium`; without one the model is simulated
    now, with the other options as of `simulate`. `events`: the incidents of that run, `run.events` or the file of
    `simulate --events`; a run that is made here has its own. For a table that is given, `rtol` and `atol` say how well
    it was computed. `passed` says whether no check fails, `checks` has each with its worst entry and limit. Raises
    `ModelError`, `ValueError` for a table that lacks columns and for bad options, `OSError`, `SimulationStopped` for a
    run without a row.
    """

    model = as_model(model)
    chosen = run_settings.chosen(model, settings)
    model = dataclasses.replace(model, simulation=chosen)
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    if isinstance(run, Trajectory):
        columns, rows = run.columns, run.rows
    elif run is not None:
        table_file = table_format.opened(run)
        is_rest = rest_audit.is_table(table_file.columns)
        columns = (rest_audit if is_rest else all_checks).wanted(model, table_file.columns)
        rows, known = table_file.take(columns), set(columns)
        unread = tuple(name for name in table_file.columns if name not in known)
        if is_rest:
            return rest_audit.audit(model, columns, rows, unread)
    else:
        table, notes = _as_far(model, chosen)
        # Rows that stand as close as every second step
        wanted = min(table.stats.steps // 2 + 1, MOST_AUDITED)
        if len(table.rows) < wanted and not notes:
            table, notes = _as_far(model, dataclasses.replace(chosen, samples=wanted, output_step=None))
        columns, rows = table.columns, table.rows
        events = table.events if events is None and model.inequality else events
    if events is not None and not isinstance(events, IncidentTable):
        events = incident_table.read(events)
    tolerance = tolerances.Tolerance(
        chosen.rtol,
        step_tolerance.absolute(chosen, table_columns.size(model, columns, rows)),
        system.row_jumps(model),
    )
    incidents = None
    if events is not None:  # as an audit takes them: it knows nothing of their tables
        numbers = tuple(name for name in events.columns if name not in incident_table.TEXTS)
        incidents = table_input.EventTable(events.kinds, events.names, numbers, events.numbers)
    given = table_input.AuditedTable(columns, rows, unread, incidents)
    found = all_checks.audit(model, given, tolerance, notes)
    found = dataclasses.replace(found, complete=not notes)
    return _with_digits(found, model, columns, rows) if digits else found


def _as_far(model: Model, chosen: Simulation) -> tuple[Trajectory, tuple[str, ...]]:
    """A run as far as it goes, and why it stopped. Raises `SimulationStopped` where it has no row."""
    try:
        return simulate(dataclasses.replace(model, simulation=chosen)), ()
    except SimulationStopped as stopped:
        if not len(stopped.trajectory.rows):
            raise
        return stopped.trajectory, (f"only the rows before it are audited: {stopped.reason}",)


def _with_digits(found: Audit, model: Model, columns: Sequence[str], rows: Floats) -> Audit:
    """An audit with what is known of the error of its rows. Raises `ValueError` where the model does not give such
    rows: they must begin with its start, at equal distances."""
    t = rows[:, list(columns).index("t")]
    if len(t) < 2 or t[0] != model.simulation.start:
        raise ValueError("digits: the table has no rows from the start of the model on")
    step, length = float(t[1] - t[0]), float(t[-1] - t[0])
    is_even = abs(length - step * (len(t) - 1)) <= 1e-9 * length
    rest = {"samples": len(t), "output_step": None} if is_even else {"samples": None, "output_step": step}
    chosen = dataclasses.replace(model.simulation, duration=length, **rest)
    again = prepare_run.start(model, chosen, digits=True)
    at = {name: i for i, name in enumerate(columns)}
    nothing = np.full(len(rows), np.nan)
    wanted = again.columns[: -len(error_estimate.COLUMNS)]
    table = np.column_stack([rows[:, at[name]] if name in at else nothing for name in wanted])
    try:
        known = again.of_table(table)
    except run_stop.RunStop as stopped:
        raise ValueError(f"digits: the repeated run {stopped.stop.reason}") from None
    if known is None:
        raise ValueError("digits: the rows of the table are not at equal times")
    sentences = (*found.sentences, known.sentence) if known.sentence else found.sentences
    return dataclasses.replace(found, digits=known.as_json(), sentences=sentences)
