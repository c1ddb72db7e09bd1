"""The audit of the table of a run, and the registry of its checks, in the order in which they are reported.

A run with contacts is taken apart: rows of one set of closed contacts, and stretches of them without an incident.
Within a stretch closed contacts are rows like others, and every check of a smooth motion holds as it is. What jumps
between two stretches is judged by the incidents.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from lagcli.auditing.checks import (
    checks_contact,
    checks_flight,
    checks_impact,
    checks_lagrangian,
    checks_motion,
    checks_pointwise,
    checks_steps,
)
from lagcli.auditing.checks.audit_report import (
    FAR_APART,
    MOST_LISTED,
    Audit,
    Check,
    Law,
    judge,
    merged,
)
from lagcli.auditing.evidence import model_values, table_input
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import HALF
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.table_input import AuditedTable, Record, WrittenDigits
from lagcli.auditing.evidence.tolerances import RESOLVED, Evidence, Tolerance, WholeRun
from lagcli.model import model as nouns

NUMBERS = Law("numbers", "", "every entry is a finite number")
FEW_NUMBERS = "the table has too few numbers to tell whether they are rounded"
MOST = 60  # stretches, the longest ones, that are examined by differences
MOST_MODES = 60  # sets of closed contacts, those with most rows
MOST_DESCRIBED = 3  # sets of closed contacts of which it is reported what is determined
Findings = Callable[[Evidence], Sequence[Check]]
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
    (checks_pointwise.columns, "all"),
)
"""The registry: each check is a function of the evidence that gives its findings, none where it has nothing to say, and
its runs. A further one is a function in a file of `checks`, and a line here where it is to be reported.

`all, by rows`: it looks at each row alone, in a run with contacts by the sets of those that are closed. `all, by
stretches`: it looks at rows beside each other, in a run with contacts along each stretch without an incident. `all`,
`smooth`, `one-sided`: it looks at the whole of every run, of one without or of one with contacts or jumps.
"""


def audit(model: nouns.Model, table: AuditedTable, tolerance: Tolerance, notes: Sequence[str] = ()) -> Audit:
    """The second opinion on the table of a model run to a tolerance. Raises `table_input.TableError` where columns are
    missing or times do not increase."""
    laws = ModelLaws(model, tolerance.jumps)
    is_smooth = not (model.inequality or model.events)
    incidents = None if table.events is None else table_input.incidents(laws, table.events)
    known = set(table_input.wanted(laws, table.columns))
    record = table_input.read(laws, table.columns, table.rows, repeats=not is_smooth)
    if incidents is not None:
        incidents = table_input.at_rows(incidents, record)
    # Entries that are no numbers; a multiplier may have none at a pole, which is judged with the others
    names = table_input.names(laws)
    parts = [(getattr(names, part), getattr(record, part)) for part in ("q", "v", "R")]
    parts.append((names.lam, np.where(np.isinf(record.lam), np.nan, 0.0)))
    entries = np.where(np.isfinite(np.concatenate([values for _, values in parts], axis=1)), 0.0, np.nan)
    of_entries = [name for part, _ in parts for name in part]
    checks = [judge(NUMBERS, of_entries, record.t, entries, np.ones((1, 1)))]
    judged, written = _Judged([], [], []), [table_input.ALL, table_input.ALL]
    short = written

    def judge_by(digits: list[WrittenDigits]) -> _Judged:
        of_table, of_incidents = (tolerance.by(each) for each in digits)
        with np.errstate(all="ignore"):
            return _judged(Evidence(laws, record, of_table, run=WholeRun(table, incidents, of_incidents)))

    if checks[0].verdict != "fail":
        judged = judge_by(written)
        if any(check.verdict == "fail" for check in judged.checks):
            short = [_digits(table.columns, table.rows, record.t), table_input.ALL]
            if table.events is not None:  # two files
                short[1] = _digits(table.events.columns, table.events.rows)
        told = [digits if digits.is_told else table_input.ALL for digits in short]
        if any(digits.is_certain for digits in told) or judged.fail_everywhere:
            written = told
        if any(digits.is_short for digits in written):
            judged = judge_by(written)
        if judged.fail_everywhere and not all(digits.is_told for digits in short):
            # What fails but would not if the numbers were rounded is not judged.
            right = {check.name for check in judge_by(short).checks if check.verdict != "fail"}
            for k, check in enumerate(judged.checks):
                if check.verdict == "fail" and check.name in right:
                    of_law, of_all = (check.name, check.law, check.equation), check.entries
                    judged.checks[k] = Check(*of_law, "not judged", None, entries=of_all, note=FEW_NUMBERS)
    return Audit(
        title=model.title,
        path=model.path,
        rows=len(record.t),
        start=float(record.t[0]),
        end=float(record.t[-1]),
        rtol=tolerance.rtol,
        atol=tolerance.atol,
        checks=(*checks, *judged.checks),
        sentences=tuple(judged.sentences),
        notes=(*notes, *judged.notes, *_elsewhere(model, record, tolerance)),
        figures=judged.figures,
        written=written[0] if written[0].is_short else None,
        written_events=written[1] if written[1].is_short else None,
        unread=(*(name for name in table.columns if name not in known), *table.unread),
    )


def _digits(columns: Sequence[str], rows: Array, t: Array | None = None) -> WrittenDigits:
    """The digits of the numbers of a table with its times, those of its column t where they are not given."""
    index = list(columns).index("t")
    return table_input.digits_of(np.delete(rows, index, axis=1), rows[:, index] if t is None else t)


def wanted(model: nouns.Model, columns: Sequence[str]) -> tuple[str, ...]:
    """The columns that an audit reads of those of a table. Raises `table_input.TableError` with what is missing."""
    return table_input.wanted(ModelLaws(model), columns)


class _Judged(NamedTuple):
    """Findings by one tolerance; virtual_work: the largest of R."""

    checks: list[Check]
    sentences: list[str]
    notes: list[str]
    virtual_work: float = 0.0
    figures: Figures = ()

    @property
    def fail_everywhere(self) -> bool:
        """True if most rows that a check looks at fail: so they do where they are rounded, but for the first row, which
        may be as it was declared."""
        failing = (check for check in self.checks if check.verdict == "fail")
        beyond = ([ratio > 1 for _, ratio in check.curve][1:] for check in failing)
        return any(np.mean(rows) >= HALF for rows in beyond if rows)


def _judged(e: Evidence) -> _Judged:
    """All checks of a run but those of the numbers themselves; of one with contacts or jumps by its parts."""
    is_one_sided = e.laws.model.inequality or np.any(np.diff(e.record.t) == 0)
    parts = _by_parts(e) if is_one_sided else _Judged([], _uniqueness(e), [], e.virtual_work)
    checks, of_parts = list[Check](), parts.checks
    for findings, runs in CHECKS:
        if not is_one_sided:
            checks += findings(e) if runs != "one-sided" else ()
        elif runs in ("all", "one-sided"):
            checks += findings(e)
        elif runs != "smooth":  # together, where the first of them stands
            checks += of_parts
            of_parts = []
    energies = e.once(checks_motion.energies)
    # Integrals over a smooth run, where rows are close enough to know three digits
    work, known = energies.work, [np.nan, np.nan]
    if not is_one_sided:
        is_known = work.truncation[-1] <= RESOLVED * work.value[-1, 2]
        known = [float(work.value[-1, column]) if is_known[column] else np.nan for column in (1, 0)]
    figures: Figures = (
        ("virtual_work", parts.virtual_work),
        ("work_of_constraints", known[0]),
        ("work_of_all_that_changes_the_energy", known[1]),
        ("energy_gained", float(energies.E[-1] - energies.E[0])),
    )
    if is_one_sided and (impact := e.once(checks_impact.impact_evidence)) is not None:
        figures = (*figures, ("energy_lost_in_impacts", impact.lost))
    return parts._replace(checks=checks, figures=figures)


def _elsewhere(model: nouns.Model, record: Record, tolerance: Tolerance) -> list[str]:
    """A table that begins at another position than the model says is that of another run, or of another model."""
    t, q, v = model_values.start(model)
    if record.t[0] != t or model.simulation.assemble:
        return []
    apart = np.abs(np.concatenate([record.q[0, : len(q)] - q, record.v[0, : len(v)] - v]))
    size = np.abs(np.concatenate([q, v])).max(initial=0.0)
    if not (apart > 1e3 * tolerance.rtol * size + 1e3 * tolerance.atol).any():
        return []
    names = (*model.coordinate_names, *(f"the rate of {name}" for name in model.coordinate_names))
    worst = int(np.argmax(apart))
    return [
        f"the table begins at another position than the model says ({names[worst]} is off by {apart[worst]:.3g}): it is"
        " of another start, or of another model"
    ]


def _by_parts(e: Evidence) -> _Judged:
    """A record taken apart; e: of laws with all inequalities closed."""
    states = e.once(checks_contact.contact_states)
    closed, t, incidents = states.is_closed, e.record.t, e.run.incidents if e.run else None
    if incidents is None:
        cut = checks_contact.may_hold_impact(t, states)
    else:  # the steps with t_k < t <= t_k+1 for an incident that changes forces or velocities
        times = incidents.t[incidents.cuts]
        is_first = np.concatenate([t[1:-1] == t[2:], [False]])[: len(t) - 1]  # of rows at one time
        left, right = (np.searchsorted(times, t[1:], side) for side in ("left", "right"))
        cut = np.where(is_first, left, right) > np.searchsorted(times, t[:-1], "right")
    index = {name: k for k, name in enumerate(e.laws.rows)}

    def found(runs: Runs, rows: Array, numbers: Sequence[int]) -> tuple[Evidence, list[Check]]:
        """The evidence of some rows, at which these contacts are closed, and what checks find in it."""
        laws, part = ModelLaws(e.laws.model, e.tolerance.jumps, numbers), e.record.part(rows)
        part = part._replace(lam=part.lam[:, [index[name] for name in laws.rows]])
        own = Evidence(laws, part, e.tolerance, e.record)
        return own, [check for findings, where in CHECKS if where == runs for check in findings(own)]

    # Rows by themselves, by the sets of closed contacts that occur
    kinds, which = np.zeros((1, 0), dtype=bool), np.zeros(len(t), dtype=np.int64)
    if closed.shape[1]:
        kinds, which = np.unique(closed, axis=0, return_inverse=True)
    modes = [(kind, np.flatnonzero(which.ravel() == number)) for number, kind in enumerate(kinds)]
    modes.sort(key=lambda mode: -len(mode[1]))
    by_sets: list[tuple[int, list[Check]]] = []
    sentences, virtual_work = list[str](), 0.0
    for number, (is_closed, rows) in enumerate(modes[:MOST_MODES]):
        numbers = np.flatnonzero(is_closed).tolist()
        own, checks = found("all, by rows", rows, numbers)
        by_sets.append((len(rows), checks))
        virtual_work = max(virtual_work, own.virtual_work)
        if number < MOST_DESCRIBED:
            names = [e.laws.contacts[j] for j in numbers]
            shown = ", ".join(names[:MOST_DESCRIBED]) + (" ..." if len(names) > MOST_DESCRIBED else "")
            while_ = f"while {shown} {'is' if len(names) == 1 else 'are'} closed"
            while_ = while_ if names else "with all contacts open"
            sentences += [f"{while_}, {sentence}" for sentence in _uniqueness(own)]
    of_rows = _merged_by_name(by_sets, sum(len(rows) for _, rows in modes[MOST_MODES:]))
    # The motion along stretches of rows between cuts, with one set of closed contacts
    is_step = np.diff(t) > 0  # between the two rows of an instant there is none
    ends = cut | ~is_step | (closed[1:] != closed[:-1]).any(axis=1)
    stretches = np.split(np.arange(len(t)), np.flatnonzero(ends) + 1)
    long = sorted((k for k in stretches if len(k) >= checks_flight.FEWEST_ROWS), key=len, reverse=True)
    looked_at = sorted(long[:MOST], key=lambda k: int(k[0]))
    by_stretches = []
    for rows in looked_at:
        _, checks = found("all, by stretches", rows, np.flatnonzero(closed[rows[0]]).tolist())
        by_stretches.append((len(rows), checks))
    steps, looked = int(is_step.sum()), sum(map(len, looked_at))
    if looked_at:
        along = _merged_by_name(by_stretches, len(t) - looked)
        # Entries of `steps` are steps and not rows, and one stands between two stretches.
        name, unseen = checks_steps.STEPS.name, steps - looked + len(looked_at)
        of_steps = [check for _, part in by_stretches for check in part if check.name == name]
        columns = sum(check.entries for check in of_steps) // (looked - len(looked_at))
        along = [merged(of_steps, unseen * columns) if check.name == name else check for check in along]
    else:
        unseen = steps
        laws = (checks_steps.STEPS, checks_motion.RATES, checks_motion.NEWTON, checks_motion.ENERGY)
        along = [law.unjudged(FAR_APART) for law in laws]
    cuts, note = int((cut & is_step).sum()), ""
    told = f"{cuts} of {steps} steps between rows"
    if unseen and incidents is None and cuts:
        note = (
            f"{told} may hold an impact: they are not judged without --events ({unseen} steps are left out of"
        )
        note += " what is judged by differences)"
    elif unseen:
        note = (
            f"{told} hold incidents; {unseen} stand in stretches too short for differences, or between them"
        )
    return _Judged([*of_rows, *along], sentences, [note] if note else [], virtual_work)


def _merged_by_name(parts: list[tuple[int, list[Check]]], skipped: int) -> list[Check]:
    """The checks of all parts by name, each part with its number of rows; `skipped` rows were in none of them."""
    by_name: dict[str, list[Check]] = {}
    at_a_row: dict[str, int] = {}
    for rows, part in parts:
        for check in part:
            by_name.setdefault(check.name, []).append(check)
            at_a_row[check.name] = max(at_a_row.get(check.name, 0), check.entries // rows)
    return [merged(checks, skipped * at_a_row[name]) for name, checks in by_name.items()]


def _uniqueness(e: Evidence) -> list[str]:
    """Existence and uniqueness: rank, condition, consistency, and which multipliers are determined."""
    laws, d = e.laws, e.displacements
    times = e.record.t[e.looked_at]
    n = laws.index.n
    if not laws.C:
        return [f"there are no rows: all {n} coordinates are free, R = 0, and the motion is unique"]
    rows = f"the {laws.C} rows are independent; they leave"
    if d.usual < laws.C:
        rows = f"the {laws.C} rows have rank {d.usual}: {laws.C - d.usual} too many; they leave"
    elif laws.C == 1:
        rows = "the one row leaves"
    sentences = [f"{rows} {n - d.usual} of {n} directions free"]
    regular = ~d.is_singular
    if regular.any():
        worst = int((d.condition * regular).argmax())
        at_most = f"{d.condition[worst]:.2g} (at t = {times[worst]:.6g})"
        sentences.append(f"the condition of the rows, each divided by its length, is at most {at_most}")
    if d.is_singular.any():
        first = times[d.is_singular][0]
        sentences.append(
            f"{int(d.is_singular.sum())} of the {len(times)} rows of the table that were looked at are at or next to a"
            f" singular configuration, the first at t = {first:.6g}: multipliers may have poles there, R has none"
        )
    are_unique = d.is_unique[regular].all(axis=0)
    open_ = [row for row, unique in zip(laws.rows, are_unique, strict=True) if not unique]
    if not regular.any():
        sentences.append(
            "which multipliers are determined is not known: no row of the table that was looked at is regular"
        )
    elif open_:
        more = " ..." if len(open_) > MOST_LISTED else ""
        shown = ", ".join(f"`{row}`" for row in open_[:MOST_LISTED]) + more
        sentences.append(
            f"{len(open_)} of {laws.C} multipliers are not determined ({shown}): their rows depend on each other;"
            " the others, R and the motion are unique"
        )
    else:
        sentences.append(
            "all multipliers are determined, lambda(0) too: they follow from (B M^-1 B^T) lambda = gamma - B M^-1 F"
            " at every instant"
        )
    return sentences
