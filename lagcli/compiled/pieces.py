"""Pieces of space on which rows are analytic, and rows as they are on the piece of a point: what holds at one point of
a piece at generic ones holds at nearly all.

A piece ends where `abs`, `sign`, `min` or `max` switches, where a root or a power has no derivative, where `asin` or
`acos` comes to the end of its range (asin(sin(x)) turns back there), at the cut of `atan2`, and at poles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import kinks, operation_graph
from lagcli.equations.sized_function import SizedFunction
from lagcli.expression.functions import Function

Floats = npt.NDArray[np.float64]


def _end(row: Function) -> Callable[..., ca.SX]:
    """A function of the arguments that vanishes where one of the language is not analytic, which is not piecewise."""
    if row.domain is not None:
        low, high = row.domain
        return lambda a: (high - a) * (a - low)
    return getattr(ca, row.poles) if row.poles else lambda *a: a[0]


# What vanishes where a function of these arguments is not analytic.
ENDS: dict[int, Callable[..., ca.SX]] = {
    **kinks.ARGUMENTS,
    **{
        code: _end(row)
        for code, row in operation_graph.FUNCTIONS.items()
        if row.poles or (row.may_be_steep and not row.is_piecewise and row.jumps != "infinity")
    },
    ca.OP_HYPOT: lambda a, b: a * a + b * b,
    ca.OP_INV: lambda a: a,
    ca.OP_DIV: lambda a, b: b,
}
# An end that is touched between two points is seen where a parabola through three values comes this near to zero, as
# a part of the smaller of the outer ones.
TOUCHED = 0.1
# A start that is this near to an end, as a part of what the values of a path come to, lies on it.
ON_END = 1e-9
# In the first round a modulus may come to light, as the root of a square.
ROUNDS = 2


def ends(value: ca.SX, inputs: Sequence[ca.SX]) -> list[tuple[ca.SX, ca.SX]]:
    """Find functions of some `inputs` that vanish at the ends of the pieces of a matrix, each with one that is positive
    where it counts."""
    found: list[tuple[ca.SX, ca.SX]] = []

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        if op in (ca.OP_POW, ca.OP_CONSTPOW):
            end = None if _is_natural(parts[1]) else parts[0]
        else:
            end = ENDS[op](*parts) if op in ENDS else None
        if end is not None:
            # atan2(y, x) is cut where y = 0 and x < 0.
            found.append((end, -parts[1] if op == ca.OP_ATAN2 else ca.SX(1)))
        return result

    operation_graph.replayed(ca.densify(ca.vec(ca.SX(value).nz[:])), inputs, visit)
    return found


class AnalyticPieces:
    """The ends of the pieces of a matrix of functions of some `inputs`, the first of which is the point."""

    def __init__(self, value: ca.SX, inputs: list[ca.SX]) -> None:
        found = ends(value, inputs)
        moving = [(end, condition) for end, condition in found if ca.depends_on(end, inputs[0])]
        self.count = len(moving)
        values = [each[part] for part in range(2) for each in moving]
        self._values = SizedFunction("pieces", inputs, [ca.vertcat(ca.SX(0, 1), *values)])

    def end_between(self, path: Floats, *others: Floats) -> bool:
        """True if a path (points, N) may leave the piece that it begins on, by crossing an end or by touching it."""
        if not self.count:
            return False
        values = np.array([np.array(self._values(point, *others)).ravel() for point in path])
        u, conditions = values[:, : self.count], values[:, self.count :]
        if not np.isfinite(values).all():
            return True
        u = np.where(np.abs(u) <= ON_END * np.abs(u).max(axis=0, initial=0.0), 0.0, u)
        changes = (u[:-1] * u[1:] < 0) | ((u[:-1] != 0) & (u[1:] == 0))
        return bool(
            (changes & (np.maximum(conditions[:-1], conditions[1:]) > 0)).any() or _touched(np.abs(u)).any()
        )


def _is_natural(exponent: ca.SX) -> bool:
    return bool(exponent.is_constant() and float(exponent).is_integer() and float(exponent) >= 0)


def _touched(u: Floats) -> npt.NDArray[np.bool_]:
    """Marks of where |u| (points, K) is least between two points, by a parabola, and next to nothing there."""
    before, here, after = u[:-2], u[1:-1], u[2:]
    bend = before - 2 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        least = here - (before - after) ** 2 / (8 * bend)
    is_least = (here <= before) & (here <= after) & (bend > 0)
    return is_least & (least <= TOUCHED * np.minimum(before, after))


def on_branch(value: ca.SX, inputs: Sequence[ca.SX], point: Sequence[Floats], near: float) -> ca.SX:
    """A column on the branch of a point; a switch that is within `near` of it stays, unless a branch that is not taken
    holds it."""

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        if op not in kinks.ARGUMENTS:
            return result
        argument = kinks.ARGUMENTS[op](*parts)
        found = float(SizedFunction("switch", list(inputs), [argument])(*point))
        return kinks.on_side(op, parts, float(np.sign(found))) if abs(found) > near else result

    # A root of a square that came to light is a modulus.
    for _ in range(ROUNDS):
        value = operation_graph.replayed(value, inputs, visit)
    return value
