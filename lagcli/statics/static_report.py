"""The answer of `stationary` and `equilibrium`: points with the contents of their table, and how complete they are.

Of all multipliers that balance, those of least weighted norm are given, as in a run; contacts only push. The potential
is the one whose stationary points are the points of rest, where the forces have one.
"""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.contact import complementarity
from lagcli.equations.system import System
from lagcli.linear import decompositions
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.statics.static_problem import StaticProblem

Value = Literal["value", "potential"]
Origin = Literal["declared", "integrated", "none"]


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
        entries = [
            {
                self.called if name == "value" else name: each
                for name, each in dataclasses.asdict(point).items()
            }
            for point in self.points
        ]
        notes = list(self.notes)
        return {"points": entries, "starts": self.starts, "complete": self.complete, "notes": notes}

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
        types = [point.type or "" for point in self.points]
        return np.array(rows).reshape(len(rows), len(self.columns)), types


class PointColumns:
    """Positions and reactions of one system at rest, at one time and for one p."""

    def __init__(self, system: System, t: float, p: Floats) -> None:
        self._model, self._t, self._p = system.model, t, p
        s, n = system.symbols, system.symbols.q.numel()
        zeros = ca.SX.zeros(n)
        R = ca.substitute([system.R, system.Q_R], [s.v, system.a], [zeros, zeros])
        self._positions = SizedFunction("positions", [s.t, s.q, system.p], [system.r])
        inputs = [s.t, s.q, system.lam, system.p]
        self._reactions = SizedFunction("reactions", inputs, [ca.densify(part) for part in R])

    def at(self, q: Floats) -> dict[str, float]:
        """Positions of all particles, then the generalized coordinates."""
        positions = self._positions(self._t, q, self._p).full().ravel().tolist()
        names = self._model.state_columns[0]
        return _named(names, [*positions, *q[q.size - len(names) + len(positions) :].tolist()])

    def reactions(self, q: Floats, lam: Floats, are_of_rows: bool) -> dict[str, float]:
        """R of all particles, then of the generalized coordinates, lam (C + K,); or, by the coordinates, the sum of
        lambda_i times the gradients."""
        R, Q = (part.full().ravel().tolist() for part in self._reactions(self._t, q, lam, self._p))
        if are_of_rows:
            return _named([f"R.{name}" for name in self._model.coordinate_names], Q)
        names = [f"R.{name}" for name in self._model.state_columns[0]]
        return _named(names, [*R, *Q[len(Q) - len(names) + len(R) :]])


def place(names: Sequence[str], q: Floats) -> str:
    """A configuration in words."""
    return ", ".join(f"{name} = {x:.9g}" for name, x in zip(names, q, strict=True))


def _named(names: Sequence[str], values: list[float]) -> dict[str, float]:
    return {name: value + 0.0 for name, value in zip(names, values, strict=True)}


def potential_origin(problem: StaticProblem) -> Origin:
    """The potential at rest, by values at random points: as declared, of forces that have one, or none."""
    random = np.random.default_rng(7)
    size = float(np.abs(problem.begin).max(initial=0.0)) or 1.0
    found: Origin = "declared"
    for part in (0.0, 0.5, 1.0, 1.5, 2.0):  # sizes of the start
        q = problem.begin + part * size * random.standard_normal(problem.n)
        driving, gradient = problem.driving(q)
        F = problem.at(problem.t, q, problem.nothing).F
        if not np.isfinite(driving).all() or not np.isfinite(gradient).all():
            continue
        largest = np.abs(F).max(initial=0.0)
        if np.abs(driving).max(initial=0.0) <= doubles.ZERO * max(largest, doubles.TINY):
            continue  # a Lagrangian written at length leaves rounding, whose gradient is of any shape
        found = "integrated"
        if not decompositions.is_symmetric(gradient):
            return "none"
    return found


def potential(problem: StaticProblem, source: Origin, q: Floats) -> float | None:
    """The potential at q; of forces without a declared one less their work from the start, along a straight way."""
    if source == "none":
        return None
    declared = problem.value(q)
    if source == "declared":
        return declared + 0.0
    from scipy import integrate

    way = q - problem.begin

    def along(part: float) -> float:
        return float(problem.driving(problem.begin + part * way)[0] @ way)

    # With its full output it warns of nothing: the error that it gives is judged here.
    work, error = integrate.quad(along, 0.0, 1.0, epsabs=0.0, epsrel=1e-12, limit=200, full_output=1)[:2]
    return declared - work if np.isfinite(work) and error <= 1e-9 * max(1.0, abs(work)) else None


def in_metric(rows: Floats, M: Floats) -> Floats:
    """Rows (C, n) whose lengths and angles are those of the mass metric; the plain one where M is singular."""
    try:
        return np.asarray(np.linalg.solve(np.linalg.cholesky((M + M.T) / 2), rows.T).T)
    except np.linalg.LinAlgError:
        return rows


def pushing_multipliers(rows: Floats, lam: Floats, M: Floats, equalities: int) -> tuple[Floats, bool]:
    """lambda (C,) with the same rows^T lambda, no less than 0 after the first `equalities`, of least norm in the mass
    metric, and whether it is the only one: the same as in a run. rows (C, n), M (n, n)."""
    white = in_metric(rows, M)
    size = np.linalg.norm(white, axis=1)
    unit = np.asarray(white / np.where(size > 0, size, 1.0)[:, None])
    shared, same = complementarity.shared(unit, lam * size, equalities)
    return np.asarray(np.divide(shared, size, out=np.zeros_like(lam), where=size > 0)), bool(same.all())
