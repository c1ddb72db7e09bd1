"""The audit of the table of a run, and the registry of its checks, in the order in which they are reported."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from lagcli.auditing import audit_lines
from lagcli.auditing.checks import (
    checks_contact,
    checks_flight,
    checks_impact,
    checks_lagrangian,
    checks_motion,
    checks_outputs,
    checks_pointwise,
    checks_steps,
)
from lagcli.auditing.checks.audit_report import Audit, Check, CheckedLaw, judge
from lagcli.auditing.evidence import model_values, table_input, written_digits
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.table_input import AuditedTable, Record
from lagcli.auditing.evidence.tolerances import RESOLVED, Evidence, Tolerance, WholeRun
from lagcli.auditing.evidence.written_digits import WrittenDigits
from lagcli.auditing.one_sided import Findings, OneSidedParts
from lagcli.model import model as nouns

NUMBERS = CheckedLaw("numbers", "", "every entry is a finite number")
FEW_NUMBERS = "the table has too few numbers to tell whether they are rounded"
Runs = Literal["all, by rows", "all, by stretches", "all", "smooth", "one-sided"]
Figures = tuple[tuple[str, float], ...]


CHECKS: tuple[tuple[Findings, Runs], ...] = (
    (checks_contact.contacts, "one-sided"),
    (checks_contact.missed, "one-sided"),
    (checks_impact.impacts, "one-sided"),
    (checks_pointwise.constraints, "all, by rows"),
    (checks_steps.steps, "all, by stretches"),  # before all sums over rows: it finds what rows hide
    (checks_motion.rates, "all, by stretches"),
    (checks_motion.path, "all, by stretches"),
    (checks_motion.newton, "all, by stretches"),
    (checks_motion.impulse, "all, by stretches"),
    (checks_pointwise.reactions, "all, by rows"),
    (checks_pointwise.demand, "all, by rows"),
    (checks_pointwise.ideal, "all, by rows"),
    (checks_pointwise.carried, "all, by stretches"),
    (checks_motion.dalembert, "all, by stretches"),
    (checks_motion.energy, "all, by stretches"),
    (checks_lagrangian.hamilton, "all, by stretches"),
    (checks_lagrangian.action, "smooth"),
    (checks_lagrangian.momenta, "all, by stretches"),
    (checks_flight.flights, "one-sided"),
    (checks_impact.balance, "one-sided"),
    (checks_outputs.columns, "all"),
)
"""The registry: each check is a function of the evidence that gives its findings, none where it has nothing to say, and
its runs. A further one is a function in a file of `checks`, and a line here where it is to be reported.

`all, by rows`: it looks at each row alone, in a run with contacts by the sets of those that are closed. `all, by
stretches`: it looks at rows beside each other, in a run with contacts along each stretch without an incident. `all`,
`smooth`, `one-sided`: it looks at the whole of every run, of one without or of one with contacts or jumps.
"""


def audit(model: nouns.Model, table: AuditedTable, tolerance: Tolerance, notes: Sequence[str] = ()) -> Audit:
    """The second opinion on the table of a model run to a tolerance.

    Raises `table_input.TableError` where columns are missing or times do not increase.
    """
    laws = _laws(model, tolerance)
    is_smooth = not (model.inequality or model.events)
    incidents = None if table.events is None else table_input.incidents(laws, table.events)
    known = set(table_input.wanted(laws, table.columns))
    record = table_input.read(laws, table.columns, table.rows, repeats=not is_smooth)
    if incidents is not None:
        incidents = table_input.at_rows(incidents, record)
    checks = [_numbers(laws, record)]
    judged, written = _Judged([], (), (), ()), [written_digits.ALL, written_digits.ALL]
    short = written

    def judge_by(of_table: Tolerance, of_incidents: Tolerance) -> _Judged:
        with np.errstate(all="ignore"):
            return _judged(Evidence(laws, record, of_table, run=WholeRun(table, incidents, of_incidents)))

    if checks[0].verdict != "fail":
        judged = judge_by(tolerance, tolerance)
        if judged.fails:  # a table and that of its incidents are two files
            short = [_digits(table.columns, table.rows, record.t)]
            short += [
                written_digits.ALL
                if table.events is None
                else _digits(table.events.columns, table.events.rows)
            ]
        told = [digits if digits.is_told else written_digits.ALL for digits in short]
        if any(digits.is_certain for digits in told) or judged.fail_everywhere:
            written = told
        if any(digits.is_short for digits in written):
            judged = judge_by(*(tolerance.by(digits) for digits in written))
        if judged.fail_everywhere and not all(digits.is_told for digits in short):
            judged = judged.unless_rounded(judge_by(*(tolerance.by(digits) for digits in short)))
    return Audit(
        title=model.title,
        path=model.path,
        rows=len(record.t),
        start=float(record.t[0]),
        end=float(record.t[-1]),
        rtol=tolerance.rtol,
        atol=tolerance.atol,
        checks=(*checks, *judged.checks),
        sentences=judged.sentences,
        notes=(*notes, *judged.notes, *_elsewhere(model, record, tolerance)),
        figures=judged.figures,
        written=written[0] if written[0].is_short else None,
        written_events=written[1] if written[1].is_short else None,
        unread=(*(name for name in table.columns if name not in known), *table.unread),
    )


def _digits(columns: Sequence[str], rows: Array, t: Array | None = None) -> WrittenDigits:
    """The digits of the numbers of a table with its times, those of its column t where they are not given."""
    index = list(columns).index("t")
    return written_digits.of(np.delete(rows, index, axis=1), rows[:, index] if t is None else t)


def wanted(model: nouns.Model, columns: Sequence[str]) -> tuple[str, ...]:
    """The columns that an audit reads of those of a table. Raises `table_input.TableError` with what is missing."""
    return table_input.wanted(_laws(model), columns)


def _laws(model: nouns.Model, tolerance: Tolerance | None = None) -> ModelLaws:
    """The laws of a model with all its inequalities as rows."""
    return ModelLaws(model, tolerance.jumps if tolerance else {}, range(len(model.contact_names)))


class _Judged(NamedTuple):
    """The findings by one tolerance."""

    checks: list[Check]
    sentences: tuple[str, ...]
    figures: Figures
    notes: tuple[str, ...]

    @property
    def fails(self) -> bool:
        return any(check.verdict == "fail" for check in self.checks)

    @property
    def fail_everywhere(self) -> bool:
        """True if most rows that a check looks at fail: so they do where they are rounded, but for the first row, which
        may be as it was declared."""
        least = written_digits.PARAMETERS.everywhere
        beyond = (
            [ratio > 1 for _, ratio in check.curve][1:] for check in self.checks if check.verdict == "fail"
        )
        return any(np.mean(rows) >= least for rows in beyond if rows)

    def unless_rounded(self, rounded: _Judged) -> _Judged:
        """The findings, of which those are not judged that fail but would not if the numbers were rounded."""
        right = {check.name for check in rounded.checks if check.verdict != "fail"}
        checks = [
            dataclasses.replace(
                check,
                verdict="not judged",
                worst=None,
                failing=(),
                failures=0,
                judged=0,
                note=FEW_NUMBERS,
                curve=(),
            )
            if check.verdict == "fail" and check.name in right
            else check
            for check in self.checks
        ]
        return self._replace(checks=checks)


def _judged(e: Evidence) -> _Judged:
    """All checks of a run but those of the numbers themselves; of one with contacts or jumps by its parts."""
    is_one_sided = e.laws.model.inequality or np.any(np.diff(e.record.t) == 0)
    parts, checks = OneSidedParts(e) if is_one_sided else None, list[Check]()
    for findings, runs in CHECKS:
        if parts is None:
            checks += findings(e) if runs != "one-sided" else ()
        elif runs in ("all", "one-sided"):
            checks += findings(e)
        elif runs != "smooth" and not parts.are_reported:  # together, where the first of them stands
            checks += parts.by_sets([check for check, where in CHECKS if where == "all, by rows"])
            checks += parts.by_stretches([check for check, where in CHECKS if where == "all, by stretches"])
    energies = e.once(checks_motion.energies)

    def known(column: int) -> float:
        """An integral over a smooth run; no number where rows are too far apart to know three digits of it."""
        work = energies.work
        is_known = parts is None and work.truncation[-1, column] <= RESOLVED * work.value[-1, 2]
        return float(work.value[-1, column]) if is_known else np.nan

    figures: Figures = (
        ("virtual_work", e.virtual_work if parts is None else parts.virtual_work),
        ("work_of_constraints", known(1)),
        ("work_of_all_that_changes_the_energy", known(0)),
        ("energy_gained", float(energies.E[-1] - energies.E[0])),
    )
    if parts is None:
        return _Judged(checks, audit_lines.uniqueness(e), figures, ())
    impact = e.once(checks_impact.impact_evidence)
    if impact is not None:
        figures = (*figures, ("energy_lost_in_impacts", impact.lost))
    return _Judged(checks, parts.sentences, figures, parts.notes)


def _numbers(laws: ModelLaws, record: Record) -> Check:
    """Entries that are no numbers; a multiplier may have none at a pole, which is judged with the others."""
    names = table_input.names(laws)
    # Positions, velocities and reactions, then multipliers
    parts = [(getattr(names, part), getattr(record, part)) for part in ("q", "v", "x", "u", "R_q", "R_x")]
    parts.append((names.lam, np.where(np.isinf(record.lam), np.nan, 0.0)))
    entries = np.concatenate([values for _, values in parts], axis=1)
    residual = np.where(np.isfinite(entries), 0.0, np.nan)
    return judge(NUMBERS, [name for part, _ in parts for name in part], record.t, residual, np.ones((1, 1)))


def _elsewhere(model: nouns.Model, record: Record, tolerance: Tolerance) -> list[str]:
    """A table that begins at another position than the model says is that of another run, or of another model."""
    t, q, v = model_values.start(model)
    if record.t[0] != t or model.simulation.assemble:
        return []
    apart = np.abs(np.concatenate([record.q[0] - q, record.v[0] - v]))
    size = np.abs(np.concatenate([q, v])).max(initial=0.0)
    if not (apart > 1e3 * tolerance.rtol * size + 1e3 * tolerance.atol).any():
        return []
    names = (*model.coordinate_names, *(f"the rate of {name}" for name in model.coordinate_names))
    worst = int(np.argmax(apart))
    return [
        f"the table begins at another position than the model says ({names[worst]} is off by {apart[worst]:.3g}): it is"
        " of another start, or of another model"
    ]
