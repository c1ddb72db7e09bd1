"""All checks of a record, in the order in which they are told."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lagcli.auditing import one_sided
from lagcli.auditing.checks import (
    checks_motion,
    checks_outputs,
    checks_pointwise,
    checks_steps,
    hamilton,
    momenta,
    uniqueness_text,
)
from lagcli.auditing.checks.audit_report import Audit, Check, CheckedLaw, judge
from lagcli.auditing.evidence import incident_record, table_input
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import Estimate
from lagcli.auditing.evidence.incident_record import EventTable
from lagcli.auditing.evidence.laws import ModelLaws, start
from lagcli.auditing.evidence.table_input import Record
from lagcli.auditing.evidence.tolerances import RESOLVED, Evidence, Tolerance
from lagcli.model import model as nouns

NUMBERS = CheckedLaw("numbers", "", "every entry is a finite number")


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class AuditedTable:
    """Columns with their rows (T, len(columns)); unread: further columns, which are not at hand; events: the incidents
    of the run, where they are."""

    columns: Sequence[str]
    rows: Array
    unread: Sequence[str] = ()
    events: EventTable | None = None


def audit(model: nouns.Model, table: AuditedTable, tolerance: Tolerance, notes: Sequence[str] = ()) -> Audit:
    """The second opinion on the table of a model run to a tolerance.

    Raises `table_input.TableError` where columns are missing or times do not increase.
    """
    columns, rows, events = table.columns, table.rows, table.events
    laws = _laws(model, tolerance)
    is_smooth = not (model.inequality or model.events)
    incidents = incident_record.read(laws, events) if events is not None else None
    known = set(table_input.wanted(laws, columns))
    unread = (*(name for name in columns if name not in known), *table.unread)
    found = table_input.read(laws, columns, rows, repeats=not is_smooth)
    numbers = _numbers(laws, found)
    checks = [numbers]
    sentences: tuple[str, ...] = ()
    figures: tuple[tuple[str, float], ...] = ()
    if numbers.verdict != "fail":
        with np.errstate(all="ignore"):
            e = Evidence(laws, found, tolerance)
            if model.inequality or np.any(np.diff(found.t) == 0):
                judged = one_sided.OneSidedAudit(e, incidents).examined(columns, rows)
                more, sentences, figures, said = judged
                notes = (*notes, *said)
            else:
                more, sentences, figures = _examined(e, columns, rows)
        checks += more
    return Audit(
        title=model.title,
        path=model.path,
        rows=len(found.t),
        start=float(found.t[0]),
        end=float(found.t[-1]),
        rtol=tolerance.rtol,
        atol=tolerance.atol,
        checks=tuple(checks),
        sentences=sentences,
        notes=(*notes, *_elsewhere(model, found, tolerance)),
        figures=figures,
        unread=unread,
    )


def wanted(model: nouns.Model, columns: Sequence[str]) -> tuple[str, ...]:
    """The columns that an audit reads of those of a table. Raises `table_input.TableError` with what is missing."""
    return table_input.wanted(_laws(model), columns)


def _laws(model: nouns.Model, tolerance: Tolerance | None = None) -> ModelLaws:
    """The laws of a model with all its inequalities as rows."""
    count = sum(law.members.count for law in model.inequality)
    return ModelLaws(model, tolerance.jumps if tolerance else {}, range(count))


def _examined(
    e: Evidence, columns: Sequence[str], rows: Array
) -> tuple[list[Check], tuple[str, ...], tuple[tuple[str, float], ...]]:
    stepped = checks_steps.steps(e)  # the first: what it finds hidden, no sum of rows holds
    moved, found = checks_motion.RecordedMotion(e), checks_motion.energies(e)
    stretches = hamilton.windows(e)
    checks = [
        *checks_pointwise.constraints(e),
        stepped,
        checks_motion.rates(e),
        checks_motion.path(e),
        moved.newton(),
        checks_motion.impulse(e),
        *checks_pointwise.reactions(e),
        *checks_pointwise.demand(e),
        *checks_pointwise.ideal(e),
        *checks_pointwise.carried(e),
        moved.dalembert(),
        checks_motion.energy(e, found),
        hamilton.hamilton(e, stretches),
        momenta.momenta(e),
    ]
    acted = hamilton.action(e, stretches)
    if acted is not None:
        checks.insert(-1, acted)
    checks.append(checks_outputs.columns(e, columns, rows, (found.E, found.E_moved)))
    d = e.displacements
    virtual = np.abs(d.virtual(e.record.R_q[e.looked_at]))[~d.is_singular]
    figures = (
        ("virtual_work", float(virtual.max(initial=0.0))),
        ("work_of_constraints", _known(found.work, 1)),
        ("work_of_all_that_changes_the_energy", _known(found.work, 0)),
        ("energy_gained", float(found.E[-1] - found.E[0])),
    )
    return checks, uniqueness_text.sentences(e), figures


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
    """A table that begins at another place than the model says is that of another run, or of another model."""
    t, q, v = start(model)
    if found.t[0] != t or model.simulation.assemble:
        return []
    apart = np.abs(np.concatenate([found.q[0] - q, found.v[0] - v]))
    size = np.abs(np.concatenate([q, v])).max(initial=0.0)
    if not (apart > 1e3 * tolerance.rtol * size + 1e3 * tolerance.atol).any():
        return []
    names = (*model.coordinate_names, *(f"the rate of {name}" for name in model.coordinate_names))
    worst = int(np.argmax(apart))
    return [
        f"the table begins at another place than the model says ({names[worst]} is off by {apart[worst]:.3g}): it is of"
        " another start, or of another model"
    ]
