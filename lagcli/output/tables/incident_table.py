"""The incidents of a run as a table and as a sequence: `--events`, also read back, `run.events` and `--event-rows`."""

from __future__ import annotations

import functools
import itertools
import operator
import os
from collections.abc import Iterable, Iterator, Sequence
from typing import overload

import numpy as np
import numpy.typing as npt

from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.frozen import frozen, frozen_value
from lagcli.model.model import Model
from lagcli.simulation.run_state.statistics import KINDS, Incident

Words = npt.NDArray[np.str_]
Column = Floats | Words

TEXTS = ("kind", "name")
HEAD = ("t", *TEXTS)
IMPULSE, BEFORE, AFTER = "impulse.", "before.", "after."


@frozen
class IncidentColumns:
    """The names of the columns of the table of incidents of a model; positions, velocities: the numbers of those of
    `System.columns` that are positions or coordinates, and their rates."""

    names: tuple[str, ...]
    positions: list[int]
    velocities: list[int]

    def numbers(self, incidents: Sequence[Incident]) -> Floats:
        """The columns of numbers (k, all but `TEXTS`) of k incidents."""
        rows = np.empty((len(incidents), len(self.names) - len(TEXTS)))
        for row, incident in zip(rows, incidents, strict=True):
            before, after = incident.before[self.velocities], incident.after[self.velocities]
            row[0] = incident.t
            row[1:] = np.concatenate([incident.impulses, incident.after[self.positions], before, after])
        rows += 0.0  # no table shows -0.0
        return rows

    def words(self, incidents: Sequence[Incident]) -> tuple[list[str], list[str]]:
        """The columns of text: kinds and names."""
        return [incident.kind for incident in incidents], [incident.name for incident in incidents]

    def table(self, incidents: Sequence[Incident]) -> IncidentTable:
        """The table of incidents in the order of time."""
        return IncidentTable(self.names, *self.words(incidents), self.numbers(incidents))


def columns(model: Model, columns: Sequence[str]) -> IncidentColumns:
    """The columns of the incidents of a model from those of its table, `System.columns`."""
    position_names, rates = map(frozenset, model.state_columns)
    positions = [i for i, name in enumerate(columns) if name in position_names]
    velocities = [i for i, name in enumerate(columns) if name in rates]
    multipliers = [name.removeprefix("lambda.") for name in columns if name.startswith("lambda.")]
    names = [
        *HEAD,
        *(IMPULSE + name for name in multipliers),
        *(columns[i] for i in positions),
        *(BEFORE + columns[i] for i in velocities),
        *(AFTER + columns[i] for i in velocities),
    ]
    return IncidentColumns(tuple(names), positions, velocities)


@frozen_value
class IncidentRow:
    """An incident of `run.events`, by the names of constraints, positions and velocities.

    kind: one of `KINDS`; name: of the constraint or event; impulses: of every constraint at that instant, in units of
    lambda times time; at: positions and coordinates; before, after: velocities and rates.
    """

    t: float
    kind: str
    name: str
    impulses: dict[str, float]
    at: dict[str, float]
    before: dict[str, float]
    after: dict[str, float]

    def __repr__(self) -> str:
        pushed = ", ".join(f"{name}: {value:.6g}" for name, value in self.impulses.items() if value)
        impulses = f", impulses {{{pushed}}}" if pushed else ""
        return f"<{self.kind} of {self.name} at t = {self.t:.9g}{impulses}>"


class IncidentTable(Sequence[IncidentRow]):
    """The incidents of a run in the order of time; by name also the columns of their table, as `dict(run.events)`.

    columns: all names, `t`, `kind` and `name` first; numbers: the columns that hold numbers (k, len(columns) - 2), in
    the same order; kinds, names: of the incidents (k,).
    """

    def __init__(
        self, columns: Sequence[str], kinds: Iterable[str], names: Iterable[str], numbers: Floats
    ) -> None:
        self.columns, self.numbers = tuple(columns), numbers
        self.kinds, self.names = tuple(kinds), tuple(names)

    @overload
    def __getitem__(self, key: str) -> Column: ...
    @overload
    def __getitem__(self, key: int) -> IncidentRow: ...
    @overload
    def __getitem__(self, key: slice) -> IncidentTable: ...
    def __getitem__(self, key: str | int | slice) -> Column | IncidentRow | IncidentTable:
        if isinstance(key, slice):
            return IncidentTable(self.columns, self.kinds[key], self.names[key], self.numbers[key])
        if not isinstance(key, str):
            return self._row(range(len(self))[operator.index(key)])
        if key in TEXTS:
            return np.array(self.kinds if key == "kind" else self.names, dtype=np.str_)
        if key not in self._indices:
            hint = diagnostics.nearest(key, self.columns)
            raise KeyError(f"there is no column `{key}`" + (f"; {hint}" if hint else ""))
        return self.numbers[:, self._indices[key]]

    def __len__(self) -> int:
        return len(self.kinds)

    def __iter__(self) -> Iterator[IncidentRow]:
        return map(self._row, range(len(self)))

    def __contains__(self, key: object) -> bool:
        return key in self.columns if isinstance(key, str) else super().__contains__(key)

    def __repr__(self) -> str:
        if not len(self):
            return "<IncidentTable: no incidents>"
        counts = ", ".join(f"{n} {kind}" for kind in KINDS if (n := self.kinds.count(kind)))
        first, last = self.numbers[0, 0], self.numbers[-1, 0]
        return f"<IncidentTable: {counts}; t = {first:.9g} to {last:.9g}>"

    def keys(self) -> tuple[str, ...]:
        """The names of the columns."""
        return self.columns

    def values(self) -> Iterator[Column]:
        """The columns (k,)."""
        return (self[name] for name in self.columns)

    def items(self) -> Iterator[tuple[str, Column]]:
        """The columns with their names."""
        return ((name, self[name]) for name in self.columns)

    @property
    def t(self) -> Floats:
        """The times (k,)."""
        return self.numbers[:, 0]

    def of(self, kind: str | None = None, name: str | None = None) -> IncidentTable:
        """The incidents of a kind, of a name, or of both."""
        pairs = zip(self.kinds, self.names, strict=True)
        matching = [i for i, (k, n) in enumerate(pairs) if kind in (None, k) and name in (None, n)]
        kinds, names = ([words[i] for i in matching] for words in (self.kinds, self.names))
        return IncidentTable(self.columns, kinds, names, self.numbers[matching])

    def to_pandas(self) -> object:
        """The table as a `pandas.DataFrame`, a row an incident. Raises `ImportError` without pandas."""
        try:
            import pandas
        except ModuleNotFoundError as error:
            raise ImportError("to_pandas() needs pandas: pip install pandas") from error
        frame: object = pandas.DataFrame(dict(self.items()))
        return frame

    @functools.cached_property
    def _indices(self) -> dict[str, int]:
        numbers = (name for name in self.columns if name not in TEXTS)
        return {name: index for index, name in enumerate(numbers)}

    @functools.cached_property
    def _prefixes(self) -> list[str]:
        """The prefix of each column of numbers by its index: a particle may be called `before`. As many velocities as
        positions stand after them, twice; of what another program has added there is none."""
        names = list(self._indices)
        end = max((i for i, name in enumerate(names, start=1) if name.startswith(AFTER)), default=0)
        n = sum(1 for _ in itertools.takewhile(lambda name: name.startswith(AFTER), reversed(names[:end])))
        before, at = end - 2 * n, end - 3 * n
        runs = ("", 1), (IMPULSE, at - 1), ("", n), (BEFORE, n), (AFTER, n), ("", len(names) - end)
        found = [prefix for prefix, count in runs for _ in range(count)]
        if len(found) == len(names) and all(map(str.startswith, names[before:end], found[before:end])):
            return found
        parts = (IMPULSE, BEFORE, AFTER, "")
        return [next(part for part in parts if name.startswith(part)) for name in names]

    def _row(self, number: int) -> IncidentRow:
        values = self.numbers[number]
        parts: dict[str, dict[str, float]] = {IMPULSE: {}, BEFORE: {}, AFTER: {}, "": {}}
        for (name, index), prefix in zip(self._indices.items(), self._prefixes, strict=True):
            if index:
                parts[prefix][name.removeprefix(prefix)] = float(values[index])
        named = parts[IMPULSE], parts[""], parts[BEFORE], parts[AFTER]
        return IncidentRow(float(values[0]), self.kinds[number], self.names[number], *named)


def joined(tables: Sequence[IncidentTable]) -> IncidentTable:
    """The table joined from several with the same columns, in their order."""
    kinds, names = (
        itertools.chain(*parts) for parts in zip(*((t.kinds, t.names) for t in tables), strict=True)
    )
    return IncidentTable(tables[0].columns, kinds, names, np.concatenate([t.numbers for t in tables]))


NONE = IncidentTable(HEAD, (), (), np.zeros((0, 1)))


def read(path: str | os.PathLike[str]) -> IncidentTable:
    """The incidents in a file: `t`, `kind`, `name` and any columns of numbers. Raises what `table_format.opened`
    raises, and `UnreadableTable` for other columns, other kinds, and times that are no numbers or go back."""
    from lagcli.output.tables import table_format

    def bad(reason: str) -> table_format.UnreadableTable:
        return table_format.UnreadableTable(f"{path} is no table of events: {reason}")

    table = table_format.opened(path)
    missing = [name for name in HEAD if name not in table.columns]
    if missing:
        raise bad(f"it has no column `{missing[0]}`")
    numbers = ["t", *(name for name in table.columns if name not in HEAD)]
    values = table.take(numbers)
    kinds, names = table.words("kind"), table.words("name")
    if not len(kinds) == len(names) == len(values):
        raise bad("its columns have different lengths")
    for row, kind in enumerate(kinds, 1):
        if kind not in KINDS:
            shown = kind[: table_format.SHOWN]
            raise bad(f"row {row} is of the kind {shown!r}; the kinds are {', '.join(KINDS)}")
    t = values[:, 0]
    back = np.flatnonzero(~np.isfinite(t) | (np.diff(t, prepend=t[:1]) < 0))
    if back.size:
        raise bad(f"the time in row {back[0] + 1} is before that of the row above, or no number")
    return IncidentTable((*HEAD, *numbers[1:]), kinds, names, values)


def with_event_rows(rows: Floats, incidents: Sequence[Incident]) -> Floats:
    """Rows (k, columns) with two more for each instant, before and after, ahead of a row of the grid at that time.

    incidents: in the order of time. Columns beyond their lines are nan. A row within the rounding of an instant that
    has the state after it stands behind, at one time with it.
    """
    if not incidents:
        return rows
    from lagcli.simulation.stepping.grid import AT_END

    pairs: list[Floats] = []
    indices: list[int] = []
    for t, group in itertools.groupby(incidents, key=lambda incident: incident.t):
        found = list(group)
        ends = [np.asarray(line) for line in (found[0].before, found[-1].after)]
        k = int(np.searchsorted(rows[:, 0], t))
        if k and t - rows[k - 1, 0] <= AT_END * np.spacing(abs(t)):
            off = [np.nansum(np.abs(rows[k - 1, 1 : 1 + line.size] - line)) for line in ends]
            if off[1] < off[0]:
                k, t = k - 1, float(rows[k - 1, 0])
        for line in ends:
            row = np.full(rows.shape[1], np.nan)
            row[0], row[1 : 1 + line.size] = t, line
            pairs.append(row)
            indices.append(k)
    more = np.array(pairs) + 0.0  # no table shows -0.0
    return np.insert(rows, indices, more, axis=0)
