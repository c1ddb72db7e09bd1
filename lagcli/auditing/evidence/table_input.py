"""The recorded run: the columns of a table that an audit looks at, the incidents of their own table, and their digits.

A run writes numbers with 16 or 17 digits. A spreadsheet keeps fewer, of each number or behind its point: those nearly
all end at one place, where numbers that are short by themselves, as of a simple motion, have many lengths.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import HALF
from lagcli.auditing.evidence.laws import ModelLaws

SHOWN = 8  # missing columns that a message names
# Roundings of a time between rows that are at one time: one of the grid, which is a sum, and one of an event there.
ROUNDINGS = 4
ENERGY = "energy"  # the column that every table has
CHANGING = ("impact", "contact", "release", "accumulation")  # kinds that are of an inequality
BEFORE, AFTER, IMPULSE = "before.", "after.", "impulse."


class TableError(ValueError):
    """The table cannot be audited: columns are missing, or its times do not increase."""


class AuditedTable(NamedTuple):
    """Columns with their rows (T, len(columns)); unread: further columns, which are not at hand; events: the incidents
    of the run, where they are."""

    columns: Sequence[str]
    rows: Array
    unread: Sequence[str] = ()
    events: EventTable | None = None


class Record(NamedTuple):
    """t (T,); q, v and R (T, n + 3 Nd) of the coordinates and, after them, of the dependent particles; lam (T, C).
    side (T,): -1 of the row before an instant at which there are several, 1 of others there, 0 elsewhere."""

    t: Array
    q: Array
    v: Array
    lam: Array
    R: Array
    side: Array

    def part(self, rows: Array) -> Record:
        return Record(*(part[rows] for part in self))


class EventTable(NamedTuple):
    """A table of incidents: kinds and names (E,), and the columns of numbers with their rows (E, k)."""

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    columns: tuple[str, ...]
    rows: Array


class Incidents(NamedTuple):
    """E incidents in the order of time. before, after: records in which `lam` are the impulses (E, C + K) and reactions
    are 0; kinds (E,): words; contact (E,): the number of the inequality that is named, or -1."""

    kinds: Array
    names: tuple[str, ...]
    before: Record
    after: Record
    contact: Array

    @property
    def t(self) -> Array:
        """Their times (E,)."""
        return self.before.t

    @property
    def impulses(self) -> Array:
        """The impulses of all rows and contacts, (E, C + K)."""
        return self.before.lam

    @property
    def first(self) -> Array:
        """The number of the first of each instant."""
        return np.flatnonzero(np.concatenate([[True], np.diff(self.t) > 0])[: len(self.t)])

    @property
    def last(self) -> Array:
        """The number of the last of each instant."""
        return np.flatnonzero(np.concatenate([np.diff(self.t) > 0, [True]])[: len(self.t)])

    @property
    def cuts(self) -> Array:
        """True for what velocities or forces jump at."""
        return np.isin(self.kinds, CHANGING)


class TableNames(NamedTuple):
    """The columns of each part of a `Record`."""

    q: tuple[str, ...]
    v: tuple[str, ...]
    lam: tuple[str, ...]
    R: tuple[str, ...]


def names(laws: ModelLaws) -> TableNames:
    """The columns that the audit of a model needs."""
    model, index = laws.model, laws.index
    generalized = model.generalized_names

    def columns(word: str, others: Sequence[str]) -> tuple[str, ...]:
        of_cartesian, of_dependent = (
            [f"{index.particles.names[k]}.{word}{axis}" for k in numbers for axis in "xyz"]
            for numbers in (index.cartesian, index.dependent)
        )
        return (*of_cartesian, *others, *of_dependent)

    q = columns("", generalized)
    return TableNames(
        q=q,
        v=columns("v", [f"rate({name})" for name in generalized]),
        lam=tuple(f"lambda.{row}" for row in laws.rows),
        R=tuple(f"R.{name}" for name in q),
    )


def wanted(laws: ModelLaws, columns: Sequence[str]) -> tuple[str, ...]:
    """The columns that an audit reads of those of a table. Raises `TableError` with what is missing."""
    needed = ("t", *itertools.chain(*names(laws)))
    known = set(columns)
    missing = [name for name in needed if name not in known]
    if missing:
        shown = ", ".join(f"`{name}`" for name in missing[:SHOWN])
        more = f" and {len(missing) - SHOWN} others" if len(missing) > SHOWN else ""
        title = f" of {laws.model.title}" if laws.model.title else ""
        message = f"the table lacks {len(missing)} of the {len(needed)} columns that the audit{title} needs:"
        message += f" {shown}{more}"
        others = [name for name in columns if name.startswith(("lambda.", "R.")) and name not in set(needed)]
        if others:
            message += (
                f"; it has `{others[0]}`, which this model does not: it may be the table of another model"
            )
        raise TableError(message)
    own = (ENERGY, *(column for output in laws.model.outputs for column in output.columns))
    return (*needed, *(name for name in own if name in known))


def read(laws: ModelLaws, columns: Sequence[str], rows: Array, repeats: bool = False) -> Record:
    """The record in a table, rows (T, len(columns)). Raises `TableError` with what is missing.

    repeats: several rows may stand at one time, before and after an incident.
    """
    wanted(laws, columns)
    known = {name: i for i, name in enumerate(columns)}
    t = rows[:, known["t"]]
    if not len(t):
        raise TableError("the table has no rows")
    with np.errstate(invalid="ignore"):  # inf - inf
        grows = (np.diff(t) > 0) | (repeats & (np.diff(t) == 0))
    if not np.isfinite(t).all() or not grows.all():
        k = int(np.argmax(np.concatenate([[not np.isfinite(t[0])], ~(grows & np.isfinite(t[1:]))])))
        raise TableError(f"the times of the table do not increase: row {k + 1} is at t = {t[k]:.9g}")
    if repeats:
        t = t.copy()
        for k in np.flatnonzero(np.diff(t) <= ROUNDINGS * np.spacing(np.abs(t[1:])))[::-1]:
            t[k] = t[k + 1]
    parts = {part: [known[name] for name in own] for part, own in names(laws)._asdict().items()}
    follows = np.concatenate([[False], np.diff(t) == 0])
    side = follows * 1.0 - (np.append(follows[1:], False) & ~follows)
    return Record(t=t, side=side, **{part: rows[:, indices] for part, indices in parts.items()})


def incidents(laws: ModelLaws, table: EventTable) -> Incidents:
    """The incidents of a table; laws: with all inequalities closed. Raises `TableError` with what is missing, and for
    a name that is none of the model."""
    parts = names(laws)
    at = {name: k for k, name in enumerate(table.columns)}
    impulses = tuple(IMPULSE + name.removeprefix("lambda.") for name in parts.lam)
    needed = ("t", *impulses, *parts.q, *(head + name for head in (BEFORE, AFTER) for name in parts.v))
    missing = [name for name in needed if name not in at]
    if missing:
        raise TableError(f"the table of events lacks the column `{missing[0]}`")
    contacts = {name: j for j, name in enumerate(laws.contacts)}
    pairs = zip(table.kinds, table.names, strict=True)
    unknown = [name for kind, name in pairs if kind in CHANGING and name not in contacts]
    if unknown:
        raise TableError(f"the table of events names `{unknown[0]}`, which is no inequality of the model")

    def taken(columns: Sequence[str]) -> Array:
        return table.rows[:, [at[name] for name in columns]]

    def state(head: str) -> Record:
        q, v = taken(parts.q), taken([head + name for name in parts.v])
        return Record(table.rows[:, at["t"]], q, v, taken(impulses), np.zeros(q.shape), np.zeros(len(q)))

    if not np.isfinite(taken(needed)).all():
        raise TableError("the table of events has entries that are no finite numbers")
    numbers = [contacts.get(name, -1) for name in table.names]
    kinds = np.array(table.kinds, dtype=np.str_)
    return Incidents(kinds, table.names, state(BEFORE), state(AFTER), np.array(numbers, dtype=np.int64))


def at_rows(incidents: Incidents, r: Record) -> Incidents:
    """Incidents with the time of a row that has the state after and stands within the rounding of theirs."""
    t = incidents.t.copy()
    if not len(t):
        return incidents
    row = np.clip(np.searchsorted(r.t, t), 1, max(1, len(r.t) - 1))
    for near in (row - 1, np.minimum(row, len(r.t) - 1)):
        k = np.searchsorted(r.t, r.t[near], "right") - 1  # of rows at one time the last, with the state after
        is_near = np.abs(r.t[k] - t) <= ROUNDINGS * np.spacing(np.abs(t))
        off = [np.abs(r.v[k] - state.v).max(axis=1) for state in (incidents.before, incidents.after)]
        t = np.where(is_near & (off[1] < off[0]), r.t[k], t)
    return incidents._replace(before=incidents.before._replace(t=t), after=incidents.after._replace(t=t))


# Limits of taking the numbers of a table for rounded ones; the tests are of `tests/unit/test_written_digits.py`.
MOST = sys.float_info.dig - 1  # digits of a rounded table: doubles with 15 cannot be told from those with all
TOGETHER = (
    40  # digits of different numbers that end at the last place: a few may be short by chance or as declared
)
OWN = 3  # digits less by which a number is short by itself: rounding leaves so few of one in a thousand
# Digits that are rounded ones for certain: no simple numbers have so many. With fewer, most of the rows must be off by
# the rounding: an error spoils its neighbours alone.
CERTAIN = 8
SAMPLE = 2000  # numbers that are looked at first: of a table with all digits no more


@dataclasses.dataclass(frozen=True, slots=True)
class WrittenDigits:
    """The rounding of numbers: to a count of digits, or of decimals; 0 where they were not. time: half of a unit in
    the last place of the times, or 0; is_told: False where there are too few numbers to tell."""

    digits: int = 0
    decimals: int = 0
    time: float = 0.0
    is_told: bool = True

    @property
    def part(self) -> float:
        """Half of a unit in the last place, as the largest part of a number."""
        return 0.5 * 10.0 ** (1 - self.digits) if self.digits else 0.0

    @property
    def unit(self) -> float:
        """Half of a unit of the last decimal."""
        return 0.5 * 10.0**-self.decimals if self.decimals else 0.0

    @property
    def is_short(self) -> bool:
        return self.part + self.unit > 0

    @property
    def is_certain(self) -> bool:
        """True for so many digits that they are short by rounding alone."""
        return max(self.digits, self.decimals) >= CERTAIN

    def sentence(self, table: str) -> str:
        count = f"{self.digits} digits" if self.digits else f"{self.decimals} decimals"
        return f"The {table} has {count}: judged by them."

    def as_json(self) -> dict[str, int]:
        return {"digits": self.digits, "decimals": self.decimals}


ALL = WrittenDigits()


def digits_of(rows: Array, t: Array) -> WrittenDigits:
    """The digits of the numbers of a table, with its times t (T,) among them or not."""
    numbers = np.abs(rows[np.isfinite(rows) & (rows != 0)])
    digits = ALL
    for part in (numbers[:: max(1, len(numbers) // SAMPLE)], numbers):
        digits = _of_numbers(np.unique(part))
        # A column that moves would tell its digits in so many rows.
        enough = len(t) * max(digits.digits, digits.decimals) >= TOGETHER
        if not digits.is_short or (enough and not digits.is_told):
            return ALL
    # Times may have fewer: those of a grid are exact.
    if _is_whole(np.abs(t[t != 0]), digits.digits + digits.decimals - 1, digits.digits > 0).all():
        return digits
    return dataclasses.replace(digits, time=digits.part * float(np.abs(t).max(initial=0.0)) + digits.unit)


def _of_numbers(numbers: Array) -> WrittenDigits:
    """The digits of different numbers, or their decimals where more of them end at the last one."""
    is_short = _is_whole(numbers, MOST, significant=True)
    digits, ending = _ending(numbers, True) if is_short.all() else (0, ~is_short)
    decimals, others = _ending(numbers, False) if is_short.any() else (0, ~is_short)
    others &= is_short
    written, counts = WrittenDigits(digits=digits), np.asarray(digits)
    looked = ~_is_whole(numbers, digits - OWN, significant=True)
    if np.sum(ending) < np.sum(others):
        written, ending = WrittenDigits(decimals=decimals), others
        counts = decimals + np.maximum(1.0 + np.floor(np.log10(numbers)), 0)
        looked = is_short & ~_is_whole(numbers, decimals - OWN, significant=False)
    if np.sum(ending) < HALF * np.sum(looked):  # the others are short by themselves
        return ALL
    return dataclasses.replace(written, is_told=float(np.sum(ending * counts)) >= TOGETHER)


def _ending(numbers: Array, significant: bool) -> tuple[int, Array]:
    """The least count of digits, or of decimals, that all numbers have, and which end there."""
    fewer = np.zeros(len(numbers), dtype=bool)
    for count in range(1, MOST + 1):
        enough = _is_whole(numbers, count, significant)
        if enough.all():
            return count, ~fewer
        fewer = enough
    return 0, np.zeros(len(numbers), dtype=bool)


def _is_whole(numbers: Array, count: int, significant: bool) -> Array:
    """True for positive numbers that end at so many digits, or decimals."""
    power = count - 1 - np.floor(np.log10(numbers)) if significant else np.full(numbers.shape, float(count))
    power = np.clip(power, -300, 300)
    scaled = np.where(power >= 0, numbers * 10.0 ** np.abs(power), numbers / 10.0 ** np.abs(power))
    return np.asarray(np.abs(scaled - np.rint(scaled)) <= 4 * doubles.EPS * scaled)
