"""The answer of `stationary` and `equilibrium`: points, and what is known of their completeness."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Value = Literal["value", "potential"]


@dataclasses.dataclass(frozen=True, slots=True)
class StaticPoint:
    """One point, by the columns of the model's table.

    at: positions and coordinates; multipliers: lambda by row, 0 of open contacts; reactions: R; value: f or the
    potential, None where there is none; type, index: of the bordered Hessian; residual: the largest |F + B^T lambda|,
    |f_i| as they are written;
    unique_multipliers: None where the rank of the rows is undecided; dimension: of the continuum it stands for, 0 of a
    point alone.
    """

    at: Mapping[str, float]
    multipliers: Mapping[str, float]
    reactions: Mapping[str, float]
    value: float | None
    type: str | None
    index: int | None
    residual: float
    unique_multipliers: bool | None
    dimension: int

    def as_json(self, called: Value) -> dict[str, object]:
        """An entry of `points`."""
        return {
            "at": dict(self.at),
            "multipliers": dict(self.multipliers),
            "reactions": dict(self.reactions),
            called: self.value,
            "type": self.type,
            "index": self.index,
            "residual": self.residual,
            "unique_multipliers": self.unique_multipliers,
            "dimension": self.dimension,
        }


@dataclasses.dataclass(frozen=True, slots=True)
class StaticReport:
    """Points in the order of their values. `called`: `value` of a function, `potential` of forces.

    starts: the starts that were gone out from; complete: proved that there are no others; best_residual: the least
    that was met, where no point was found.
    """

    called: Value
    points: tuple[StaticPoint, ...]
    starts: int
    complete: bool
    notes: tuple[str, ...]
    best_residual: float | None = None

    def __len__(self) -> int:
        return len(self.points)

    def __iter__(self) -> Iterator[StaticPoint]:
        return iter(self.points)

    def __getitem__(self, number: int) -> StaticPoint:
        return self.points[number]

    def __repr__(self) -> str:
        kinds = ", ".join(dict.fromkeys(str(point.type) for point in self.points))
        completeness = ", complete" if self.complete else ""
        return f"<StaticReport of {len(self.points)} points{': ' + kinds if kinds else ''}{completeness}>"

    def _repr_html_(self) -> str:
        names = list(self.points[0].at) if self.points else []
        head = "".join(f"<th>{html.escape(name)}</th>" for name in (*names, self.called, "type"))
        rows = [
            "".join(f"<td>{point.at[name]:.9g}</td>" for name in names)
            + f"<td>{'' if point.value is None else format(point.value, '.9g')}</td><td>{point.type or ''}</td>"
            for point in self.points
        ]
        return f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"

    def as_json(self) -> dict[str, object]:
        """The object of `--json`."""
        return {
            "points": [point.as_json(self.called) for point in self.points],
            "starts": self.starts,
            "complete": self.complete,
            "notes": list(self.notes),
        }

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of numbers of `table`; a column `type` of text stands after them."""
        if not self.points:
            return ()
        first = self.points[0]
        names = [*first.at, *(f"lambda.{name}" for name in first.multipliers), *first.reactions]
        return (*names, self.called, "index", "residual", "unique_multipliers", "dimension")

    def table(self) -> tuple[Floats, list[str]]:
        """One row a point: numbers (points, columns), nan where there is none, and the types."""
        rows = []
        for point in self.points:
            numbers = [*point.at.values(), *point.multipliers.values(), *point.reactions.values()]
            rest = [point.value, point.index, point.residual, point.unique_multipliers, point.dimension]
            rows.append([*numbers, *(np.nan if x is None else float(x) for x in rest)])
        return np.array(rows).reshape(len(rows), len(self.columns)), [
            point.type or "" for point in self.points
        ]
