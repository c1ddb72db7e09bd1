"""Sizes of the terms that the values of a program are made of, those that cancel within one entry too: what the value
would change by, to first order, if every input and every result on the way changed by its own size. What rounding
leaves of a value that is zero is far below that."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.expression import functions

Pair = tuple[float, float]  # a value and its size


class Program(Protocol):
    """A function as the list of its operations."""

    def run(
        self,
        inputs: Sequence[Sequence[Pair]],
        constant: Callable[[float], Pair],
        result: Callable[..., Pair],
    ) -> list[Pair]: ...


def of(program: Program, inputs: Sequence[Floats]) -> Floats:
    """The sizes of the results of a program; infinite where there is no value, or a switch is near."""
    given = [[(x, 0.0 if x.is_integer() else abs(x)) for x in part.tolist()] for part in inputs]

    def constant(value: float) -> Pair:
        return value, 0.0 if value.is_integer() else max(abs(value), 1.0)

    found = np.array([size for _, size in program.run(given, constant, result)])
    return np.where(np.isnan(found), math.inf, found)


def result(name: str, *parts: Pair) -> Pair:
    """The value of an operation by its name in a `Program`, and its size; infinite where it has none or is unknown."""
    if name not in TWO and name not in functions.OPERATIONS:
        return math.nan, math.inf
    try:
        if name in TWO:
            value, size = TWO[name](*parts)
        else:
            (x, given), (function, slope) = parts[0], functions.OPERATIONS[name]
            value, size = function(x), 0.0
            if given and name in STEPS:
                size = math.inf if abs(x - STEPS[name](x)) <= doubles.VALUE * given else 0.0
            elif given:
                size = abs(slope(functions.SlopeSizes, x, value)) * given
    except (ArithmeticError, ValueError):
        return math.nan, math.inf
    if name in EXACT and size == 0.0 and value.is_integer() and abs(value) <= doubles.WHOLE:
        return value, 0.0
    return value, size if name in SWITCHES else size + abs(value)


# Where functions that step do so, next to a number.
STEPS: dict[str, Callable[[float], float]] = {
    **dict.fromkeys(("sign", "not"), lambda a: 0),
    **dict.fromkeys(("floor", "ceil"), round),
}


def _times(size: float, factor: float) -> float:
    return size * abs(factor) if size else 0.0  # not infinity times nothing


def _power(a: Pair, b: Pair) -> Pair:
    value = math.pow(a[0], b[0])
    size = _times(a[1], b[0] * math.pow(a[0], b[0] - 1.0) if b[0] else 0.0) if a[1] else 0.0
    return value, size + (_times(b[1], value * math.log(a[0])) if b[1] else 0.0)


def _angle(y: Pair, x: Pair) -> Pair:
    square = x[0] * x[0] + y[0] * y[0]
    size = (_times(y[1], x[0]) + _times(x[1], y[0])) / square
    jumps = bool(x[0] < 0 and y[1] and abs(y[0]) <= doubles.VALUE * y[1])
    return math.atan2(y[0], x[0]), math.inf if jumps else size


def _length(a: Pair, b: Pair) -> Pair:
    value = math.hypot(a[0], b[0])
    size = _times(a[1], a[0]) + _times(b[1], b[0])
    return value, size / value if size else 0.0


def _compared(holds: Callable[[float, float], bool]) -> Callable[[Pair, Pair], Pair]:
    def compared(a: Pair, b: Pair) -> Pair:
        # It is certain which of the two is larger, or that they are equal.
        size = a[1] + b[1]
        are_apart = not size or abs(a[0] - b[0]) > doubles.VALUE * size
        return float(holds(a[0], b[0])), 0.0 if are_apart else math.inf

    return compared


def _chosen(takes_first: Callable[[float, float], bool]) -> Callable[[Pair, Pair], Pair]:
    return lambda a, b: ((a if takes_first(a[0], b[0]) else b)[0], max(a[1], b[1]))


def _joined(holds: Callable[[bool, bool], bool]) -> Callable[[Pair, Pair], Pair]:
    return lambda a, b: (float(holds(bool(a[0]), bool(b[0]))), max(a[1], b[1]))


TWO: dict[str, Callable[[Pair, Pair], Pair]] = {
    "add": lambda a, b: (a[0] + b[0], a[1] + b[1]),
    "sub": lambda a, b: (a[0] - b[0], a[1] + b[1]),
    "mul": lambda a, b: (a[0] * b[0], _times(a[1], b[0]) + _times(b[1], a[0])),
    "div": lambda a, b: (a[0] / b[0], a[1] / abs(b[0]) + _times(b[1], a[0] / b[0] / b[0])),
    "pow": _power,
    "constpow": _power,
    "atan2": _angle,
    "hypot": _length,
    "fmin": _chosen(lambda a, b: a <= b),
    "fmax": _chosen(lambda a, b: a >= b),
    "lt": _compared(lambda a, b: a < b),
    "le": _compared(lambda a, b: a <= b),
    "eq": _compared(lambda a, b: a == b),
    "ne": _compared(lambda a, b: a != b),
    "and": _joined(lambda a, b: a and b),
    "or": _joined(lambda a, b: a or b),
    "if_else_zero": lambda a, b: (
        b[0] if a[0] else 0.0,
        math.inf if a[1] == math.inf else b[1] if a[0] else 0.0,
    ),
}
EXACT = {"add", "sub", "mul", "sq", "twice", "neg", "assign", "fabs", "fmin", "fmax", "if_else_zero"}
SWITCHES = {"sign", "not", "floor", "ceil", "lt", "le", "eq", "ne", "and", "or", "if_else_zero"}
