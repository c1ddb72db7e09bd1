"""`lagcli.equilibrium` and `lagcli.stationary`: points of rest, and stationary points of a function on surfaces."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.api import rest_point
from lagcli.api.models import cache
from lagcli.api.models.cache import CompiledModel
from lagcli.api.models.load import Path, as_model
from lagcli.api.rest_point import StaticStart
from lagcli.equations import level_functions
from lagcli.input import given_expression
from lagcli.linear import rank
from lagcli.model.model import Model
from lagcli.statics import all_zeros, kink_points, singular_rows, static_problem, static_report
from lagcli.statics.continuum import FoundPoint
from lagcli.statics.point_search import PointSearch, SearchOptions
from lagcli.statics.static_problem import StaticProblem
from lagcli.statics.static_report import Origin, PointColumns, StaticPoint, StaticReport, Value

Floats = npt.NDArray[np.float64]

STARTS, SEED, MOST_STARTS = 32, 0, 100_000  # the first two by default


@dataclasses.dataclass(frozen=True, slots=True)
class StaticQuestion:
    """A question for points: `called` says which, rows: the equality rows that have multipliers, by their numbers."""

    called: Value
    problem: StaticProblem
    start: StaticStart
    rows: tuple[int, ...]
    notes: tuple[str, ...]


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
    start = rest_point.begin(ready, limit)
    laws = static_problem.of_rest(ready.system, start.invariant_values)
    problem = rest_point.problem(ready, laws, start)
    rows = tuple(range(len(ready.system.rows.rows)))
    return _answered(ready, StaticQuestion("potential", problem, start, rows, ()), starts, seed)


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
    start = rest_point.begin(ready, limit)
    laws = static_problem.of_function(
        ready.system, level_functions.value(ready.system, written), start.invariant_values
    )
    problem = rest_point.problem(ready, laws, start)
    system = ready.system
    names = [row.name for row in system.rows.rows]
    left_out = [name for name in names[system.holonomic_count :] if name not in start.enforced]
    rows = tuple(i for i, name in enumerate(names) if name not in left_out)
    notes: tuple[str, ...] = ()
    if left_out:
        listed = ", ".join(f"`{name}`" for name in left_out)
        notes = (f"{listed} cannot be integrated and {'are' if len(left_out) > 1 else 'is'} left out",)
    return _answered(ready, StaticQuestion("value", problem, start, rows, notes), starts, seed)


def _require(starts: int, seed: int) -> None:
    """Raise `ValueError` for a number of starts, or a seed, that is none."""
    if not 0 <= starts <= MOST_STARTS:
        raise ValueError(f"starts: a number from 0 to {MOST_STARTS} is needed")
    if seed < 0:
        raise ValueError("seed: a number that is not negative is needed")


@progress.phase("looking for points")
def _answered(ready: CompiledModel, asked: StaticQuestion, starts: int, seed: int) -> StaticReport:
    """The points that are found, by the columns of the model."""
    problem = asked.problem
    source: Origin = "declared"
    if asked.called == "potential":
        source = static_report.potential_origin(problem)
    angles = static_problem.angles(problem)
    repeating = static_problem.repeating(problem, ready.system.r)
    pushes = asked.called == "potential"
    search = PointSearch(problem, SearchOptions(source != "none", pushes, angles, starts, seed, repeating))
    search.run(0)
    whole = all_zeros.by_algebra(search)
    if not whole.proved and problem.n == 1 and not problem.C and not problem.K:
        whole = all_zeros.by_intervals(search, angles[0])
    if not whole.proved and not whole.final:
        search.run(starts)
    columns = PointColumns(ready.system, problem.t, problem.p)
    kinks = kink_points.notes(search, ready.system.model.coordinate_names, asked.called)
    points = [_point(ready, asked, columns, source, found) for found in search.points]
    notes = [*asked.start.notes, *asked.notes, *_remarks(search, source, points, starts)]
    turning = itertools.compress(ready.system.model.coordinate_names, repeating)
    if points and (names := " and ".join(turning)):
        notes.append(f"points repeat with every turn of {names}, by 2 pi: those next to the start are listed")
    if whole.is_told:
        notes.append(whole.reason)
    notes += singular_rows.notes(search, ready.system.model.coordinate_names, asked.called)
    notes += kinks
    points.sort(key=lambda point: (point.value is None, point.value or 0.0, tuple(point.at.values())))
    best = search.best.residual if not points else None
    distinct = tuple(dict.fromkeys(notes))
    return StaticReport(asked.called, tuple(points), search.starts, whole.proved, distinct, best)


def _point(
    ready: CompiledModel, asked: StaticQuestion, columns: PointColumns, source: Origin, found: FoundPoint
) -> StaticPoint:
    system, q = ready.system, found.point.q
    lam, unique = _multipliers(ready, asked, found)
    names = [row.name for row in system.multiplier_rows]
    count = len(system.rows.rows)
    shown = [*asked.rows, *range(count, len(names))]
    is_rest = asked.called == "potential"
    reactions = columns.reactions(q, lam) if is_rest else columns.row_reactions(q, lam)
    value = static_report.potential(asked.problem, source, q) if is_rest else asked.problem.value(q) + 0.0
    return StaticPoint(
        columns.at(q),
        {names[i]: float(lam[i]) + 0.0 for i in shown},
        reactions,
        value,
        found.type.kind,
        found.type.index,
        found.point.residual,
        unique,
        found.dimension,
    )


def _multipliers(
    ready: CompiledModel, asked: StaticQuestion, found: FoundPoint
) -> tuple[Floats, bool | None]:
    """lambda of all rows of the system (C + K,): as found, or where they are not unique those of least norm, as in a
    run; and whether they are, None where the rank of the rows does not say."""
    problem, point, t = asked.problem, found.point, asked.problem.t
    system, numeric = ready.system, ready.numeric
    count, s = len(system.rows.rows), system.holonomic_count
    is_own = asked.called == "potential" or len(asked.rows) == s == problem.C
    lam = np.zeros(count + problem.K)
    if is_own and found.type.unique is not False:
        lam[list(asked.rows)] = point.lam[: problem.C]
        lam[count:] = point.lam[problem.C :]
        if found.touching == point.closed:
            return lam, found.type.unique
    unique: bool | None
    values = problem.at(t, point.q, point.lam)
    v = np.zeros(problem.n)
    B = numeric.rows(t, point.q, v, problem.p)[0].full()[list(asked.rows)]
    closed = list(found.touching if asked.called == "potential" else point.closed)
    rows = np.vstack([B, values.G[closed]])
    M = numeric.inertia(t, point.q, v, problem.p).full()
    if asked.called == "potential" and closed:
        given = point.lam[[*range(problem.C), *(problem.C + k for k in closed)]]
        shared, unique = static_report.pushing_multipliers(rows, given, M, len(B))
    else:
        unique = found.type.unique
        shared = rank.multipliers(rows, -values.F, static_report.row_lengths(rows, M))
    lam[list(asked.rows)] = shared[: len(B)]
    lam[[count + k for k in closed]] = shared[len(B) :]
    return lam, unique


def _remarks(
    search: PointSearch, source: Origin, points: Sequence[StaticPoint], starts: int
) -> Iterator[str]:
    """Notes on what was found and what was not looked for."""
    if source == "integrated":
        yield "forces that are declared without a potential have one; it is counted from the start"
    elif source == "none":
        yield "the forces have no potential: points have no type"
    sizes = sorted({one.dimension for one in search.points if one.dimension})
    for size in sizes:
        count = sum(one.dimension == size for one in search.points)
        what = "one point stands for a continuum" if count == 1 else f"{count} points stand for continua"
        yield f"{what} of dimension {size}"
    near = sum(point.unique_multipliers is None for point in points)
    if near:
        yield (
            f"{'one point is' if near == 1 else f'{near} points are'} so near to where rows are dependent that their"
            " rank is undecided there: multipliers may have no right digit, and be unique or not"
        )
    if any(point.unique_multipliers is False for point in points):
        yield "multipliers that are not unique are those of least norm, as in a run"
    if len(search.problem.times) > 1:
        t = search.problem.t
        yield f"the equations hold t: points hold at every t that was looked at, lambda is that of t = {t:g}"
    if search.are_beyond:
        yield (
            "points beyond the singular points of a differential row are left out: they are on another leaf than the"
            " start"
        )
    if search.is_cut:
        ends = "" if search.starts > starts else f", after {search.starts} of {starts + 1} starts"
        yield f"the search ended at its budget of work{ends}"
