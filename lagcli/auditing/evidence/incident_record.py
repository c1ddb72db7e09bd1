"""The recorded incidents of a run: impacts, contacts, releases and events, from their table alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lagcli.auditing.evidence import table_input
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.table_input import Record, TableError

CHANGING = frozenset(("impact", "contact", "release", "accumulation"))  # kinds that are of an inequality
BEFORE, AFTER, IMPULSE = "before.", "after.", "impulse."


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class EventTable:
    """A table of incidents: kinds and names (E,), and the columns of numbers with their rows (E, k)."""

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    columns: tuple[str, ...]
    rows: Array


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Incidents:
    """E incidents in the order of time. before, after: their states as records, in which `lam` are the impulses
    (E, C + K) and reactions are 0; first (E,): True for the first of an instant; contact (E,): the number of the
    inequality that is named, -1 for another."""

    kinds: tuple[str, ...]
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
        """Of all rows and contacts, (E, C + K)."""
        return self.before.lam

    @property
    def is_first(self) -> Array:
        """True for the first of each instant."""
        return np.concatenate([[True], np.diff(self.t) > 0])[: len(self.t)]

    @property
    def is_last(self) -> Array:
        """True for the last of each instant."""
        return np.concatenate([np.diff(self.t) > 0, [True]])[: len(self.t)]

    @property
    def cuts(self) -> Array:
        """True for what velocities or forces jump at."""
        return np.array([kind in CHANGING for kind in self.kinds], dtype=bool)


def read(laws: ModelLaws, table: EventTable) -> Incidents:
    """The incidents of a table; laws: with all inequalities closed. Raises `table_input.TableError` with what is
    missing, and for a name that is none of the model."""
    names = table_input.names(laws)
    at = {name: k for k, name in enumerate(table.columns)}
    impulses = tuple(IMPULSE + name.removeprefix("lambda.") for name in names.lam)
    wanted = ("t", *impulses, *names.q, *names.x)
    wanted += tuple(head + name for head in (BEFORE, AFTER) for name in (*names.v, *names.u))
    missing = [name for name in wanted if name not in at]
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
        q, x = taken(names.q), taken(names.x)
        v, u = (taken([head + name for name in part]) for part in (names.v, names.u))
        return Record(
            table.rows[:, at["t"]], q, v, x, u, taken(impulses), np.zeros(q.shape), np.zeros(x.shape)
        )

    if not np.isfinite(taken(wanted)).all():
        raise TableError("the table of events has entries that are no finite numbers")
    numbers = [contacts.get(name, -1) for name in table.names]
    return Incidents(table.kinds, table.names, state(BEFORE), state(AFTER), np.array(numbers, dtype=np.int64))
