"""The compiled functions of a run on arrays that they share: nothing is allocated while stepping."""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.simulation.scheme import step_tolerance
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.scheme.method import Method
from lagcli.start.initial import State


class BoundStep:
    """A step from t, y with k = y'(t, y) to new with k_new = y', and what else is asked at a state. t, h, status,
    scratch_t: memory of plain floats; scratch: `NumericSystem.project` on arrays (t, y, p) of its own."""

    def __init__(self, enforced: EnforcedInvariants, method: Method, y: Floats, tolerance: Floats) -> None:
        self.p = enforced.parameters
        # A run counts its turns in numbers of its own, which are a part of those that the functions take.
        self.enforced = dataclasses.replace(enforced, p=self.p[: enforced.p.size])
        self.numeric, scheme = enforced.functions.numeric, enforced.functions.scheme(method)
        t, h, scratch = (np.zeros(1) for _ in range(3))
        self.y, self.k = y, np.zeros(y.size)
        self.rhs = BoundFunction(self.numeric.rhs, [t, y, self.p])
        self.project = BoundFunction(self.numeric.project, [t, y, self.p])
        self.scratch = BoundFunction(self.numeric.project, [scratch, np.zeros(y.size), self.p])
        self._blurred = tolerance[step_tolerance.BLURRED]
        self.is_blurred, self._roundings = False, list[BoundFunction]()
        arguments = [t, h, y, self.k, tolerance, self.p]
        self.step = BoundFunction(scheme.step, arguments, wanted=3)
        self.new, self.k_new, status = self.step.results
        # The same step with its stages, for the dense output of one that holds rows.
        self.staged = BoundFunction(scheme.step, arguments, given=self.step.results)
        self.t, self.h, self.scratch_t, self.status = map(cells, (t, h, scratch, status))

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
        self.scratch_t[0], self.scratch.arguments[1][:] = t, y
        self.scratch.trigger()
        return self.scratch.results


class BoundRows:
    """The dense output of a step and its lines: begin, inside, end and aside write `line`, at the time in `at`. at, x,
    cells: memory of plain floats, of the time, the fraction of the step and the line; aside has a state of its own;
    defect: None but for a run with witnesses."""

    def __init__(self, bound: BoundStep, method: Method, is_witnessed: bool) -> None:
        scheme = bound.enforced.functions.scheme(method)
        t, h, y, k, tolerance, p = bound.step.arguments
        at, x = np.zeros(1), np.zeros(1)
        self.dense = BoundFunction(
            scheme.dense, [t, h, y, bound.new, bound.k_new, p, k, *bound.staged.results[3:]]
        )
        coefficients = self.dense.results[0].T
        self.defect: BoundFunction | None = None
        if is_witnessed:
            self.defect = BoundFunction(scheme.defect, [at, x, h, y, coefficients, tolerance, p])
        self.inside = BoundFunction(scheme.line_inside, [at, x, y, coefficients, p])
        given = self.inside.results
        self.begin = BoundFunction(scheme.line_at, [at, y, p], given=given)
        self.scratch = BoundFunction(scheme.line_at, [at, np.zeros(y.size), p], given=given)
        self.end = BoundFunction(scheme.line_at, [at, bound.new, p], given=given)
        self.line = given[0]
        self.at, self.x, self.cells = cells(at), cells(x), cells(self.line)

    def put(self, t: float, y: Floats) -> None:
        """Write the line of another state (2n + 1,)."""
        self.at[0], self.scratch.arguments[1][:] = t, y
        self.scratch.trigger()
