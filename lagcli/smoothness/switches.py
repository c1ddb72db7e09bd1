"""One pass over the operations of an expression: those that are not smooth everywhere, and what switches each. Where
its argument vanishes an operation jumps, has a kink, a root without a derivative, the end of a range or a pole. There
ends a piece of space on which rows are analytic: what holds at one generic point holds at nearly all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.expression import functions
from lagcli.expression.functions import Function
from lagcli.smoothness import operation_graph
from lagcli.smoothness.sized_function import SizedFunction

# An end that is touched between two points is seen where a parabola through three values comes this near to zero, as
# a part of the smaller of the outer ones.
TOUCHED = 0.1
# In the first round a modulus may come to light, as the root of a square.
ROUNDS = 2
QUOTIENT = "a quotient"


class Kind(NamedTuple):
    """A kind of operation: its word in the language, and what vanishes where it is not analytic, by its operands.
    is_comparing: it compares that with zero, and goes on smoothly on either side."""

    word: str
    argument: Callable[..., ca.SX | None]
    is_comparing: bool = False


def _difference(a: ca.SX, b: ca.SX) -> ca.SX:
    return a - b


def _base(base: ca.SX, exponent: ca.SX) -> ca.SX | None:
    is_natural = exponent.is_constant() and float(exponent).is_integer() and float(exponent) >= 0
    return None if is_natural else base


def _kind(row: Function) -> Kind:
    """The kind of a function of the language."""
    if row.is_piecewise:
        return Kind(row.name, (lambda a: a) if row.arguments == 1 else _difference, True)
    if row.domain is not None:
        low, high = row.domain
        return Kind(row.name, lambda a: (high - a) * (a - low))
    if row.poles:
        return Kind(row.name, getattr(ca, row.poles))
    # Where its argument is infinite nothing vanishes.
    return Kind(row.name, lambda *a: None if row.jumps == "infinity" else a[0])


# Derivatives of `min` and `max` are made of the comparisons without a word.
KINDS: dict[int, Kind] = {
    **{code: _kind(row) for code, row in operation_graph.FUNCTIONS.items() if row.may_be_steep or row.poles},
    **dict.fromkeys((ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE), Kind("", _difference, True)),
    ca.OP_HYPOT: Kind("", lambda a, b: a * a + b * b),
    ca.OP_INV: Kind(QUOTIENT, lambda a: a),
    ca.OP_DIV: Kind(QUOTIENT, lambda a, b: b),
    ca.OP_POW: Kind("**", _base),
    ca.OP_CONSTPOW: Kind("**", _base),
}
PHRASES = {row.name: row.edge for row in functions.TABLE.values() if row.edge}


class Switch(NamedTuple):
    """An operation, its operands and its result; `argument` as its kind has it, None where nothing of it vanishes."""

    op: int
    parts: Sequence[ca.SX]
    value: ca.SX
    argument: ca.SX | None

    @property
    def kind(self) -> Kind:
        return KINDS[self.op]

    @property
    def condition(self) -> ca.SX:
        """Positive where it switches: atan2(y, x) is cut where y = 0 and x < 0."""
        return -self.parts[1] if self.op == ca.OP_ATAN2 else ca.SX(1)


def among(value: ca.SX, inputs: Sequence[ca.SX]) -> list[Switch]:
    """The switches of a matrix of functions of the `inputs`, inner ones first."""
    found: list[Switch] = []

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        if op in KINDS:
            found.append(Switch(op, parts, result, KINDS[op].argument(*parts)))
        return result

    operation_graph.replayed(ca.densify(ca.vec(ca.SX(value).nz[:])), inputs, visit)
    return found


def compared(value: ca.SX, inputs: Sequence[ca.SX]) -> list[ca.SX]:
    """The values that `abs`, `sign`, `min`, `max` and their derivatives compare with zero."""
    comparing = (each.argument for each in among(value, inputs) if each.kind.is_comparing)
    return [argument for argument in comparing if argument is not None]


def is_comparing(op: int) -> bool:
    """True for an operation that compares something with zero."""
    return op in KINDS and KINDS[op].is_comparing


def comparison(op: int, parts: Sequence[ca.SX]) -> ca.SX | None:
    """The value that an operation compares with zero; None for one that compares nothing."""
    return KINDS[op].argument(*parts) if is_comparing(op) else None


def on_side(op: int, parts: Sequence[ca.SX], side: float) -> ca.SX:
    """The value of an operation that compares where its argument has the sign `side`, 1 or -1."""
    if op in (ca.OP_FMIN, ca.OP_FMAX):
        return parts[0 if (side > 0) == (op == ca.OP_FMAX) else 1]
    if op == ca.OP_FABS:
        return side * parts[0]
    if op == ca.OP_SIGN:
        return ca.SX(side)
    return ca.SX(op == ca.OP_NE or (side < 0 and op in (ca.OP_LT, ca.OP_LE)))


class AnalyticPieces:
    """The ends of the pieces of a matrix of functions of some `inputs`, the first of which is the point."""

    def __init__(self, value: ca.SX, inputs: list[ca.SX]) -> None:
        found = [(each.argument, each.condition) for each in among(value, inputs)]
        moving = [(end, over) for end, over in found if end is not None and ca.depends_on(end, inputs[0])]
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
        # A start that is so near to an end lies on it.
        u = np.where(np.abs(u) <= doubles.ZERO * np.abs(u).max(axis=0, initial=0.0), 0.0, u)
        changes = (u[:-1] * u[1:] < 0) | ((u[:-1] != 0) & (u[1:] == 0))
        changes &= np.maximum(conditions[:-1], conditions[1:]) > 0
        # Where |u| is least between two points, by a parabola, and next to nothing there.
        before, here, after = np.abs(u[:-2]), np.abs(u[1:-1]), np.abs(u[2:])
        bend = before - 2 * here + after
        with np.errstate(divide="ignore", invalid="ignore"):
            least = here - (before - after) ** 2 / (8 * bend)
        is_least = (here <= before) & (here <= after) & (bend > 0)
        return bool(changes.any() or (is_least & (least <= TOUCHED * np.minimum(before, after))).any())


def on_branch(value: ca.SX, inputs: Sequence[ca.SX], point: Sequence[Floats], near: float) -> ca.SX:
    """A column on the branch of a point; a switch within `near` of it stays, unless it is on a branch that is not."""

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        argument = comparison(op, parts)
        if argument is None:
            return result
        found = float(SizedFunction("switch", list(inputs), [argument])(*point))
        return on_side(op, parts, float(np.sign(found))) if abs(found) > near else result

    # A root of a square that came to light is a modulus.
    for _ in range(ROUNDS):
        value = operation_graph.replayed(value, inputs, visit)
    return value
