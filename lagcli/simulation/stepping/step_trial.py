"""One step from where a run stands: tried, compared with the equations, and taken again up to a time within it."""

from __future__ import annotations

import math

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction
from lagcli.simulation.run_state.statistics import RunStatistics
from lagcli.simulation.scheme.bound_scheme import BoundRows, BoundStep
from lagcli.simulation.scheme.controller import StepController
from lagcli.simulation.scheme.method import Method
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.grid import Dense, Witnesses
from lagcli.smoothness import named_functions

# A projected state off the constraints by more than this part of its size was not reached by Newton: a smaller step.
MOST_RESIDUAL = doubles.ZERO
# What comes is seen by this part of a step ahead, and a row without a value as a limit from points beside it.
BESIDE = 1e-4
# A step in which rows have been dependent unseen counts as one of this error, which halves it; down to this part of
# the step proposed, for rounding may look the same.
HIDDEN, HIDING = 100.0, 1e-3
# A step is wrong where the dense output is off the equations by so many tolerances at a row, and counts as one of
# this error then.
FORGIVEN, UNSEEN = 3e3, -1.0


class StepTrial:
    """The step that is tried from where `bound` stands, with the functions of a run as they are now; the evaluations of
    the right-hand side are counted in its statistics. rows: the dense output of the step, and the lines of the table;
    has_dense: the dense output of the step that was tried last is made."""

    def __init__(
        self,
        bound: BoundStep,
        method: Method,
        witnesses: Witnesses,
        control: StepController,
        statistics: RunStatistics,
    ) -> None:
        self._bound, self._method, self._witnesses = bound, method, witnesses
        self._control, self._statistics = control, statistics
        # Where t occurs, a step has its stages at times that are told apart; without, the jump of a force may be
        # crossed in one rounding. That of a row may not: the velocity would have to jump.
        has_time, model = bound.numeric.has_time, bound.enforced.system.model
        self.fewest = 1 if not has_time and named_functions.only_forces_may_jump(model) else 64
        self.rows = BoundRows(bound, method, witnesses.is_any)
        self.has_dense = False

    def attempt(self, reached: float, taken: float, has_stages: bool, longest: float) -> tuple[float, float]:
        """The error of a step, and the length of a smaller one that should be tried; 0 where it may be taken.
        has_stages: they are kept, for the dense output; longest: what no step is longer than, whatever is proposed. The
        error is `UNSEEN` where only a witness speaks against the step."""
        bound, control = self._bound, self._control
        bound.h[0], self.has_dense = taken, False
        bound.look_at_rounding()
        defect = self.rows.defect
        (bound.staged if has_stages or defect is not None else bound.step).trigger()
        self._statistics.evaluations += self._method.evaluations
        scheme_error, moved, hidden, residual, _, _, everything, _ = bound.status
        projected, error = residual <= MOST_RESIDUAL, max(scheme_error, moved)
        if hidden < 0.0 and taken > HIDING * min(control.step, longest):
            error = max(error, HIDDEN)
        if error < 1.0 and projected and math.isfinite(everything):
            if defect is None:
                return error, 0.0
            # The first time within the step at which the forces are not those it was made of.
            is_growing, t, rows = control.grown(taken, error, math.inf) > 2 * taken, bound.t[0], self.rows
            for at in self._witnesses.within(t, reached, self.dense, is_growing):
                self.make_dense()
                rows.at[0], rows.x[0] = self._witnesses.origin + at, (at - t) / taken
                defect.trigger()
                self._statistics.evaluations += 1
                if defect.results[0][0] > FORGIVEN:
                    return UNSEEN, at - t
            return error, 0.0
        # `not error < 1` also holds for nan: then nothing is known but that the step was too large.
        is_known = math.isfinite(error) and error >= 1.0 and projected
        return error, control.smaller(taken, error, is_known)

    def is_too_short(self, taken: float, rejected: float) -> bool:
        """True where the time has too few roundings in a step; rejected: the end of the one tried before it."""
        t = self._bound.t[0]
        return t + taken / self.fewest == t or (self.fewest == 1 and t + taken >= rejected)

    def make_dense(self, is_retaken: bool = False) -> None:
        """Make the dense output of the step, once; is_retaken: of one that was tried without keeping its stages."""
        if self.has_dense:
            return
        if is_retaken:
            self._bound.staged.trigger()
            self._statistics.evaluations += self._method.evaluations
        self.rows.dense.trigger()
        self._statistics.evaluations += self._method.dense_evaluations
        self.has_dense = True

    def dense(self) -> Dense:
        """The states (2n + 1, k) at parts (k,) of the step."""
        self.make_dense()
        begin, coefficients = self._bound.y[:, None], self.rows.dense.results[0][:, :, None]
        return lambda x: np.asarray(self._method.interpolated(begin, coefficients, np.atleast_1d(x)))

    def again(self, step: FoundStep, reached: float) -> FoundStep:
        """A step taken again, up to a time within it: nothing jumps in that before its end."""
        taken = reached - self._bound.t[0]
        self._bound.h[0], self.has_dense = taken, False
        self._bound.staged.trigger()
        self._statistics.evaluations += self._method.evaluations
        return step._replace(reached=reached, taken=taken, work=None, is_balanced=True, barrier=None)

    def plain_end(self) -> Floats | None:
        """The state (2n + 1,) to which the step leads without integrals; None where it is not right without them."""
        bound, plain = self._bound, self._bound.enforced.plain
        *arguments, _ = bound.arguments
        function = plain.functions.scheme(self._method).step
        step = BoundFunction(function, [*arguments, plain.parameters], wanted=3)
        step.trigger()
        self._statistics.evaluations += self._method.evaluations
        new, _, (error, moved, _, residual, _, _, everything, _) = step.results
        is_right = max(error, moved) < 1.0 and residual <= MOST_RESIDUAL and math.isfinite(everything)
        return new if is_right else None

    def put_end(self, y: Floats, k: Floats) -> None:
        """Let the step end at a state with its rate, (2n + 1,) each."""
        self._bound.new[:], self._bound.k_new[:] = y, k

    def project_end(self, reached: float, y: Floats) -> Floats:
        """Let it end at a time on the constraints, near a state (2n + 1,); the status of `NumericSystem.project`."""
        projected, rate, status, _ = self._bound.projected_at(reached, y)
        self.put_end(projected, rate)
        return status

    def with_work(self, step: FoundStep) -> FoundStep:
        """A step with W integrated over it on its dense output, where the scheme's own W is not right to the tolerance
        of the run."""
        if not self._statistics.is_balanced:
            return step
        from lagcli.simulation.scheme import work_integral

        bound = self._bound
        bound.staged.trigger()
        self.make_dense()
        span = bound.t[0], step.taken, bound.arguments[4][0]
        dense = self.dense()
        work = work_integral.within(bound.scratch, span, bound.y, lambda x: dense(x).T)
        self.count_scratch()
        if work is not None:
            bound.new[-1] = work.end
        return step._replace(work=work, is_balanced=work is not None)

    def count_scratch(self) -> None:
        """Count the evaluations that were made beside the step."""
        self._statistics.evaluations += self._bound.scratch.used
        self._bound.scratch.used = 0
