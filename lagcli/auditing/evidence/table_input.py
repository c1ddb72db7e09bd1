"""The recorded run: the columns of a table that an audit looks at."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.model import model as nouns

SHOWN = 8  # missing columns that a message names
ENERGY = "energy"  # the column that every table has


class TableError(ValueError):
    """The table cannot be audited: columns are missing, or its times do not increase."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Record:
    """t (T,); q and v (T, n); x and u (T, 3 Nd) of the dependent particles; lam (T, C); R_q (T, n) on the coordinates
    and R_x (T, 3 Nd) on the dependent particles."""

    t: Array
    q: Array
    v: Array
    x: Array
    u: Array
    lam: Array
    R_q: Array
    R_x: Array

    def part(self, rows: Array) -> Record:
        """Some of the rows."""
        return Record(**{f.name: getattr(self, f.name)[rows] for f in dataclasses.fields(self)})


@dataclasses.dataclass(frozen=True, slots=True)
class TableNames:
    """The columns of each part of a `Record`."""

    q: tuple[str, ...]
    v: tuple[str, ...]
    x: tuple[str, ...]
    u: tuple[str, ...]
    lam: tuple[str, ...]
    R_q: tuple[str, ...]
    R_x: tuple[str, ...]

    @property
    def needed(self) -> tuple[str, ...]:
        """All columns."""
        return ("t", *self.q, *self.v, *self.x, *self.u, *self.lam, *self.R_q, *self.R_x)


def names(laws: ModelLaws) -> TableNames:
    """The columns that the audit of a model needs."""
    model, cast = laws.model, laws.cast
    cartesian = [cast.particles.names[k] for k in cast.cartesian]
    dependent = [cast.particles.names[k] for k in cast.dependent]
    generalized = model.generalized_names

    def places(of: Sequence[str], head: str = "", word: str = "") -> tuple[str, ...]:
        return tuple(f"{head}{name}.{word}{axis}" for name in of for axis in "xyz")

    return TableNames(
        q=(*places(cartesian), *generalized),
        v=(*places(cartesian, word="v"), *(f"rate({name})" for name in generalized)),
        x=places(dependent),
        u=places(dependent, word="v"),
        lam=tuple(f"lambda.{row}" for row in laws.rows),
        R_q=(*places(cartesian, "R."), *(f"R.{name}" for name in generalized)),
        R_x=places(dependent, "R."),
    )


def wanted(laws: ModelLaws, columns: Sequence[str]) -> tuple[str, ...]:
    """The columns that an audit reads of those of a table. Raises `TableError` with what is missing."""
    needed, known = names(laws).needed, set(columns)
    missing = [name for name in needed if name not in known]
    if missing:
        raise TableError(_missing(laws.model, columns, needed, missing))
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
    parts = {
        field.name: [known[name] for name in getattr(names(laws), field.name)]
        for field in dataclasses.fields(TableNames)
    }
    return Record(t=t, **{part: rows[:, places] for part, places in parts.items()})


def _missing(model: nouns.Model, columns: Sequence[str], needed: Sequence[str], missing: list[str]) -> str:
    shown = ", ".join(f"`{name}`" for name in missing[:SHOWN])
    more = f" and {len(missing) - SHOWN} others" if len(missing) > SHOWN else ""
    title = f" of {model.title}" if model.title else ""
    sentence = f"the table lacks {len(missing)} of the {len(needed)} columns that the audit{title} needs: {shown}{more}"
    own = [name for name in columns if name.startswith(("lambda.", "R.")) and name not in set(needed)]
    if own:
        sentence += f"; it has `{own[0]}`, which this model does not: it may be the table of another model"
    return sentence
