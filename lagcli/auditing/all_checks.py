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
    checks_motion,
    checks_outputs,
    checks_pointwise,
    checks_steps,
    hamilton,
    momenta,
)
from lagcli.auditing.checks.audit_report import Audit, Check, CheckedLaw, judge
from lagcli.auditing.evidence import model_values, table_input, written_digits
from lagcli.auditing.evidence.differences import Estimate
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


@dataclasses.dataclass(frozen=True, slots=True)
class AuditCheck:
    """A check: a function of the evidence that gives its findings, none where it has nothing to say, and its runs.

    `all, by rows`: it looks at each row alone, in a run with contacts by the sets of those that are closed. `all, by
    stretches`: it looks at rows beside each other, in a run with contacts along each stretch without an incident.
    `all`, `smooth`, `one-sided`: it looks at the whole of every run, of one without or of one with contacts or jumps.
    """

    findings: Findings
    runs: Runs


CHECKS = (
    AuditCheck(checks_contact.contacts, "one-sided"),
    AuditCheck(checks_contact.missed, "one-sided"),
    AuditCheck(checks_impact.impacts, "one-sided"),
    AuditCheck(checks_pointwise.constraints, "all, by rows"),
    AuditCheck(checks_steps.steps, "all, by stretches"),  # before all sums over rows: it finds what rows hide
    AuditCheck(checks_motion.rates, "all, by stretches"),
    AuditCheck(checks_motion.path, "all, by stretches"),
    AuditCheck(checks_motion.newton, "all, by stretches"),
    AuditCheck(checks_motion.impulse, "all, by stretches"),
    AuditCheck(checks_pointwise.reactions, "all, by rows"),
    AuditCheck(checks_pointwise.demand, "all, by rows"),
    AuditCheck(checks_pointwise.ideal, "all, by rows"),
    AuditCheck(checks_pointwise.carried, "all, by stretches"),
    AuditCheck(checks_motion.dalembert, "all, by stretches"),
    AuditCheck(checks_motion.energy, "all, by stretches"),
    AuditCheck(hamilton.check, "all, by stretches"),
    AuditCheck(hamilton.action, "smooth"),
    AuditCheck(momenta.check, "all, by stretches"),
    AuditCheck(checks_flight.flights, "one-sided"),
    AuditCheck(checks_impact.balance, "one-sided"),
    AuditCheck(checks_outputs.columns, "all"),
)
"""The registry: a further check is a function in a file of `checks`, and a line here where it is to be reported."""


def audit(model: nouns.Model, table: AuditedTable, tolerance: Tolerance, notes: Sequence[str] = ()) -> Audit:
    """The second opinion on the table of a model run to a tolerance.

    Raises `table_input.TableError` where columns are missing or times do not increase.
    """
    laws = _laws(model, tolerance)
    is_smooth = not (model.inequality or model.events)
    incidents = None if table.events is None else table_input.incidents(laws, table.events)
    known = set(table_input.wanted(laws, table.columns))
    found = table_input.read(laws, table.columns, table.rows, repeats=not is_smooth)
    if incidents is not None:
        incidents = table_input.at_rows(incidents, found)
    checks = [_numbers(laws, found)]
    judged, written = _Judged([], (), (), ()), [written_digits.ALL, written_digits.ALL]

    def judge_by(of_table: Tolerance, of_incidents: Tolerance) -> _Judged:
        with np.errstate(all="ignore"):
            return _judged(Evidence(laws, found, of_table, run=WholeRun(table, incidents, of_incidents)))

    if checks[0].verdict != "fail":
        judged = judge_by(tolerance, tolerance)
        short = _written(table, found) if judged.fails else written
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
        rows=len(found.t),
        start=float(found.t[0]),
        end=float(found.t[-1]),
        rtol=tolerance.rtol,
        atol=tolerance.atol,
        checks=(*checks, *judged.checks),
        sentences=judged.sentences,
        notes=(*notes, *judged.notes, *_elsewhere(model, found, tolerance)),
        figures=judged.figures,
        written=written[0] if written[0].is_short else None,
        written_events=written[1] if written[1].is_short else None,
        unread=(*(name for name in table.columns if name not in known), *table.unread),
    )


def _written(table: AuditedTable, found: Record) -> list[WrittenDigits]:
    """The digits of the numbers of a table, and of that of its incidents: they are two files."""
    index = list(table.columns).index("t")
    written = written_digits.of(np.delete(table.rows, index, axis=1), found.t)
    if table.events is None:
        return [written, written_digits.ALL]
    index, rows = table.events.columns.index("t"), table.events.rows
    return [written, written_digits.of(np.delete(rows, index, axis=1), rows[:, index])]


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
                curve=(),
                note=FEW_NUMBERS,
            )
            if check.verdict == "fail" and check.name in right
            else check
            for check in self.checks
        ]
        return self._replace(checks=checks)


def _judged(e: Evidence) -> _Judged:
    """All checks of a run but those of the numbers themselves."""
    if e.laws.model.inequality or np.any(np.diff(e.record.t) == 0):
        return _Judged(*_of_one_sided(e))
    return _Judged(*_of_smooth(e), ())


def _of_smooth(e: Evidence) -> tuple[list[Check], tuple[str, ...], Figures]:
    """Checks, sentences and figures of a smooth run."""
    checks = [found for check in CHECKS if check.runs != "one-sided" for found in check.findings(e)]
    d, energies = e.displacements, e.once(checks_motion.energies)
    virtual = np.abs(d.virtual(e.record.R_q[e.looked_at]))[~d.is_singular]
    figures = (
        ("virtual_work", float(virtual.max(initial=0.0))),
        ("work_of_constraints", _known(energies.work, 1)),
        ("work_of_all_that_changes_the_energy", _known(energies.work, 0)),
        ("energy_gained", float(energies.E[-1] - energies.E[0])),
    )
    return checks, audit_lines.uniqueness(e), figures


def _of_one_sided(e: Evidence) -> tuple[list[Check], tuple[str, ...], Figures, tuple[str, ...]]:
    """Checks, sentences, figures and notes of a run with contacts or jumps."""
    parts, checks = OneSidedParts(e), list[Check]()
    by_rows, by_stretches = (
        [check.findings for check in CHECKS if check.runs == runs]
        for runs in ("all, by rows", "all, by stretches")
    )
    for check in CHECKS:
        if (
            check.findings is by_rows[0]
        ):  # those of parts are reported together, where the first of them stands
            checks += [*parts.by_sets(by_rows), *parts.by_stretches(by_stretches)]
        elif check.runs in ("all", "one-sided"):
            checks += check.findings(e)
    E, impact = e.once(checks_motion.energies).E, e.once(checks_impact.impact_evidence)
    figures: Figures = (
        ("virtual_work", parts.virtual_work),
        ("work_of_constraints", np.nan),
        ("work_of_all_that_changes_the_energy", np.nan),
        ("energy_gained", float(E[-1] - E[0])),
    )
    if impact is not None:
        figures = (*figures, ("energy_lost_in_impacts", impact.lost))
    return checks, parts.sentences, figures, parts.notes


def _known(work: Estimate, column: int) -> float:
    """An integral over the whole run; no number where the rows are too far apart to know three digits of it."""
    value, size = float(work.value[-1, column]), float(work.value[-1, 2])
    return value if float(work.truncation[-1, column]) <= RESOLVED * size else np.nan


def _numbers(laws: ModelLaws, found: Record) -> Check:
    """Entries that are no numbers; a multiplier may have none at a pole, which is judged with the others."""
    names = table_input.names(laws)
    parts = [(names.q, found.q), (names.v, found.v), (names.x, found.x), (names.u, found.u)]
    parts += [(names.R_q, found.R_q), (names.R_x, found.R_x)]
    columns = [name for part, _ in parts for name in part]
    entries = np.concatenate([values for _, values in parts], axis=1)
    infinite = np.isinf(found.lam)
    entries = np.concatenate([entries, np.where(infinite, np.nan, 0.0)], axis=1)
    residual = np.where(np.isfinite(entries), 0.0, np.nan)
    return judge(NUMBERS, [*columns, *names.lam], found.t, residual, np.ones((1, 1)))


def _elsewhere(model: nouns.Model, found: Record, tolerance: Tolerance) -> list[str]:
    """A table that begins at another position than the model says is that of another run, or of another model."""
    t, q, v = model_values.start(model)
    if found.t[0] != t or model.simulation.assemble:
        return []
    apart = np.abs(np.concatenate([found.q[0] - q, found.v[0] - v]))
    size = np.abs(np.concatenate([q, v])).max(initial=0.0)
    if not (apart > 1e3 * tolerance.rtol * size + 1e3 * tolerance.atol).any():
        return []
    names = (*model.coordinate_names, *(f"the rate of {name}" for name in model.coordinate_names))
    worst = int(np.argmax(apart))
    return [
        f"the table begins at another position than the model says ({names[worst]} is off by {apart[worst]:.3g}): it is"
        " of another start, or of another model"
    ]
