"""To how many digits several formulations agree: in the columns that their tables share, and in their incidents.

Two principles of mechanics are compared too, with where their motions part; and all in words.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.model.model import Model

TOLERANCE = 1e-8  # of the relative difference of two tables, by default
# More digits than a double has are not reported: at 1.6 and at 160 `test_no_more_digits_are_reported_than_a_double_has`
# of `tests/unit/test_numbers_of_formulations.py` fails.
MOST_DIGITS = float(sys.float_info.dig + 1)
Kinds = Mapping[str, str]  # column -> one of `KINDS`
KINDS = ("r", "v", "lambda", "R", "energy", "outputs", "events")
# Of the two principles the forces of constraint can be compared as a whole, and multipliers not: those of differential
# rows are not there, and those of holonomic ones share the force with them.
COMPARED = ("r", "v", "R", "energy", "outputs")

TITLES = {
    "newton": "Newton with multipliers (D.24)",
    "freed": "Newton, dependent particles freed (D.24)",
    "lagrange": "Lagrange (D.39)",
    "lagrange-multipliers": "Lagrange with multipliers (D.53)",
    "reduced": "reduced by the null space (D.26, Maggi)",
    "vakonomic": "vakonomic, L + Σ μᵢ (Aᵢ v + bᵢ)",
}


@dataclasses.dataclass(frozen=True, slots=True)
class RunEvent:
    """An incident of a run: its time, and its kind and name."""

    t: float
    kind: str
    name: str

    @property
    def label(self) -> str:
        """`impact of floor`."""
        return f"{self.kind} of {self.name}"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Formulation:
    """One run. name: a key of `TITLES`; path: the file of the model; freedoms: of the velocities, n - rank; rows: C;
    columns and table (k, columns), t first; exchanged: the largest T plus the largest change of V, by which energies
    are measured; stopped: why it ended before its end, or nothing; events: its incidents.
    """

    name: str
    path: str
    coordinates: int
    freedoms: int
    rows: int
    steps: int
    seconds: float
    columns: tuple[str, ...]
    table: Floats
    exchanged: float
    stopped: str = ""
    events: tuple[RunEvent, ...] = ()

    def __repr__(self) -> str:
        return f"<Formulation {self.name} of {self.path}: {len(self.table)} rows>"

    @property
    def reached(self) -> float:
        """The time of the last row; nan where there is none."""
        return float(self.table[-1, 0]) if len(self.table) else math.nan


@dataclasses.dataclass(frozen=True, slots=True)
class Agreement:
    """The agreement of a kind of columns with the first formulation.

    error: the largest difference as a part of the largest value of that kind, of energies of what is exchanged, of
    events of the time of the run; column, t: where that is; columns: how many are shared, of events belong together.
    """

    columns: int
    error: float
    column: str
    t: float

    @property
    def digits(self) -> float:
        """Digits that agree, at most `MOST_DIGITS`."""
        return MOST_DIGITS if self.error <= 0 else max(0.0, min(MOST_DIGITS, -math.log10(self.error)))


@dataclasses.dataclass(frozen=True, slots=True)
class PartingPoint:
    """The time of the first row where positions differ by more than the tolerance; their largest difference."""

    t: float
    largest: float
    column: str
    t_largest: float


@dataclasses.dataclass(frozen=True, slots=True)
class Principles:
    """The outcome of a comparison of vakonomic motion with d'Alembert's.

    mu: initial multipliers of differential rows; integrable, nonholonomic, undecided: these rows; digits: to which
    positions and velocities agree, or None; parting: where positions part; left_out: outputs and events without a value
    in vakonomic motion; until: the time up to which both go.
    """

    mu: Mapping[str, float]
    integrable: tuple[str, ...]
    nonholonomic: tuple[str, ...]
    undecided: tuple[str, ...]
    tolerance: float
    digits: float | None = None
    parting: PartingPoint | None = None
    left_out: tuple[str, ...] = ()
    until: float | None = None

    @property
    def agree(self) -> bool | None:
        """True if positions and velocities agree within the tolerance; None where there is nothing to compare."""
        return None if self.digits is None else 10.0**-self.digits <= self.tolerance

    def as_json(self) -> dict[str, object]:
        """The object `principles` of `compare --vakonomic --json`."""
        return {**dataclasses.asdict(self), "mu": dict(self.mu), "agree": self.agree}

    @property
    def sentence(self) -> str:
        """The outcome in words."""
        rows = _listed(self.nonholonomic)
        if self.digits is None:
            return "there is nothing to compare"
        if not self.mu:
            return "there is no differential row: the two principles are the same equations"
        if self.agree:
            as_far = "" if self.until is None else f" up to t = {self.until:.9g}, as far as both go"
            sentence = f"the two principles agree to {self.digits:.1f} digits{as_far}"
            if self.nonholonomic:
                return f"{sentence}, for this start: {rows} not integrable, and in general they part"
            if self.undecided:
                return f"{sentence}; whether {_listed(self.undecided)} integrable is undecided"
            return f"{sentence}, as they must: the differential rows are integrable"
        sentence = "the two principles part"
        if self.nonholonomic:
            sentence += f", for {rows} not integrable"
        elif not self.undecided:
            sentence += (
                ", though the differential rows are integrable: the error of one of the runs is larger"
            )
        if self.parting is None:
            return f"{sentence}: velocities differ, positions do not within {self.tolerance:g}"
        where = self.parting
        return (
            f"{sentence}: positions differ by more than {self.tolerance:g} of their size from t = {where.t:.9g} on,"
            f" `{where.column}` by {where.largest:.4g} at t = {where.t_largest:.9g}"
        )


def _listed(names: Sequence[str]) -> str:
    quoted = [f"`{name}`" for name in names[:3]] + (["others"] if len(names) > 3 else [])
    return f"{', '.join(quoted)} {'is' if len(names) == 1 else 'are'}"


@dataclasses.dataclass(frozen=True, slots=True)
class Comparison:
    """Formulations, and how well each but the first agrees with the first, kind by kind, to a tolerance.

    notes: what was left out, and why. principles: how the last one compares where it is vakonomic, another motion: it
    has no part in the verdict.
    """

    formulations: tuple[Formulation, ...]
    agreements: tuple[Mapping[str, Agreement], ...]
    tolerance: float
    notes: tuple[str, ...] = ()
    principles: Principles | None = None

    def __repr__(self) -> str:
        verdict = {True: "agree", False: "disagree", None: "nothing to compare"}[self.agree]
        names = ", ".join(one.name for one in self.formulations)
        return f"<Comparison of {names}: {verdict} (tolerance {self.tolerance:g})>"

    @property
    def judged(self) -> tuple[Mapping[str, Agreement], ...]:
        """The agreements that are judged: that the other principle differs is an answer."""
        return self.agreements if self.principles is None else self.agreements[:-1]

    @property
    def agree(self) -> bool | None:
        """True if all errors are within the tolerance; None where there is nothing to compare."""
        errors = [one.error for each in self.judged for one in each.values()]
        return all(error <= self.tolerance for error in errors) if errors else None

    @property
    def stopped(self) -> bool:
        """True if a formulation ended before its end."""
        return any(one.stopped for one in self.formulations)

    def as_json(self) -> dict[str, Any]:
        """The object of `compare --json`."""
        agreements: list[dict[str, Any]] = [{}]
        agreements += [
            {kind: {**dataclasses.asdict(one), "digits": one.digits} for kind, one in each.items()}
            for each in self.agreements
        ]
        return {
            "formulations": [
                {
                    "formulation": one.name,
                    "model": one.path,
                    "coordinates": one.coordinates,
                    "velocity_dof": one.freedoms,
                    "rows": one.rows,
                    "steps": one.steps,
                    "seconds": one.seconds,
                    "t": one.reached if len(one.table) else None,
                    "stopped": one.stopped or None,
                    "agreement": agreement,
                }
                for one, agreement in zip(self.formulations, agreements, strict=True)
            ],
            "tolerance": self.tolerance,
            "agree": self.agree,
            "notes": list(self.notes),
            **({} if self.principles is None else {"principles": self.principles.as_json()}),
        }


def kinds(model: Model, columns: Sequence[str]) -> dict[str, str]:
    """Column -> one of `KINDS`, by what it is in this model; time is left out."""
    positions, speeds = map(frozenset, model.state_columns)
    outputs = {column for output in model.outputs for column in output.columns}
    found = {}
    for column in columns:
        if column == "t":
            continue
        if column in outputs:
            found[column] = "outputs"
        elif column in positions or column in speeds:
            found[column] = "r" if column in positions else "v"
        else:
            found[column] = column.partition(".")[0]
    return found


def compare(of: Kinds, first: Formulation, other: Formulation, singular: Flags) -> dict[str, Agreement]:
    """The agreement of two tables over one grid, as far as both go; `of`: shared columns with their kinds.

    singular (k,): rows of the first in which multipliers are not compared. Rows between the times of one incident in
    both runs are compared in positions alone; of `events` the times are. A multiplier or an output that has no
    value (nan) in a row is not compared there; anything else without a value agrees with nothing.
    """
    count, found = min(len(first.table), len(other.table)), dict[str, Agreement]()
    if not count:
        return found
    t = first.table[:count, 0]
    matches = matched(first.events, other.events, float(t[-1]), float(np.ptp(t)))
    parted = matches.parts(t)
    values = first.table[:, 1:]
    rounding = doubles.VALUE * float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    for kind in KINDS:
        shared = [name for name, own in of.items() if own == kind and name in other.columns]
        if not shared:
            continue
        one, gaps = _gaps(shared, first, other, count)
        if kind == "lambda":
            gaps = np.where(singular[:count, None], np.nan, gaps)
        known = ~np.isnan(gaps) if kind in ("lambda", "outputs") else np.ones_like(gaps, dtype=bool)
        if kind != "r":
            known &= ~parted[:, None]
        gaps = np.where(np.isnan(gaps), np.inf, gaps)
        if not known.any():
            continue
        scale = float(np.abs(one[known & np.isfinite(one)]).max(initial=0.0))
        scale = max(scale, first.exchanged if kind == "energy" else 0.0)
        row, column = np.unravel_index(int(np.argmax(np.where(known, gaps, -1.0))), gaps.shape)
        worst = float(gaps[row, column])
        error = 0.0 if max(scale, worst) <= rounding else worst / (scale or 1.0)
        error = min(error, sys.float_info.max)
        found[kind] = Agreement(len(shared), error, shared[int(column)], float(t[row]))
    if first.events or other.events:
        # The times of incidents, as a part of the time both runs last; none agree where one is alone
        together = len(matches.t)
        found["events"] = Agreement(0, 0.0, "", 0.0)
        if matches.alone is not None:
            found["events"] = Agreement(together, 1.0, matches.alone.label, matches.alone.t)
        elif together:
            apart = np.abs(matches.t[:, 1] - matches.t[:, 0])
            most = int(np.argmax(apart))
            error = float(apart[most]) / (float(np.ptp(t)) or 1.0)
            at = float(matches.t[most, 0])
            found["events"] = Agreement(together, error, matches.labels[most], at)
    return found


def _gaps(shared: Sequence[str], first: Formulation, other: Formulation, count: int) -> tuple[Floats, Floats]:
    """The first rows of a table in shared columns, and how far those of another are off, (count, columns)."""
    one, two = (run.table[:count, [run.columns.index(name) for name in shared]] for run in (first, other))
    return one, np.abs(one - two)


def parting(of: Kinds, first: Formulation, other: Formulation, tolerance: float) -> PartingPoint | None:
    """Where positions of two tables over one grid part, and in which column; `of`: columns with their kinds."""
    shared = [name for name, kind in of.items() if kind == "r" and name in other.columns]
    count = min(len(first.table), len(other.table))
    if not shared or not count:
        return None
    one, gaps = _gaps(shared, first, other, count)
    scale = float(np.abs(one).max(initial=0.0)) or 1.0
    apart = np.flatnonzero((gaps > tolerance * scale).any(axis=1))
    if not apart.size:
        return None
    row, column = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    times = first.table[:count, 0]
    return PartingPoint(
        float(times[apart[0]]), float(gaps[row, column]), shared[int(column)], float(times[int(row)])
    )


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Times (m, 2) of incidents that belong together, with their labels; alone: the first that has no other."""

    t: Floats
    labels: tuple[str, ...]
    alone: RunEvent | None

    def parts(self, rows: Floats) -> Flags:
        """True for the times (k,) at which one run is before an incident and the other behind it."""
        found = np.zeros(len(rows), dtype=bool)
        ends = self.t.min(axis=1, initial=np.inf), self.t.max(axis=1, initial=-np.inf)
        for begin, end in zip(*(np.searchsorted(rows, each, "left") for each in ends), strict=True):
            found[begin:end] = True
        return found


def matched(one: Sequence[RunEvent], other: Sequence[RunEvent], end: float, span: float) -> Matched:
    """The incidents of two runs that last to `end`, in order by kind and name; before an accumulation some may miss."""
    sides: list[dict[str, list[RunEvent]]] = [{}, {}]
    for events, by_label in zip((one, other), sides, strict=True):
        for event in events:
            if event.t <= end:
                by_label.setdefault(event.label, []).append(event)
    times, labels = [], []
    alone: list[RunEvent] = []
    for label in dict.fromkeys([*sides[0], *sides[1]]):
        first, second = (side.get(label, []) for side in sides)
        count = min(len(first), len(second))
        times += [(a.t, b.t) for a, b in zip(first, second, strict=False)]
        labels += [label] * count
        rest = [*first[count:], *second[count:]]
        # Impacts of a contact whose rebounds end in both runs
        if rest and not (
            rest[0].kind == "impact" and all(f"accumulation of {rest[0].name}" in side for side in sides)
        ):
            alone += [event for event in rest if event.t < end - doubles.ROOT * span]
    t = np.array(times, dtype=float).reshape(-1, 2)
    return Matched(t, tuple(labels), min(alone, key=lambda event: event.t, default=None))


def lines(found: Comparison) -> tuple[list[str], list[list[str]], str, str]:
    """The table of the formulations with its headers, how to read it, and where they differ more than they may."""
    first = found.formulations[0]
    several = len({one.path for one in found.formulations}) > 1
    shown = [kind for kind in KINDS if any(kind in each for each in found.agreements)]
    headers = [*(["model"] if several else []), "formulation", "dof", "rows", "steps", "seconds"]
    headers += ["λ" if kind == "lambda" else kind for kind in shown]
    rows = []
    for one, agreement in zip(found.formulations, ({}, *found.agreements), strict=True):
        cells = [one.path] if several else []
        cells += [TITLES[one.name], str(one.freedoms), str(one.rows), str(one.steps), f"{one.seconds:.3f}"]
        cells += [f"{agreement[kind].digits:.1f}" if kind in agreement else "" for kind in shown]
        rows.append(cells)
    reading = disagreement = ""
    if found.agree is not None:
        verdict = f"{'all' if found.agree else 'not all'} within {found.tolerance:g}" if found.judged else ""
        reading = f"digits that agree with the first line, of the largest value of each kind; {verdict}"
    if found.agree is False:
        # When and in which column the formulations differ most
        judged = zip(found.formulations[1:], found.judged, strict=False)
        every = [(one, agreement) for one, each in judged for agreement in each.values()]
        one, worst = max(every, key=lambda pair: pair[1].error)
        sides = (first.path, one.path) if one.path != first.path else (TITLES[first.name], TITLES[one.name])
        disagreement = (
            f"{sides[0]} and {sides[1]} disagree: `{worst.column}` by {worst.error:.3g} of the largest value of its"
            f" kind at t = {worst.t:.9g}, where {found.tolerance:g} passes"
        )
    return headers, rows, reading, disagreement
