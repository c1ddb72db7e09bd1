"""`lagcli.equilibrium` and `lagcli.stationary`: points of rest, and stationary points of a function on surfaces."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from lagcli import progress
from lagcli.analysis import redundancy
from lagcli.analysis.classification import classify
from lagcli.api import cache, run_settings
from lagcli.api.cache import CompiledModel
from lagcli.api.load import Path, as_model
from lagcli.arrays import Floats
from lagcli.equations import jump_warnings, level_functions
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.input import given_expression
from lagcli.linear import rank
from lagcli.model.invariant import LevelFunction
from lagcli.model.model import Model
from lagcli.start import assembly, initial
from lagcli.start.initial import State
from lagcli.statics import (
    all_zeros,
    kink_points,
    point_search,
    refine,
    rest_equations,
    static_problem,
    static_report,
)
from lagcli.statics.continuum import FoundPoint
from lagcli.statics.point_search import PointSearch, SearchOptions
from lagcli.statics.rest_equations import EquilibriumPoint, RestEquations
from lagcli.statics.static_problem import EnforcedLevel, StaticLaws, StaticProblem
from lagcli.statics.static_report import Origin, PointColumns, StaticPoint, StaticReport, Value

STARTS, SEED, MOST_STARTS = 32, 0, 100_000  # the first two by default
MODERATE = 1e4  # levels of this size are not measured by it
SMALLEST = float(np.sqrt(np.finfo(float).tiny))  # what is smaller has no square


@dataclasses.dataclass(frozen=True, slots=True)
class StaticStart:
    """A consistent start for searches, and the levels of the integrals through it.

    enforced: the differential rows whose integrals are enforced, by name; duration: of the runs of the model.
    """

    state: State
    invariant_values: tuple[EnforcedLevel, ...]
    enforced: tuple[str, ...]
    notes: tuple[str, ...]
    duration: float

    def problem(self, laws: StaticLaws) -> StaticProblem:
        """The equations at numbers, with the values of the model."""
        return StaticProblem(laws, self.state.p, (self.state.t, self.state.q), self.duration)


@progress.phase("looking for a consistent start")
def begin(ready: CompiledModel, limit: float | None = None) -> StaticStart:
    """The consistent configuration nearest to the declared start. Raises `ModelError` where there is none."""
    limit = run_settings.seconds(limit)
    built, numeric = ready.system, ready.numeric
    declared = initial.declared(built)
    declared = dataclasses.replace(declared, v=np.zeros(declared.v.size))
    try:
        state = assembly.configuration(built, numeric, declared)
    except diagnostics.ModelError as error:
        if not classify.is_conflict(error):
            raise
        case = classify.classified(built, numeric, limit).case
        state = assembly.configuration(case.system, case.numeric, declared)
    state = dataclasses.replace(state, v=declared.v)
    redundancy.require_clear(built, numeric, state)
    known = ready.first_integrals(limit)
    invariant_values: list[EnforcedLevel] = []
    enforced: list[str] = []
    notes = [
        *cache.violation_notes(ready, "the search begins at"),
        *known.notes,
        *jump_warnings.out_of_sight(built),
    ]
    for integral in known.integrals:
        chart = _chart(built, integral.charts, state)
        if chart is None:
            notes.append(f"the integral {integral.text} is not enforced: no form of it serves at the start")
        else:
            invariant_values.append(chart)
            enforced += integral.rows
    duration = built.model.simulation.duration
    return StaticStart(state, tuple(invariant_values), tuple(dict.fromkeys(enforced)), tuple(notes), duration)


class RestPoints:
    """Points of rest of a model, from its start (D.25). Raises `ModelError` where no configuration satisfies rows."""

    def __init__(self, ready: CompiledModel, limit: float | None = None) -> None:
        self._ready, self._limit = ready, limit

    @cached_property
    def _start(self) -> StaticStart:
        return begin(self._ready, self._limit)

    @cached_property
    def _asked(self) -> StaticProblem:
        laws = static_problem.laws(self._ready.system, self._start.invariant_values)
        return self._start.problem(laws)

    @cached_property
    def _origin(self) -> Origin:
        return static_report.potential_origin(self._asked)

    @progress.phase("looking for a point of rest")
    def nearest(self) -> EquilibriumPoint:
        """The point of rest nearest to the start: lambda and contacts with it.

        Of two, the one that Newton's steps lead to and, where the forces have a potential, the one that lies downhill,
        the nearer in the metric.
        """
        asked, begun = self._asked, self._start.state
        q = begun.q
        falls = self._origin == "declared"
        is_large = falls and asked.is_large
        found = [refine.nearest_equilibrium(asked, q, () if is_large else refine.OFFSETS)]
        if falls:
            equations = RestEquations(asked, (), rest_equations.scales(asked, q))
            bottom = refine.lowest(equations, q, 1.0)
            if bottom is not None:
                found.append(refine.nearest_equilibrium(asked, bottom))
        if is_large and not any(one.rests for one in found):
            found.append(refine.nearest_equilibrium(asked, q))
        points = [one.point for one in self._typed(found, falls)]
        if not points:
            return dataclasses.replace(found[0], rests=False)
        M = self._ready.numeric.inertia(begun.t, q, np.zeros_like(q), begun.p).full()
        return min(points, key=lambda point: float((point.q - q) @ M @ (point.q - q)))

    def typed(self, q: Floats, closed: tuple[int, ...]) -> FoundPoint | None:
        """The point of rest at a configuration (n,) with its type, where curvatures vanish to more digits; None where
        it is none, and where numbers are too large or too small. closed: the contacts that press there."""
        try:
            scales = rest_equations.scales(self._asked, self._start.state.q)
        except diagnostics.ModelError:
            return None
        equations = RestEquations(self._asked, closed, scales)
        x = equations.begun(q)
        if x is None:
            return None
        found = equations.settled(x)
        return next(self._typed([found], self._origin != "none"), None)

    def _typed(self, found: Sequence[EquilibriumPoint], has_potential: bool) -> Iterator[FoundPoint]:
        asked = self._asked
        for one in found:
            if one.rests:
                equations = RestEquations(asked, one.closed, rest_equations.scales(asked, asked.begin))
                point = point_search.typed_point(equations, one, has_potential)
                if point is not None:
                    yield point


def _chart(built: System, written: tuple[LevelFunction, ...], state: State) -> EnforcedLevel | None:
    """The first chart that has finite values at a state, and a gradient whose square is a number."""
    for chart in level_functions.charts(built, written).charts:
        value = level_functions.compiled(built, [chart])(state.t, state.q, state.p)
        (above, below), period = value[0].full()[0], float(value[3])
        size = 1.0 if period else float(np.hypot(above, below))
        if 1 / MODERATE < size < MODERATE:
            size = 1.0  # numbers that were written stay so, for exact algebra
        gradient = value[1].full() * below - value[2].full() * above if not period else value[1].full()
        steepest = float(np.abs(gradient).max()) / size if size else 0.0
        is_number = SMALLEST < steepest < 1 / SMALLEST
        if np.isfinite([above, below, *gradient.ravel()]).all() and is_number:
            return EnforcedLevel(chart, above / size, below / size)
    return None


@progress.phase("looking for points of rest")
def equilibrium(
    model: Model | Path, *, starts: int = STARTS, seed: int = SEED, limit: float | None = None
) -> StaticReport:
    """Return the points of rest (D.25): q' = q'' = 0 satisfies the equations of motion at every t.

    With multipliers, constraint forces, the effective potential and the type by the bordered Hessian; contacts push.
    From the declared start and from `starts` others, the same for one `seed`; `limit` is the seconds to find the first
    integrals of differential rows, whose leaf through the start is fixed. Raises `ModelError`, `ValueError`.
    """
    _require(starts, seed)
    model = as_model(model)
    ready = cache.compiled(model)
    start = begin(ready, limit)
    laws = static_problem.laws(ready.system, start.invariant_values)
    rows = list(range(len(ready.system.rows.rows)))
    return _Question(ready, "potential", start.problem(laws), rows).answered(start.notes, starts, seed)


@progress.phase("looking for stationary points")
def stationary(
    model: Model | Path, of: str, *, starts: int = STARTS, seed: int = SEED, limit: float | None = None
) -> StaticReport:
    """Return the stationary points of `of`, an expression of positions and coordinates: grad f = sum lambda_i grad f_i
    (D.25).

    Masses and forces play no part; integrable differential rows count as their leaf through the start, nonholonomic
    ones are left out; closed inequalities push or pull. Other arguments as of `equilibrium`. Raises `ModelError`, for
    what is wrong with `of` too, and `ValueError`.
    """
    _require(starts, seed)
    model = as_model(model)
    written = given_expression.function(model, of, "--of")
    ready = cache.compiled(model)
    start = begin(ready, limit)
    system = ready.system
    laws = static_problem.laws(system, start.invariant_values, level_functions.value(system, written))
    names = [row.name for row in system.rows.rows]
    left_out = [name for name in names[system.holonomic_count :] if name not in start.enforced]
    rows = [i for i, name in enumerate(names) if name not in left_out]
    notes = start.notes
    if left_out:
        listed = ", ".join(f"`{name}`" for name in left_out)
        notes += (f"{listed} cannot be integrated and {'are' if len(left_out) > 1 else 'is'} left out",)
    return _Question(ready, "value", start.problem(laws), rows).answered(notes, starts, seed)


def _require(starts: int, seed: int) -> None:
    """Raise `ValueError` for a number of starts, or a seed, that is none."""
    if not 0 <= starts <= MOST_STARTS:
        raise ValueError(f"starts: a number from 0 to {MOST_STARTS} is needed")
    if seed < 0:
        raise ValueError("seed: a number that is not negative is needed")


class _Question:
    """A question for points: `called` says which; rows: the equality rows that have multipliers, by their numbers."""

    def __init__(self, ready: CompiledModel, called: Value, problem: StaticProblem, rows: list[int]) -> None:
        self._system, self._numeric = ready.system, ready.numeric
        self._called, self._problem, self._rows = called, problem, rows
        self._is_rest = called == "potential"
        self._source: Origin = static_report.potential_origin(problem) if self._is_rest else "declared"
        self._columns = PointColumns(ready.system, problem.t, problem.p)

    @progress.phase("looking for points")
    def answered(self, notes: Sequence[str], starts: int, seed: int) -> StaticReport:
        """The points that are found, by the columns of the model, with more notes after these."""
        problem, called, names = self._problem, self._called, self._system.model.coordinate_names
        angles, repeating = static_problem.angles(problem, self._system.r)
        options = SearchOptions(self._source != "none", self._is_rest, angles, seed, repeating)
        search = PointSearch(problem, options)
        search.run(0)
        whole = all_zeros.by_algebra(search)
        if not whole.proved and problem.n == 1 and not problem.C and not problem.K:
            whole = all_zeros.by_intervals(search)
        if not whole.proved and not whole.final:
            search.run(starts)
        kinks = kink_points.notes(search, names, called)
        points = [self._point(found) for found in search.points]
        told = [*notes, *self._remarks(search, points, starts)]
        if points and (turning := " and ".join(itertools.compress(names, repeating))):
            told.append(
                f"points repeat with every turn of {turning}, by 2 pi: those next to the start are listed"
            )
        if whole.told:
            told.append(whole.told)
        told += [*kink_points.singular_notes(search, names, called), *kinks]
        points.sort(key=lambda point: (point.value is None, point.value or 0.0, tuple(point.at.values())))
        best = search.best_residual if not points else None
        distinct = tuple(dict.fromkeys(told))
        return StaticReport(called, tuple(points), search.starts, whole.proved, distinct, best)

    def _point(self, found: FoundPoint) -> StaticPoint:
        columns, q = self._columns, found.point.q
        lam, unique = self._multipliers(found)
        names = [row.name for row in self._system.multiplier_rows]
        shown = [*self._rows, *range(len(self._system.rows.rows), len(names))]
        value = (
            static_report.potential(self._problem, self._source, q)
            if self._is_rest
            else self._problem.value(q) + 0.0
        )
        return StaticPoint(
            columns.at(q),
            {names[i]: float(lam[i]) + 0.0 for i in shown},
            columns.reactions(q, lam, are_of_rows=not self._is_rest),
            value,
            found.type.kind,
            found.type.index,
            found.point.residual,
            unique,
            found.dimension,
        )

    def _multipliers(self, found: FoundPoint) -> tuple[Floats, bool | None]:
        """lambda of all rows of the system (C + K,): as found, or where they are not unique those of least norm, as in
        a run; and whether they are, None where the rank of the rows does not say."""
        problem, point, t = self._problem, found.point, self._problem.t
        count, s = len(self._system.rows.rows), self._system.holonomic_count
        is_own = self._is_rest or len(self._rows) == s == problem.C
        lam = np.zeros(count + problem.K)
        if is_own and found.type.unique is not False:
            lam[self._rows] = point.lam[: problem.C]
            lam[count:] = point.lam[problem.C :]
            if found.touching == point.closed:
                return lam, found.type.unique
        unique: bool | None
        values = problem.at(t, point.q, point.lam)
        v = np.zeros(problem.n)
        B = self._numeric.rows(t, point.q, v, problem.p)[0].full()[self._rows]
        closed = list(found.touching if self._is_rest else point.closed)
        rows = np.vstack([B, values.G[closed]])
        M = self._numeric.inertia(t, point.q, v, problem.p).full()
        if self._is_rest and closed:
            given = point.lam[problem.acting(closed)]
            shared, unique = static_report.pushing_multipliers(rows, given, M, len(B))
        else:
            unique = found.type.unique
            lengths = np.linalg.norm(static_report.in_metric(rows, M), axis=1)
            shared = rank.multipliers(rows, -values.F, lengths)
        lam[self._rows] = shared[: len(B)]
        lam[[count + k for k in closed]] = shared[len(B) :]
        return lam, unique

    def _remarks(self, search: PointSearch, points: Sequence[StaticPoint], starts: int) -> Iterator[str]:
        """Notes on what was found and what was not looked for."""
        if self._source == "integrated":
            yield "forces that are declared without a potential have one; it is counted from the start"
        elif self._source == "none":
            yield "the forces have no potential: points have no type"
        for size in sorted({one.dimension for one in search.points if one.dimension}):
            count = sum(one.dimension == size for one in search.points)
            what = "one point stands for a continuum" if count == 1 else f"{count} points stand for continua"
            yield f"{what} of dimension {size}"
        near = sum(point.unique_multipliers is None for point in points)
        if near:
            yield (
                f"{'one point is' if near == 1 else f'{near} points are'} so near to where rows are dependent that"
                " their rank is undecided there: multipliers may have no right digit, and be unique or not"
            )
        if any(point.unique_multipliers is False for point in points):
            yield "multipliers that are not unique are those of least norm, as in a run"
        if len(search.problem.times) > 1:
            t = search.problem.t
            yield f"the equations hold t: points hold at every t that was looked at, lambda is that of t = {t:g}"
        if search.are_beyond:
            yield (
                "points beyond the singular points of a differential row are left out: they are on another leaf than"
                " the start"
            )
        if search.is_cut:
            ends = "" if search.starts > starts else f", after {search.starts} of {starts + 1} starts"
            yield f"the search ended at its budget of work{ends}"
