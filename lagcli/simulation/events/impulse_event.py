"""Jumps of a potential, the Lagrangian or a position as an `Event`: the force there is an impulse, and the run ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.simulation.events.event import Event, Screen
from lagcli.simulation.scheme.method import WRITTEN_OUT, Method
from lagcli.simulation.stepping.found_step import Cut, FoundStep
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness.sized_function import SizedFunction

if TYPE_CHECKING:
    from lagcli.equations.energy_jumps import Crossings, Way
    from lagcli.simulation.singularity.singularity_step import SingularStep


# So many parts of a step are looked at for switches of what must not jump.
PARTS = np.linspace(0, 1, 17)
# Every fourth is enough where a switch is farther from zero than so many times what it changes by there.
FEW, FAR = PARTS[::4], 2.0


class CurveFunctions:
    """Compiled for the switches of a system and a state y of n coordinates, n rates and W."""

    def __init__(self, crossings: Crossings, method: Method) -> None:
        self._crossings, self._method = crossings, method
        n, self._parameters = crossings.switches.numel_in(1), crossings.switches.numel_in(3)
        self._n, self._size = n, 2 * n + 1

    @cached_property
    def margin(self) -> ca.Function:
        """margin(t, h, y, k, new, k_new, p) -> above zero where a look at FEW parts says that no switch changes
        its sign in a step h from y."""

        def combined(found: list[ca.SX]) -> ca.SX:
            least = most = found[0]
            for u in found[1:]:
                least, most = ca.fmin(least, u), ca.fmax(most, u)
            return ca.mmin(ca.fmax(least, -most) - FAR * (most - least))

        return self._on_cubic("margin", FEW, combined)

    @cached_property
    def changes(self) -> ca.Function:
        """changes(t, h, y, k, new, k_new, p) -> zero where every switch has one sign at all PARTS."""

        def combined(found: list[ca.SX]) -> ca.SX:
            first = ca.sign(found[0])
            return ca.sum1(sum(ca.fabs(ca.sign(u) - first) for u in found[1:]))

        return self._on_cubic("changes", PARTS, combined)

    @cached_property
    def inside(self) -> tuple[ca.Function, ca.Function]:
        """switches and values(t, h, x, y, coefficients, p) -> (K,) and (J,), at the fraction x of the dense output of a
        step."""
        t, h, x = (ca.SX.sym(each) for each in ("t", "h", "x"))
        y, p = ca.SX.sym("y", self._size), ca.SX.sym("p", self._parameters)
        coefficients = ca.SX.sym("coefficients", self._size, self._method.dense_rows)
        state, given = self._method.interpolated(y, coefficients, x), [t, h, x, y, coefficients, p]
        at, of = (t + x * h, state[: self._n], state[self._n : 2 * self._n], p), self._crossings
        switches = SizedFunction("switches", given, [of.switches(*at)])
        return switches, SizedFunction("values", given, [of.values(*at)])

    def _on_cubic(self, name: str, parts: Floats, combined: Callable[[list[ca.SX]], ca.SX]) -> ca.Function:
        n = self._n
        t, h, x = (ca.SX.sym(each) for each in ("t", "h", "x"))
        y, k, new, k_new = (ca.SX.sym(each, self._size) for each in ("y", "k", "new", "k_new"))
        p = ca.SX.sym("p", self._parameters)
        ahead = new - y
        bends = h * ((1 - x) * k - x * k_new) + (2 * x - 1) * ahead
        state = y + x * ahead + x * (1 - x) * bends
        inputs = [t, h, y, k, new, k_new, p]
        switches = self._crossings.switches(t + x * h, state[:n], state[n : 2 * n], p)
        switches_at = SizedFunction("switches_at", [x, *inputs], [switches])
        given = [ca.MX.sym(each.name(), each.numel()) for each in (t, h)]
        given += [ca.MX.sym(each, self._size) for each in ("y", "k", "new", "k_new")]
        given.append(ca.MX.sym("p", self._parameters))
        found = [ca.SX.sym("u", switches.numel()) for _ in parts]
        whole = SizedFunction(name, found, [combined(found)])
        function = SizedFunction(name, given, [whole(*(switches_at(part, *given) for part in parts))])
        is_small = switches_at.n_instructions() * len(parts) <= WRITTEN_OUT
        return SizedFunction(function.expand()) if is_small else function


class StepCurve:
    """The curve of the step that a run has just found, from its ends alone, and a `Way` with its dense output; bound:
    the functions with which the run steps."""

    def __init__(self, functions: CurveFunctions, run: Stepper) -> None:
        self._run, self.bound, self._functions = run, run.bound, functions
        t, x = np.zeros(1), np.zeros(1)
        self._t, self._x = cells(t), cells(x)
        bound = run.bound
        _, h, y, k, _, _ = bound.arguments
        self._on_cubic = [t, h, y, k, bound.new, bound.k_new, bound.enforced.p]
        self._arguments = [t, h, x, y, run.trial.rows.dense.results[0].T, bound.enforced.p]
        self._margin = BoundFunction(functions.margin, self._on_cubic)
        self._clear = cells(self._margin.results[0])

    @cached_property
    def _changes(self) -> BoundFunction:
        return BoundFunction(self._functions.changes, self._on_cubic)

    @cached_property
    def _inside(self) -> list[tuple[BoundFunction, Sequence[float]]]:
        """The switches and the values within the step, with what they write."""
        bound = [BoundFunction(function, self._arguments) for function in self._functions.inside]
        return [(each, cells(each.results[0])) for each in bound]

    def is_crossed(self) -> bool:
        """True if a switch changes its sign, as far as the ends of the step tell."""
        self._t[0] = self._run.origin + self._run.t
        self._margin.trigger()
        if self._clear[0] > 0.0:
            return False
        self._changes.trigger()
        return bool(self._changes.results[0][0] != 0.0)

    def switches(self, part: float) -> Sequence[float]:
        """See `energy_jumps.Way`."""
        return self._at(part, *self._inside[0])

    def values(self, part: float) -> Sequence[float]:
        """See `energy_jumps.Way`."""
        return self._at(part, *self._inside[1])

    def _at(self, part: float, function: BoundFunction, found: Sequence[float]) -> Sequence[float]:
        self._t[0], self._x[0] = self._run.origin + self._run.t, part
        function.trigger()
        return found


class SingularStepCurve:
    """The `Way` of a step across a singular configuration."""

    def __init__(self, crossings: Crossings, run: Stepper, curve: SingularStep) -> None:
        self._crossings, self._run, self._step = crossings, run, curve.step

    def switches(self, part: float) -> Sequence[float]:
        """See `energy_jumps.Way`."""
        return self._at(part, self._crossings.switches)

    def values(self, part: float) -> Sequence[float]:
        """See `energy_jumps.Way`."""
        return self._at(part, self._crossings.values)

    def _at(self, x: float, function: ca.Function) -> Sequence[float]:
        run, state = self._run, self._step.state(x)
        n, t = state.size // 2, run.origin + run.t + x * self._step.h
        found = function(t, state[:n], state[n : 2 * n], run.bound.enforced.p)
        return np.array(found, dtype=float).ravel().tolist()


class ImpulseEvent(Event):
    """A jump of what the equations take for smooth."""

    def __init__(self, stepper: Stepper, crossings: Crossings) -> None:
        self._stepper, self._crossings = stepper, crossings
        self._functions = CurveFunctions(crossings, stepper.method)
        self._curve = StepCurve(self._functions, stepper)

    def screen(self) -> Screen | None:
        """See `Event`."""
        return Screen(self._functions.margin)

    def found(self, step: FoundStep) -> Cut | None:
        """See `Event`."""
        run, curve = self._stepper, step.singular_step
        if step.is_still:
            return None
        if self._curve.bound is not run.bound:
            self._curve = StepCurve(self._functions, run)
        if curve is None and not run.trial.has_dense:
            if not self._curve.is_crossed():
                return None
            run.trial.make_dense(is_retaken=True)
        way: Way = self._curve if curve is None else SingularStepCurve(self._crossings, run, curve)
        barrier = self._crossings.first(way, PARTS)
        if barrier is None:
            return None
        return Cut(step._replace(barrier=barrier, reached=run.t + barrier.part * step.taken))
