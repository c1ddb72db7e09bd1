"""First integrals of differential rows that a run holds, each in one of its charts (D.3).

A chart serves while its level g = 0 is regular: finite, with a gradient that does not vanish and does not depend
on those of the holonomic rows and of the integrals before it. Else another chart of the integral is taken, or the
integral is left to its velocity row, which keeps it to the tolerance. Either is noted, never silent.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.equations import level_functions
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.linear import generic_direction, independent_rows, metric_rows
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.memory import Memory
from lagcli.model.invariant import FirstIntegral
from lagcli.simulation.scheme.method import Method, Scheme
from lagcli.simulation.scheme.step_end import Compiled
from lagcli.start import initial, projection
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

# The gradient of a level is taken as vanishing where it changes by BENT of itself within ASIDE of each coordinate and
# AROUND of the largest: Newton's steps from nearby would not reach the level.
OFFSET, AROUND, BENT = 1e-6, 1e-9, 0.1
# Points beside a state, at this part of its size, on which a dependence of gradients is looked for again: one that
# holds there too is no accident of the state.
BESIDE, POINTS = 1e-2, 2
DEPENDS = "it depends on other constraints"


class InvariantValue(NamedTuple):
    """The surface on which an integral is enforced: the number of its chart, and what above and below were.

    Both are divided by their hypotenuse, but for a chart with a period.
    """

    chart: int
    above: float
    below: float


InvariantValues = tuple[InvariantValue | None, ...]
Tried = frozenset[tuple[int, int]]  # integrals and their charts


class RunFunctions:
    """Compiled functions of a system, with those of a method built when a run first asks for them."""

    def __init__(self, numeric: NumericSystem, schemes: Memory | None = None) -> None:
        self.numeric = numeric
        self._schemes = Memory() if schemes is None else schemes

    def scheme(self, method: Method) -> Scheme:
        """The compiled step and dense output of a method."""
        return self._schemes.answer(method.name, lambda: Scheme(method, self.numeric))


class Integrals:
    """The integrals of one system, and its functions with any choice of their charts.

    system: that they are of; selection: the independent rows that it is stepped with.
    Raises as `level_functions.charts` where a chart is no expression of the system.
    """

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
        charts, system = self._charts.charts, self.system
        return (
            self._plain.numeric.has_time
            or any(level_functions.has_time(system, each) for each in charts)
            or level_functions.events_have_time(system)
        )

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
        self._numeric, self._evaluate, self._first = numeric, evaluate, first
        self._state = state
        self._here = self._read(state.q)
        sizes = OFFSET * np.abs(state.q) + AROUND * (np.abs(state.q).max(initial=0.0) or 1.0)
        direction = generic_direction.direction(state.q.size, 0)
        self._beside = self._read(state.q + sizes * direction)

    def _read(self, q: Floats) -> _Read:
        values, above, below, periods = self._evaluate(self._state.t, q, self._state.p)
        return np.array(values), above, below, np.array(periods).ravel()

    def level(self, i: int, chart: int) -> InvariantValue:
        """The level of integral i through the state, in one of its charts."""
        k = self._first[i] + chart
        above, below = self._here[0][k].tolist()
        size = 1.0 if self._here[3][k] else math.hypot(above, below)
        return (
            InvariantValue(chart, above / size, below / size)
            if size
            else InvariantValue(chart, math.nan, math.nan)
        )

    def gradient(self, i: int, level: InvariantValue) -> Sparse:
        """The gradient of g (1, n) of integral i."""
        return self._gradient(self._here, self._first[i] + level.chart, level)

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

    @cached_property
    def _holonomic(self) -> Sparse:
        """The independent holonomic rows."""
        B = self._numeric.holonomic(self._state.t, self._state.q, self._state.p)[1]
        retained: Sparse = B[[i for i in self._numeric.selection.independent if i < B.shape[0]], :]
        return retained

    @cached_property
    def _metric(self) -> Metric:
        return initial.metric_at(self._numeric, self._state)

    def dependent(self, taken: Iterable[tuple[int, InvariantValue]]) -> list[int]:
        """The integrals with a gradient that depends on the holonomic rows and on those before it."""
        numbers, gradients = zip(*((i, self.gradient(i, level)) for i, level in taken), strict=True)
        s = self._holonomic.shape[0]
        rows = MetricRows(metric_rows.stacked(self._holonomic, *gradients), self._metric)
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
    """The integrals that a run enforces: a level of each of the integrals, or None where its velocity row alone keeps
    it.

    p: the parameters of the system.
    """

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

    @property
    def has_time(self) -> bool:
        """True if t occurs in what moves the system or in an event; it does not depend on what is enforced."""
        return self.integrals.has_time

    @property
    def plain(self) -> EnforcedInvariants:
        """The invariants with none enforced."""
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
    """The integrals that can be enforced from a start, each in the best chart that serves there; notes on the
    others."""
    number = len(found.found)
    chosen = _Choice(found, [state], (None,) * number, range(number))
    notes = tuple(
        f"the integral {integral.text} is not enforced: {why}; {_velocity_note(integral)}"
        for integral, why in zip(found.found, chosen.reasons, strict=True)
        if why
    )
    return EnforcedInvariants(found, chosen.invariant_values, state.p), notes


def let_go(
    enforced: EnforcedInvariants, state: State, ahead: State, tried: Tried
) -> tuple[EnforcedInvariants, tuple[str, ...], Tried]:
    """Release the levels that do not lead from a state to one ahead, with other charts where they do.

    `ahead` is where the system without integrals would go, in a step in which the levels enforced failed. `tried`:
    charts that failed in this step before, given back with those that do now.
    """
    forms = enforced.integrals.at(ahead)
    guilty = {i for i, level in _taken(enforced.invariant_values) if forms.fault(i, level)}
    if not guilty:
        # All are regular there: it is their dependence, or a level that ends.
        guilty = set(forms.dependent(_taken(enforced.invariant_values)))
    guilty = guilty or {i for i, _ in _taken(enforced.invariant_values)}
    retained = tuple(None if i in guilty else level for i, level in enumerate(enforced.invariant_values))
    tried |= {(i, level.chart) for i, level in _taken(enforced.invariant_values) if i in guilty}
    chosen = _Choice(enforced.integrals, [state, ahead], retained, sorted(guilty), tried)
    notes = []
    for i in sorted(guilty):
        integral = enforced.integrals.found[i]
        what = (
            f"is enforced no longer; {_velocity_note(integral)}"
            if chosen.invariant_values[i] is None
            else "is enforced in another form"
        )
        notes.append(f"from t = {state.t:.9g} the integral {integral.text} {what}")
    return dataclasses.replace(enforced, invariant_values=chosen.invariant_values), tuple(notes), tried


def _velocity_note(integral: FirstIntegral) -> str:
    """The end of the note on an integral that is not enforced."""
    names = ", ".join(f"`{row}`" for row in integral.rows)
    rows = f"the velocity row {names} keeps" if len(integral.rows) == 1 else f"the velocity rows {names} keep"
    return f"{rows} it to the tolerance"


def _taken(invariant_values: InvariantValues) -> Iterator[tuple[int, InvariantValue]]:
    return ((i, level) for i, level in enumerate(invariant_values) if level is not None)


class _Choice:
    """The levels of all integrals through a state, those that are `retained` as they are.

    A level goes through the first of `states`, and its chart serves at all of them. wanted: the integrals to be
    enforced; tried: charts that are passed over; reasons: why an integral is not enforced, empty where it is, or
    follows from what is enforced.
    """

    def __init__(
        self,
        found: Integrals,
        states: Sequence[State],
        retained: InvariantValues,
        wanted: Sequence[int],
        tried: Tried = frozenset(),
    ) -> None:
        self._found, self._state = found, states[0]
        self._charts = [
            [c for c in range(len(f.charts)) if (i, c) not in tried] for i, f in enumerate(found.found)
        ]
        self.invariant_values = retained
        self.reasons = [
            "" if level else "no form of it without poles or jumps is known" for level in retained
        ]
        wanted = [i for i in wanted if self._charts[i]]
        if not wanted:
            return
        self._forms = [found.at(state) for state in states]
        if not self._all(wanted):
            for i in wanted:
                self._choose(i)
            for i, why in enumerate(self.reasons):
                if why.startswith(DEPENDS) and self._follows(i):
                    self.reasons[i] = ""

    def _all(self, wanted: Sequence[int]) -> bool:
        """Take the best chart of all, where that will do: it nearly always does."""
        best = [(i, self._forms[0].level(i, self._charts[i][0])) for i in wanted]
        if any(forms.fault(i, level) for forms in self._forms for i, level in best):
            return False
        if any(forms.dependent([*_taken(self.invariant_values), *best]) for forms in self._forms):
            return False
        for i, level in best:
            self._take(i, level)
        return True

    def _choose(self, i: int) -> None:
        """Take the first chart of integral i that serves."""
        for chart in self._charts[i]:
            level = self._forms[0].level(i, chart)
            why = next(filter(None, (forms.fault(i, level) for forms in self._forms)), "")
            if not why:
                taken = [*_taken(self.invariant_values), (i, level)]
                if not any(i in forms.dependent(taken) for forms in self._forms):
                    self._take(i, level)
                    return
                why = DEPENDS
            self.reasons[i] = f"{why} at the start"

    def _take(self, i: int, level: InvariantValue) -> None:
        self.invariant_values = (*self.invariant_values[:i], level, *self.invariant_values[i + 1 :])
        self.reasons[i] = ""

    def _follows(self, i: int) -> bool:
        """True if integral i depends on those that are enforced beside the state too, so that they hold it."""
        numeric, state = self._found.functions(()).numeric, self._state
        surface = projection.Surface(numeric, state.t, state.p, initial.metric_at(numeric, state))
        size = float(np.abs(state.q).max(initial=0.0)) or 1.0
        random = np.random.default_rng(0)
        for _ in range(POINTS):
            q = surface.nearby(state.q + BESIDE * size * random.standard_normal(state.q.size))
            if q is None:
                return False
            forms = self._found.at(dataclasses.replace(state, q=q))
            charts = [
                *((j, level.chart) for j, level in _taken(self.invariant_values)),
                (i, self._charts[i][0]),
            ]
            if i not in forms.dependent((j, forms.level(j, chart)) for j, chart in charts):
                return False
        return True
