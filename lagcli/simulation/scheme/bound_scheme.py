"""The compiled functions of a run on arrays that they share: nothing is allocated while stepping."""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.simulation.scheme import step_tolerance
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.scheme.method import Method
from lagcli.start.initial import State


class BoundStep:
    """A step from t, y with k = y'(t, y) to new with k_new = y', and what else is asked at a state; functions are bound
    when they are first asked for. t, h, status: memory of plain floats; arguments: of the step, (t, h, y, k, tolerance,
    p)."""

    def __init__(self, enforced: EnforcedInvariants, method: Method, y: Floats, tolerance: Floats) -> None:
        self.p = enforced.parameters
        # A run counts its turns in numbers of its own, which are a part of those that the functions take.
        self.enforced = dataclasses.replace(enforced, p=self.p[: enforced.p.size])
        functions = enforced.functions
        self.numeric, self._step = functions.numeric, functions.scheme(method).step
        t, h = np.zeros(1), np.zeros(1)
        self.y, self.k = y, np.zeros(y.size)
        self._blurred = tolerance[step_tolerance.BLURRED]
        self.is_blurred, self._roundings = False, list[BoundFunction]()
        self.arguments = t, h, y, self.k, tolerance, self.p
        self._results = self.new, self.k_new, status = [np.zeros(self._step.size1_out(i)) for i in range(3)]
        self.t, self.h, self.status = map(cells, (t, h, status))

    @cached_property
    def step(self) -> BoundFunction:
        """The step alone."""
        return BoundFunction(self._step, self.arguments, given=self._results, wanted=3)

    @cached_property
    def staged(self) -> BoundFunction:
        """The same step with its stages, for the dense output of one that holds rows."""
        return BoundFunction(self._step, self.arguments, given=self._results)

    @cached_property
    def rhs(self) -> BoundFunction:
        """y'(t, y)."""
        return BoundFunction(self.numeric.rhs, [self.arguments[0], self.y, self.p])

    @cached_property
    def project(self) -> BoundFunction:
        """`NumericSystem.project` from where it stands."""
        return BoundFunction(self.numeric.project, [self.arguments[0], self.y, self.p])

    @cached_property
    def scratch(self) -> BoundFunction:
        """`NumericSystem.project` from elsewhere."""
        return BoundFunction(self.numeric.project, [np.zeros(1), np.zeros(self.y.size), self.p])

    def begin(self, t: float, k: Floats, row_step: float, is_blurred: bool | None = None) -> None:
        """Stand at a time with a rate (2n + 1,); row_step: the time between rows; is_blurred: whether rounding counts
        from there on, None where that is to be seen."""
        numeric, n = self.numeric, self.y.size // 2
        self.t[0], self.k[:] = t, k
        q, v = self.y[:n], self.y[n : 2 * n]
        self._blurred[:] = 0.0
        if is_blurred is None:
            is_blurred = step_tolerance.is_blurred(numeric, State(t, q, v, self.p), row_step)
        self.is_blurred = is_blurred
        if is_blurred:
            self._roundings = [BoundFunction(numeric.state_roundings, [np.zeros(1), q, v, self.p])]

    def look_at_rounding(self) -> None:
        """Note what the rounding of rows and forces makes at either end of the step to be tried, the less of both."""
        for roundings in self._roundings:
            ends = (self._rounded(roundings, t) for t in (self.t[0], self.t[0] + self.h[0]))
            self._blurred[:] = np.fmax(np.fmin(*ends), doubles.TINY)

    @staticmethod
    def _rounded(roundings: BoundFunction, t: float) -> Floats:
        roundings.arguments[0][0] = t
        roundings.trigger()
        found = step_tolerance.PARAMETERS.stages * step_tolerance.UNIT * roundings.results[0][1]
        return np.where(np.isfinite(found), found, 0.0)

    def put_on_constraints(self) -> tuple[Floats, Floats]:
        """Stand on the constraints near y, with the rate there; the status and the sizes of `NumericSystem.project`."""
        self.project.trigger()
        self.y[:], self.k[:], status, sizes = self.project.results
        return status, sizes

    def projected_at(self, t: float, y: Floats) -> list[Floats]:
        """The results of `NumericSystem.project`, in memory that the next call overwrites."""
        scratch = self.scratch
        scratch.arguments[0][0], scratch.arguments[1][:] = t, y
        scratch.trigger()
        return scratch.results


class BoundRows:
    """The dense output of a step and its lines, bound when they are first asked for: inside and `put` write `line`. at,
    x, cells: memory of plain floats, of the time, the fraction of the step and the line; defect: None but for a run
    with witnesses."""

    def __init__(self, bound: BoundStep, method: Method, is_witnessed: bool) -> None:
        self._bound, self._scheme = bound, bound.enforced.functions.scheme(method)
        # What builds functions is no part of the steps, and takes its time before them.
        self._functions = self._scheme.dense, self._scheme.line_inside
        self._at, self._x = np.zeros(1), np.zeros(1)
        self.line = np.zeros(self._scheme.line_at.size1_out(0))
        self.at, self.x, self.cells = cells(self._at), cells(self._x), cells(self.line)
        self.defect: BoundFunction | None = None
        if is_witnessed:
            _, h, y, _, tolerance, p = bound.arguments
            arguments = [self._at, self._x, h, y, self.dense.results[0].T, tolerance, p]
            self.defect = BoundFunction(self._scheme.defect, arguments)

    @cached_property
    def dense(self) -> BoundFunction:
        """The coefficients of the dense output."""
        (t, h, y, k, _, p), bound = self._bound.arguments, self._bound
        arguments = [t, h, y, bound.new, bound.k_new, p, k, *bound.staged.results[3:]]
        return BoundFunction(self._functions[0], arguments)

    @cached_property
    def inside(self) -> BoundFunction:
        """The line at the fraction x of the step, at the time in `at`."""
        bound, coefficients = self._bound, self.dense.results[0].T
        arguments = [self._at, self._x, bound.y, coefficients, bound.p]
        return BoundFunction(self._functions[1], arguments, given=[self.line])

    @cached_property
    def _anywhere(self) -> BoundFunction:
        bound = self._bound
        arguments = [self._at, np.zeros(bound.y.size), bound.p]
        return BoundFunction(self._scheme.line_at, arguments, given=[self.line])

    def put(self, t: float, y: Floats) -> None:
        """Write the line of a state (2n + 1,) at a time."""
        anywhere = self._anywhere
        self.at[0], anywhere.arguments[1][:] = t, y
        anywhere.trigger()
