"""DOP853: one step with projection and its dense output, each as one compiled function.

Dormand and Prince 8(5,3); Hairer, Norsett, Wanner, Solving ODEs I, sec. II.5 (error estimate) and II.6 (dense
output of order 7). After the step the state is projected onto f = 0 and B v + b = 0; the derivative at the
projected state is the first stage of the next step.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import casadi as ca

from lagcli import doubles, memory
from lagcli.compiled import NumericSystem, dop853_tableau
from lagcli.simulation.scheme import step_end
from lagcli.simulation.scheme.step_end import Curve, Expression
from lagcli.smoothness.sized_function import SizedFunction

# Polynomials of the dense output.
DENSE_ROWS = 3 + len(dop853_tableau.D_DENSE)
# Stages at which the distance of the rows from dependent ones is looked at, in the order of their times.
WATCHED = (1, 3, 6, 5, 9, 8, 10)


# An angle between rows that is less than this part of both beside it may have gone through zero beside it, and so may
# one that lines through others lead to the other side of zero, by this part of itself.
DIP = 0.3


class DormandPrince853:
    """The `method.Method` of order 8; its stages are the second to the twelfth, for the first is k."""

    name = "dop853"
    order = dop853_tableau.ORDER
    evaluations = dop853_tableau.STAGES
    dense_evaluations = len(dop853_tableau.A_DENSE)
    dense_rows = DENSE_ROWS

    def step(self, numeric: NumericSystem) -> ca.Function:
        """See `method.Method.step`."""
        step = step_end.inputs(numeric)
        t, h, y, k, _, p = step
        stages, near = [k], {}
        for s in range(1, dop853_tableau.STAGES):
            at = _plus(t, _times(dop853_tableau.C[s], h))
            inputs = at, _plus(y, _times(h, _mix(dop853_tableau.A[s], stages))), p
            if s in WATCHED and numeric.stage is not None:
                rate, near[s] = numeric.stage(*inputs)
            else:
                rate = numeric.rhs(*inputs)
            stages.append(rate)
        change = _mix(dop853_tableau.B, stages)
        # The weights of order 3 are those of order 8 but for three entries.
        e3 = change + _mix(
            [low - high for low, high in zip(dop853_tableau.E3, dop853_tableau.B, strict=True)], stages
        )
        e5 = _mix(dop853_tableau.E5, stages)

        def combined(h: Expression, e5: Expression, e3: Expression) -> Expression:
            """Hairer's combination of the error estimates of order 5 and 3."""
            return h * e5 * e5 / ca.sqrt(e5 * e5 + 0.01 * e3 * e3 + doubles.TINY)

        end = step_end.ended(numeric, step, y + h * change, (e5, e3), combined)
        hidden = _hidden()(ca.horzcat(*(near[s] for s in WATCHED), end.status[1:3])) if near else 1.0
        return SizedFunction("step", step, end.outputs(hidden, stages[1:]))

    def dense(self, numeric: NumericSystem) -> ca.Function:
        """See `method.Method.dense`."""
        t, h, y, k, _, p = step_end.inputs(numeric)
        new, k_new = step_end.symbols(numeric, "new k_new")
        given = [k, *(ca.MX.sym(f"k{i}", y.numel()) for i in range(2, dop853_tableau.STAGES + 1))]
        stages = [*given, k_new]
        for extra, row in enumerate(dop853_tableau.A_DENSE):
            node = dop853_tableau.C[dop853_tableau.STAGES + 1 + extra]
            stages.append(numeric.rhs(t + node * h, y + h * _mix(row, stages), p))
        change = new - y
        rows = [change, h * stages[0] - change, 2 * change - h * (k_new + stages[0])]
        rows += [h * _mix(row, stages) for row in dop853_tableau.D_DENSE]
        return SizedFunction("dense", [t, h, y, new, k_new, p, *given], [ca.horzcat(*rows)])

    def interpolated(self, y: Curve, coefficients: Curve, x: Curve) -> Curve:
        """See `method.Method.interpolated`."""
        result: Curve | float = 0.0
        for i in range(DENSE_ROWS - 1, -1, -1):
            result = (result + coefficients[:, i]) * (x if i % 2 == 0 else 1.0 - x)
        return result + y


def _times(a: ca.MX | float, b: ca.MX) -> ca.MX:
    """a b. By `MX.binary`: the operators of CasADi look for arrays of NumPy first, which takes ten times as long."""
    return ca.MX.binary(ca.OP_MUL, a, b)


def _plus(a: ca.MX, b: ca.MX) -> ca.MX:
    """a + b, likewise."""
    return ca.MX.binary(ca.OP_ADD, a, b)


def _mix(weights: Sequence[float], stages: Sequence[ca.MX]) -> ca.MX:
    """sum_j w_j k_j."""
    return reduce(_plus, (_times(w, k) for w, k in zip(weights, stages, strict=True) if w))


@memory.remembered()
def _hidden() -> ca.Function:
    """Smallest angle and smallest diagonal (2, 8) at the watched stages and at the end -> below zero where they may
    have gone through zero within the step and come back. Lines through two of their roots then lead below zero on the
    other side of a gap, or one is much smaller than both beside it."""
    squares = ca.SX.sym("squares", 2, len(WATCHED) + 1)
    roots = ca.sqrt(ca.fmax(squares, 0.0))
    at = [*(dop853_tableau.C[s] for s in WATCHED), 1.0]
    last = len(at) - 1

    def line(i: int, j: int, t: float) -> ca.SX:
        return roots[:, i] + (roots[:, j] - roots[:, i]) * ((t - at[i]) / (at[j] - at[i]))

    gaps = [line(0, 1, 0.0)]
    for i in range(last + 1):
        if 0 < i < last:
            gaps.append(roots[:, i] - DIP * ca.fmin(roots[:, i - 1], roots[:, i + 1]))
        if i > 1:
            gaps.append(line(i - 2, i - 1, at[i]) + DIP * roots[:, i])
        if i < last - 1:
            gaps.append(line(i + 1, i + 2, at[i]) + DIP * roots[:, i])
    return SizedFunction("hidden", [squares], [ca.mmin(ca.vertcat(*gaps))])
