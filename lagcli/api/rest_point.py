"""The point of rest next to a model's start, for commands that begin there."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.analysis import redundancy
from lagcli.analysis.classification import classify
from lagcli.api import assemble_start
from lagcli.api.models.cache import CompiledModel
from lagcli.api.runs import run_settings
from lagcli.equations import jump_warnings, level_functions
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.model.invariant import LevelFunction
from lagcli.start import assembly, initial
from lagcli.start.initial import State
from lagcli.statics import further_zeros, point_search, refine, rest_equations, static_problem, static_report
from lagcli.statics.continuum import FoundPoint
from lagcli.statics.refine import EquilibriumPoint, NoEquilibrium
from lagcli.statics.rest_equations import RestEquations
from lagcli.statics.static_problem import EnforcedLevel, StaticLaws, StaticProblem
from lagcli.statics.static_report import Origin

Floats = npt.NDArray[np.float64]

MODERATE = 1e4  # levels of this size are not measured by it
SMALLEST = float(np.sqrt(np.finfo(float).tiny))  # what is smaller has no square


@dataclasses.dataclass(frozen=True, slots=True)
class StaticStart:
    """A consistent start for searches, the levels of the integrals through it, and notes on those that are not
    enforced.

    enforced: the differential rows whose integrals are enforced, by name.
    """

    state: State
    invariant_values: tuple[EnforcedLevel, ...]
    enforced: tuple[str, ...]
    notes: tuple[str, ...]


@progress.phase("looking for a consistent start")
def begin(ready: CompiledModel, limit: float | None = None) -> StaticStart:
    """The nearest consistent configuration to the declared start. Raises `diagnostics.ModelError` where there is
    none."""
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
        *assemble_start.notes(ready, "the search begins at"),
        *known.notes,
        *jump_warnings.out_of_sight(built),
    ]
    for integral in known.integrals:
        chart = next((c for c in _charts(built, integral.charts, state)), None)
        if chart is None:
            notes.append(f"the integral {integral.text} is not enforced: no form of it serves at the start")
        else:
            invariant_values.append(chart)
            enforced += integral.rows
    return StaticStart(state, tuple(invariant_values), tuple(dict.fromkeys(enforced)), tuple(notes))


def problem(ready: CompiledModel, laws: StaticLaws, start: StaticStart) -> StaticProblem:
    """The equations at numbers, with the values of the model."""
    state = start.state
    return StaticProblem(laws, state.p, (state.t, state.q), ready.system.model.simulation.duration)


class RestPoints:
    """Points of rest of a model, from its start (D.25). Raises `diagnostics.ModelError` where no configuration
    satisfies the rows. limit: seconds for first integrals."""

    def __init__(self, ready: CompiledModel, limit: float | None = None) -> None:
        self._ready, self._limit = ready, limit

    @cached_property
    def _start(self) -> StaticStart:
        return begin(self._ready, self._limit)

    @cached_property
    def _asked(self) -> StaticProblem:
        laws = static_problem.of_rest(self._ready.system, self._start.invariant_values)
        return problem(self._ready, laws, self._start)

    @cached_property
    def _origin(self) -> Origin:
        return static_report.potential_origin(self._asked)

    @progress.phase("looking for a point of rest")
    def nearest(self) -> EquilibriumPoint | NoEquilibrium:
        """The point of rest nearest to the start: lambda and contacts with it.

        Of two, the one that Newton's steps lead to and, where the forces have a potential, the one that lies downhill,
        the nearer in the metric.
        """
        asked, begun = self._asked, self._start.state
        q = begun.q
        falls = self._origin == "declared"
        is_large = falls and asked.n + asked.C > refine.PARAMETERS.large
        found = [refine.nearest_equilibrium(asked, q, () if is_large else refine.PARAMETERS.offset)]
        if falls:
            equations = RestEquations(asked, (), rest_equations.scales(asked, q))
            bottom = further_zeros.lowest(equations, q, 1.0)
            if bottom is not None:
                found.append(refine.nearest_equilibrium(asked, bottom))
        if is_large and not any(isinstance(one, EquilibriumPoint) for one in found):
            found.append(refine.nearest_equilibrium(asked, q))
        points = [one.point for one in _typed(asked, found, falls)]
        if not points:
            first = found[0]
            return first if isinstance(first, NoEquilibrium) else NoEquilibrium(first.residual, first.q)
        M = self._ready.numeric.inertia(begun.t, q, np.zeros_like(q), begun.p).full()
        return min(points, key=lambda point: float((point.q - q) @ M @ (point.q - q)))

    def typed(self, q: Floats, closed: tuple[int, ...]) -> FoundPoint | None:
        """The point of rest at a configuration (n,) with its type, where curvatures vanish to more digits; closed: the
        contacts that press there. None where it is none, and where numbers are too large or too small to look at
        it."""
        try:
            scales = rest_equations.scales(self._asked, self._start.state.q)
        except diagnostics.ModelError:
            return None
        equations = RestEquations(self._asked, closed, scales)
        x = refine.begun(equations, q)
        if x is None:
            return None
        found = refine.settled(equations, x)
        return next(_typed(self._asked, [found], self._origin != "none"), None)


def _typed(
    asked: StaticProblem, found: Sequence[EquilibriumPoint | NoEquilibrium], has_potential: bool
) -> Iterator[FoundPoint]:
    for one in found:
        if isinstance(one, EquilibriumPoint):
            point = point_search.typed_point(
                asked, one, rest_equations.scales(asked, asked.begin), has_potential
            )
            if point is not None:
                yield point


def _charts(built: System, written: tuple[LevelFunction, ...], state: State) -> list[EnforcedLevel]:
    """The charts that have finite values at a state, and a gradient whose square is a number."""
    found = []
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
            found.append(EnforcedLevel(chart, above / size, below / size))
    return found
