"""Steps along fields that satisfy rows, A dz = B dq + b dt = 0, and their derivatives, for many points at once. A point
is z = (q of some coordinates, t). A step is a graph that calls the field: its derivatives are short too."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles, progress
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.smoothness.sized_function import SizedFunction

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
# The stages' rows of coefficients, and the weights.
Scheme = tuple[Sequence[Sequence[float]], Sequence[float]]

MOST = 256  # points in one call
ROUGH: Scheme = (((), (1 / 2,), (0, 1 / 2), (0, 0, 1)), (1 / 6, 1 / 3, 1 / 3, 1 / 6))  # the classical one
SHARED_NODES = 3000  # of a field in which common subexpressions are looked for
WRITTEN_OUT = 3e4  # operations of a step that is written out too


@frozen
class FixedValues:
    """The configuration q (n,) and velocity (n,) that are fixed, the values of the parameters, and units (k + 1,)."""

    q: Floats
    v: Floats
    p: Floats
    scale: Floats


def rows(system: System, chosen: Numbers, coordinates: Numbers, fixed: FixedValues) -> tuple[ca.SX, ca.SX]:
    """z (k + 1,) in units of `fixed.scale`, and A (c, k + 1) of rows `chosen` (c,); other coordinates are fixed."""
    symbols, p = system.symbols, system.p
    z = ca.SX.sym("z", len(coordinates) + 1)
    scale = ca.DM(fixed.scale)
    at = z * scale
    q = ca.SX(ca.DM(fixed.q))
    q[coordinates.tolist()] = at[:-1]
    B = system.rows.B[chosen.tolist(), coordinates.tolist()]
    b = ca.SX(system.rows.b)[chosen.tolist()]
    whole = SizedFunction("rows", [symbols.t, symbols.q, symbols.v, p], [ca.sparsify(ca.horzcat(B, b))])
    A = whole(at[-1], q, ca.DM(fixed.v), ca.DM(fixed.p))
    return z, ca.mtimes(A, ca.diag(scale))


def axes(z: ca.SX, A: ca.SX, led: Numbers, free: Numbers) -> ca.Function:
    """field(z, u) with u (m,) along the free coordinates and the led ones (r,) following, A (r, k + 1)."""
    u = ca.SX.sym("u", len(free))
    moved = ca.sparsify(ca.mtimes(A[:, free.tolist()], u))
    follow = -ca.solve(ca.densify(A[:, led.tolist()]), ca.densify(moved))
    # Where the free coordinates that move do not enter the rows nothing follows, be it at a pole.
    asks = ca.logic_not(ca.sum1(ca.fabs(moved)) == 0)  # true of nan as well
    rate = ca.SX.zeros(z.numel())
    rate[free.tolist()] = u
    rate[led.tolist()] = ca.if_else(asks, follow, 0)
    return SizedFunction("field", [z, u], [_short(rate)])


def projected(z: ca.SX, A: ca.SX) -> ca.Function:
    """field(z, w): w (k + 1,) with its dq moved to the nearest that satisfies A dz = 0 for its dt."""
    w = ca.SX.sym("w", z.numel())
    dq, dt = w[:-1], w[-1]
    B, b = A[:, :-1], A[:, -1]
    lengths = ca.sqrt(ca.sum2(B * B))
    unit = ca.if_else(lengths > 0, 1 / lengths, 1)
    B, b = ca.mtimes(ca.diag(unit), B), unit * b
    D, L, order = ca.ldl(ca.mtimes(B, B.T) + doubles.VALUE * ca.SX.eye(B.shape[0]))
    # Rows may depend on others; what the shift spoils the second pass corrects.
    for _ in range(2 if B.shape[0] else 0):
        dq = dq - ca.mtimes(B.T, ca.ldl_solve(ca.mtimes(B, dq) + b * dt, D, L, order))
    return SizedFunction("field", [z, w], [_short(ca.densify(ca.vertcat(dq, dt)))])


class PathSteps:
    """Steps of a scheme along a field, for many points and controls."""

    def __init__(self, field: ca.Function, scheme: Scheme) -> None:
        self._field, self._scheme = field, scheme
        self._functions: dict[str, ca.Function] = {"rate": field}
        self._bound: dict[tuple[str, int], BoundFunction] = {}

    def rate(self, Z: Floats, U: Floats) -> Floats:
        """The field (N, k + 1) at points Z (N, k + 1) for controls U (N, m); not finite at a pole."""
        return self._called("rate", Z, U)[0].reshape(Z.shape)

    def ahead(self, Z: Floats, U: Floats, h: float) -> Floats:
        """The points (N, k + 1) after a step h."""
        return self._called("ahead", Z, U * h)[0].reshape(Z.shape)

    def turned(self, Z: Floats, U: Floats, h: float) -> tuple[Floats, Floats, Floats]:
        """After a rough step h (order 4) the points, and derivatives by Z (N, k + 1, k + 1) and U (N, k + 1, m)."""
        count, size = Z.shape
        ahead, by_z, by_u = self._called("turned", Z, U * h)
        shapes = [(count, n, size) for n in (size, U.shape[1])]
        J_z, J_u = (
            np.swapaxes(x.reshape(shape), 1, 2) for x, shape in zip((by_z, by_u), shapes, strict=True)
        )
        return ahead.reshape(Z.shape), J_z, J_u * h

    def _ahead(self) -> ca.Function:
        """ahead(z, u) -> the point after a step: as the field is linear in u, its length is that of u."""
        z, u = inputs = [ca.MX.sym(x, self._field.size1_in(i)) for i, x in enumerate("zu")]
        stages: list[ca.MX] = []
        weights, last = self._scheme
        for row in weights:
            stages.append(self._field(z + _mix(row, stages) if stages else z, u))
        ahead = SizedFunction("ahead", inputs, [z + _mix(last, stages)])
        is_short = self._field.n_instructions() * len(stages) < WRITTEN_OUT
        return SizedFunction(ahead.expand()) if is_short else ahead

    def _turned(self) -> ca.Function:
        """turned(z, u) -> the point after a rough step, and its derivatives by z and by u."""
        symbols = [ca.SX.sym(x, self._field.size1_in(i)) for i, x in enumerate("zu")]
        rate = self._field(*symbols)
        outputs = [rate, *(ca.densify(ca.jacobian(rate, x)) for x in symbols)]
        field = SizedFunction("field", symbols, outputs)
        weights, last = ROUGH
        z, u = inputs = [ca.MX.sym(name, x.numel()) for name, x in zip("zu", symbols, strict=True)]
        rates: list[ca.MX] = []
        turns: list[ca.MX] = []
        pushes: list[ca.MX] = []
        unit = ca.MX(ca.DM.eye(z.numel()))
        for row in weights:
            k, J_z, J_u = field(z + _mix(row, rates), u)
            if rates:
                J_u = ca.mtimes(J_z, _mix(row, pushes)) + J_u
                J_z = ca.mtimes(J_z, unit + _mix(row, turns))
            rates.append(k)
            turns.append(J_z)
            pushes.append(J_u)
        after = [z + _mix(last, rates), unit + _mix(last, turns), _mix(last, pushes)]
        return SizedFunction("turned", inputs, [ca.densify(x) for x in after])

    def _called(self, name: str, Z: Floats, U: Floats) -> list[Floats]:
        """The outputs at all points, one after the other in one array each; up to `MOST` points in a call."""
        if name not in self._functions:
            self._functions[name] = self._turned() if name == "turned" else self._ahead()
        function, parts = self._functions[name], []
        # Operations for one point; those of derivatives are as many as of the field for each of its values.
        stages = 1 if name == "rate" else len((ROUGH if name == "turned" else self._scheme)[0])
        operations = self._field.n_instructions() * stages
        operations *= self._field.size1_out(0) if name == "turned" else 1
        for i in range(0, len(Z), MOST):
            given = Z[i : i + MOST], U[i : i + MOST]
            count = len(given[0])
            many = 1 << (count - 1).bit_length()  # few sizes, each built once
            if (name, many) not in self._bound:
                mapped = SizedFunction(function.map(many) if many > 1 else function)
                self._bound[name, many] = BoundFunction(mapped, [np.zeros((many, X.shape[1])) for X in given])
            bound = self._bound[name, many]
            progress.reckon(many * operations * progress.PARAMETERS.operation)
            for argument, X in zip(bound.arguments, given, strict=True):
                assert argument.shape[1] == X.shape[1], (function.name(), Z.shape, U.shape)
                argument[:count], argument[count:] = X, X[:1]
            bound.trigger()
            parts.append([x.T.ravel()[: x.size // many * count].copy() for x in bound.results])
        if not parts:
            return [np.zeros(0)] * function.n_out()
        return [np.concatenate(each) for each in zip(*parts, strict=True)] if len(parts) > 1 else parts[0]


def _short(expression: ca.SX) -> ca.SX:
    """The expression with common subexpressions shared, where the search for them is quick."""
    return ca.cse(expression) if ca.n_nodes(expression) <= SHARED_NODES else expression


def _mix(weights: Sequence[float], stages: Sequence[ca.MX]) -> ca.MX:
    return sum((a * stage for a, stage in zip(weights, stages, strict=True) if a), ca.MX(0))
