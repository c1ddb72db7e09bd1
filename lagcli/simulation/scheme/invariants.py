"""First integrals of differential rows that a run holds, each in one of its charts (D.3).

A chart serves while its level g = 0 is finite, with a gradient that neither vanishes nor depends on those of the
holonomic rows and of the integrals before it. Else another chart is taken, or the integral is left to its velocity row,
which keeps it to the tolerance. Either is noted, never silent.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.equations import level_functions
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.linear import decompositions, independent_rows, metric_rows
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.memory import Memory
from lagcli.model.invariant import FirstIntegral
from lagcli.simulation.scheme import step_tolerance
from lagcli.simulation.scheme.method import Method, Scheme
from lagcli.simulation.scheme.step_end import Compiled
from lagcli.start import initial, projection
from lagcli.start.initial import State

# The gradient of a level is taken as vanishing where it changes by BENT of itself within `doubles.ROOT` of each
# coordinate and `doubles.ZERO` of the largest: Newton's steps from nearby would not reach the level.
BENT = 0.1
# Points beside a state, at this part of its size, on which a dependence of gradients is looked for again: one that
# holds there too is no accident of the state.
BESIDE, POINTS = 1e-2, 2
DEPENDS = "it depends on other constraints"
NO_FORM = "no form of it without poles or jumps is known"


class InvariantValue(NamedTuple):
    """The surface on which an integral is enforced: its chart, and what above and below were, both divided by their
    hypotenuse but for a chart with a period."""

    chart: int
    above: float
    below: float


InvariantValues = tuple[InvariantValue | None, ...]
Tried = frozenset[tuple[int, int]]  # integrals and their charts


class RunFunctions:
    """Compiled functions of a system, with those of a method built when a run first asks for them; steps: how many
    were made with them."""

    def __init__(self, numeric: NumericSystem, memory: Memory | None = None) -> None:
        self.numeric = numeric
        self.memory, self.steps = Memory() if memory is None else memory, 0

    def scheme(self, method: Method) -> Scheme:
        """The compiled step and dense output of a method."""
        return self.memory.answer(method.name, lambda: Scheme(method, self.numeric))


class Integrals:
    """The integrals of one system, and its functions with any choice of their charts. selection: the independent rows
    that it is stepped with. Raises as `level_functions.charts` where a chart is no expression of the system."""

    def __init__(self, system: System, plain: RunFunctions, found: tuple[FirstIntegral, ...]) -> None:
        self.found = found
        self.system, self._plain = system, plain
        self._first_plain = plain.numeric
        self._first = np.cumsum([0, *(len(f.charts) for f in found)]).tolist()
        self._charts = level_functions.charts(system, [chart for f in found for chart in f.charts])
        self.selection = plain.numeric.selection
        # What was built for each selection, choice of charts and stepped system; not the integrals themselves, which
        # would hold each other.
        self._memory = Memory()

    def hold_for(self, system: System) -> bool:
        """True if all that was built holds for other values of parameters too."""
        return self._charts.hold_for(system)

    def of(self, system: System) -> Integrals:
        """The integrals with all that was built of a system that has other values alone."""
        if system is self.system:
            return self
        other = copy.copy(self)
        other.system = system
        return other

    def keeping(self, selection: Selection) -> Integrals:
        """The integrals with a system stepped with other independent rows."""
        if selection == self.selection:
            return self

        def build() -> RunFunctions:
            numeric = self._first_plain.switching(selection)
            return RunFunctions(numeric, self._memory.answer(("schemes", numeric.stepped), Memory))

        other = copy.copy(self)
        other.selection, other._plain = selection, self._memory.answer(("functions", selection), build)
        return other

    @cached_property
    def has_time(self) -> bool:
        """True if t occurs in what moves the system, in a chart of an integral, or in a declared event."""
        charts = self._charts.charts
        return self._plain.numeric.has_time or level_functions.have_time(self.system, charts)

    def functions(self, invariant_values: InvariantValues) -> RunFunctions:
        """The functions of the system with these levels enforced."""
        choice = tuple(None if level is None else level.chart for level in invariant_values)
        taken = [self._charts.charts[self._first[i] + c] for i, c in enumerate(choice) if c is not None]
        if not taken:
            return self._plain
        return self._memory.answer(
            ("levels", self.selection, choice), lambda: RunFunctions(self._plain.numeric.holding(taken))
        )

    def at(self, state: State) -> _Forms:
        """All charts at a state."""
        return _Forms(self._plain.numeric, self._evaluate, self._first, state)

    @cached_property
    def _evaluate(self) -> Compiled:
        function: Compiled = level_functions.compiled(self.system, self._charts.charts)
        return function


# Above and below (K, 2), their gradients, and periods (K,), of all charts.
_Read = tuple[Floats, Sparse, Sparse, Floats]


class _Forms:
    """The charts of all integrals at one state: their levels, gradients, faults and dependences."""

    def __init__(
        self, numeric: NumericSystem, evaluate: Compiled, first: Sequence[int], state: State
    ) -> None:
        self._numeric, self._first, self._state = numeric, first, state
        sizes = doubles.ROOT * np.abs(state.q) + doubles.ZERO * (np.abs(state.q).max(initial=0.0) or 1.0)
        beside = state.q + sizes * decompositions.generic_direction(state.q.size, 0)
        read = [evaluate(state.t, q, state.p) for q in (state.q, beside)]
        self._here, self._beside = (
            (np.array(values), above, below, np.array(periods).ravel())
            for values, above, below, periods in read
        )

    def level(self, i: int, chart: int) -> InvariantValue:
        """The level of integral i through the state, in one of its charts."""
        k = self._first[i] + chart
        above, below = self._here[0][k].tolist()
        size = 1.0 if self._here[3][k] else math.hypot(above, below) or math.nan
        return InvariantValue(chart, above / size, below / size)

    def _gradient(self, read: _Read, k: int, level: InvariantValue) -> Sparse:
        _, above, below, periods = read
        if periods[k]:
            return above[k, :]
        return above[k, :] * level.below - below[k, :] * level.above

    def fault(self, i: int, level: InvariantValue) -> str:
        """The reason why integral i cannot be enforced on a level at the state; empty where it can."""
        k = self._first[i] + level.chart
        here = self._gradient(self._here, k, level)
        numbers = [*self._here[0][k].tolist(), level.above, level.below, *here.nonzeros()]
        if not np.isfinite(numbers).all():
            return "it has no finite form"
        beside = self._gradient(self._beside, k, level)
        size, change = (float(np.linalg.norm(LocalRows(row).values)) for row in (here, beside - here))
        return "" if change < BENT * size else "its gradient vanishes"

    def dependent(self, taken: Iterable[tuple[int, InvariantValue]]) -> list[int]:
        """The integrals with a gradient that depends on the independent holonomic rows and on those before it."""
        state, numeric, numbers, gradients = self._state, self._numeric, [], []
        for i, level in taken:
            numbers.append(i)
            gradients.append(self._gradient(self._here, self._first[i] + level.chart, level))
        B = numeric.holonomic(state.t, state.q, state.p)[1]
        holonomic: Sparse = B[[i for i in numeric.selection.independent if i < B.shape[0]], :]
        s = holonomic.shape[0]
        rows = MetricRows(metric_rows.stacked(holonomic, *gradients), initial.metric_at(numeric, state))
        if rows.are_independent:
            return []
        if not rows.is_large:
            return [i for i, flag in zip(numbers, independent_rows.redundant(rows)[s:], strict=True) if flag]
        dependent: list[int] = []
        good = list(range(s))
        for row, i in enumerate(numbers, start=s):
            if rows.take([*good, row]).are_independent:
                good.append(row)
            else:
                dependent.append(i)
        return dependent


@frozen
class EnforcedInvariants:
    """The integrals that a run enforces: a level of each, or None where its velocity row alone keeps it; p: the
    parameters."""

    integrals: Integrals
    invariant_values: InvariantValues
    p: Floats

    @property
    def functions(self) -> RunFunctions:
        """The functions of the system with these levels enforced."""
        return self.integrals.functions(self.invariant_values)

    @property
    def system(self) -> System:
        """The system they are of."""
        return self.integrals.system

    @property
    def selection(self) -> Selection:
        """The independent rows it is stepped with."""
        return self.integrals.selection

    def keeping(self, selection: Selection) -> EnforcedInvariants:
        """The invariants with a system stepped with other independent rows."""
        return dataclasses.replace(self, integrals=self.integrals.keeping(selection))

    @cached_property
    def resting_forces(self) -> step_tolerance.RestingForces:
        """The forces at the declared start."""
        return step_tolerance.resting_forces(self.system, self.functions.numeric)

    @property
    def has_time(self) -> bool:
        """True if t occurs in what moves the system or in an event; it does not depend on what is enforced."""
        return self.integrals.has_time

    @property
    def plain(self) -> EnforcedInvariants:
        """The invariants with none enforced."""
        if not self.is_any:
            return self
        return dataclasses.replace(self, invariant_values=(None,) * len(self.invariant_values))

    @property
    def is_any(self) -> bool:
        """True if any integral is enforced."""
        return any(level is not None for level in self.invariant_values)

    @property
    def parameters(self) -> Floats:
        """p with the switches of contacts and the constants of the levels: what the functions take."""
        constants = [
            x for level in self.invariant_values if level is not None for x in (level.above, level.below)
        ]
        return np.concatenate([self.p, self.functions.numeric.switches, constants])


def begin(found: Integrals, state: State) -> tuple[EnforcedInvariants, tuple[str, ...]]:
    """The integrals that can be enforced from a start, each in the best chart that serves; notes on the others."""
    number = len(found.found)
    values, reasons = _chosen(found, [state], (None,) * number, range(number))
    notes = tuple(
        f"the integral {integral.text} is not enforced: {why}; {_left_to_rows(integral)}"
        for integral, why in zip(found.found, reasons, strict=True)
        if why
    )
    return EnforcedInvariants(found, values, state.p), notes


def let_go(
    enforced: EnforcedInvariants, state: State, ahead: State, tried: Tried
) -> tuple[EnforcedInvariants, tuple[str, ...], Tried]:
    """Release the levels that do not lead from a state to one ahead, with other charts where they do. `ahead` is where
    the system without integrals would go, in a step in which the levels enforced failed. `tried`: charts that failed in
    this step before, given back with those that do now."""
    forms, taken = enforced.integrals.at(ahead), list(_taken(enforced.invariant_values))
    guilty = {i for i, level in taken if forms.fault(i, level)}
    if not guilty:
        # All are regular there: it is their dependence, or a level that ends.
        guilty = set(forms.dependent(taken)) or {i for i, _ in taken}
    retained = tuple(None if i in guilty else level for i, level in enumerate(enforced.invariant_values))
    tried |= {(i, level.chart) for i, level in taken if i in guilty}
    values, _ = _chosen(enforced.integrals, [state, ahead], retained, sorted(guilty), tried)
    notes = []
    for i in sorted(guilty):
        integral = enforced.integrals.found[i]
        left = f"is enforced no longer; {_left_to_rows(integral)}"
        what = left if values[i] is None else "is enforced in another form"
        notes.append(f"from t = {state.t:.9g} the integral {integral.text} {what}")
    return dataclasses.replace(enforced, invariant_values=values), tuple(notes), tried


def _left_to_rows(integral: FirstIntegral) -> str:
    names = ", ".join(f"`{row}`" for row in integral.rows)
    rows = f"the velocity row {names} keeps" if len(integral.rows) == 1 else f"the velocity rows {names} keep"
    return f"{rows} it to the tolerance"


def _taken(invariant_values: Iterable[InvariantValue | None]) -> Iterator[tuple[int, InvariantValue]]:
    return ((i, level) for i, level in enumerate(invariant_values) if level is not None)


def _chosen(
    found: Integrals,
    states: Sequence[State],
    retained: InvariantValues,
    wanted: Sequence[int],
    tried: Tried = frozenset(),
) -> tuple[InvariantValues, list[str]]:
    """The levels of all integrals through a state, those `retained` as they are; and why one is not enforced, empty
    where it is, or follows from what is. A level goes through the first of `states`, and its chart serves at all of
    them. wanted: to be enforced; tried: charts that are passed over."""
    charts = [[c for c in range(len(f.charts)) if (i, c) not in tried] for i, f in enumerate(found.found)]
    levels, reasons = list(retained), ["" if level else NO_FORM for level in retained]
    wanted = [i for i in wanted if charts[i]]
    if not wanted:
        return retained, reasons
    forms = [found.at(state) for state in states]
    # The best chart of all, where that will do: it nearly always does.
    best = [(i, forms[0].level(i, charts[i][0])) for i in wanted]
    if not any(each.fault(i, level) for each in forms for i, level in best) and not any(
        each.dependent([*_taken(levels), *best]) for each in forms
    ):
        for i, level in best:
            levels[i], reasons[i] = level, ""
        return tuple(levels), reasons
    for i in wanted:
        # The first chart that serves.
        for chart in charts[i]:
            level = forms[0].level(i, chart)
            why = next(filter(None, (each.fault(i, level) for each in forms)), "")
            if not why:
                if not any(i in each.dependent([*_taken(levels), (i, level)]) for each in forms):
                    levels[i], reasons[i] = level, ""
                    break
                why = DEPENDS
            reasons[i] = f"{why} at the start"
    for i, why in enumerate(reasons):
        if why.startswith(DEPENDS):
            own = [*((j, level.chart) for j, level in _taken(levels)), (i, charts[i][0])]
            if _follows(found, states[0], i, own):
                reasons[i] = ""
    return tuple(levels), reasons


def _follows(found: Integrals, state: State, i: int, charts: list[tuple[int, int]]) -> bool:
    """True if integral i depends on those that are enforced, in these charts, beside the state too, so that they hold
    it."""
    numeric = found.functions(()).numeric
    surface = projection.Surface(numeric, state.t, state.p, initial.metric_at(numeric, state))
    size = float(np.abs(state.q).max(initial=0.0)) or 1.0
    random = np.random.default_rng(0)
    for _ in range(POINTS):
        q = surface.nearby(state.q + BESIDE * size * random.standard_normal(state.q.size))
        if q is None:
            return False
        forms = found.at(dataclasses.replace(state, q=q))
        if i not in forms.dependent((j, forms.level(j, chart)) for j, chart in charts):
            return False
    return True
