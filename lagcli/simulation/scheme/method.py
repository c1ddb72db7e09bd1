"""The protocol of a scheme, and the schemes there are: one is a file here, its line below and its name in
`settings.METHOD_NAMES`.

A method is a one-step method: between two steps a run keeps nothing of it but k = y'(t, y).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Protocol

from lagcli.compiled import NumericSystem
from lagcli.model import settings
from lagcli.model.settings import Simulation
from lagcli.simulation.scheme import dop853, line_functions
from lagcli.simulation.scheme.line_functions import Curve
from lagcli.simulation.scheme.step_end import Compiled


class Method(Protocol):
    """One step from y to a state on the constraints, and the states between.

    order: the error of a step is of order + 1 in h; evaluations: of y' in a step, and dense_evaluations in the
    dense output; dense_rows: coefficients of the dense output for each number of the state.
    """

    @property
    def name(self) -> str:
        """The name users know it by."""

    @property
    def order(self) -> int:
        """See above."""

    @property
    def evaluations(self) -> int:
        """See above."""

    @property
    def dense_evaluations(self) -> int:
        """See above."""

    @property
    def dense_rows(self) -> int:
        """See above."""

    def step(self, numeric: NumericSystem) -> Compiled:
        """step(t, h, y, k, tolerance, p) -> y new, k new, (error, moved, hidden, status of `project`, the error of W),
        then stages (2n + 1,) each, any number, an output of its own so that none is copied where they are not wanted;
        k = y'(t, y), tolerance as `step_tolerance.of_steps`. `step_end.ended` does all but the stages.

        A step may be accepted where error < 1, the estimate of the method, and moved < 1: how far the projection moved
        the state, as a part of what it may. Where hidden < 0 rows have become dependent and independent again within
        the step. The error of W is a part of what rtol allows; it does not steer.
        """

    def dense(self, numeric: NumericSystem) -> Compiled:
        """dense(t, h, y, y new, k new, p, k, stages of `step`) -> coefficients (2n + 1, dense_rows)."""

    def interpolated(self, y: Curve, coefficients: Curve, x: Curve) -> Curve:
        """The state at the fraction x of a step from y (m,) with coefficients (m, dense_rows), for symbols and for
        arrays."""


METHODS: dict[str, Callable[[], Method]] = {
    "dop853": dop853.DormandPrince853,
}


def of(chosen: Simulation) -> Method:
    """The method of a run."""
    return METHODS[settings.method_name(chosen)]()


class Scheme:
    """The compiled functions of a method for one system, each built when a run first asks for it."""

    def __init__(self, method: Method, numeric: NumericSystem) -> None:
        self._method, self._numeric = method, numeric

    @cached_property
    def step(self) -> Compiled:
        """See `Method.step`."""
        return self._method.step(self._numeric)

    @cached_property
    def dense(self) -> Compiled:
        """See `Method.dense`."""
        return self._method.dense(self._numeric)

    @cached_property
    def line_at(self) -> Compiled:
        """See `line_functions.line_at`."""
        return line_functions.line_at(self._numeric)

    @cached_property
    def line_inside(self) -> Compiled:
        """See `line_functions.line_inside`."""
        return line_functions.line_inside(self._numeric, self.line_at, self._method)

    @cached_property
    def defect(self) -> Compiled:
        """The comparison of the dense output with the equations, see `line_functions.defect`."""
        return line_functions.defect(self._numeric, self._method)
