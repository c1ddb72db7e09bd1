"""Integer expressions: the bounds of ranges, the indices in brackets, the filters of families.

Exact: a value is a fraction of whole numbers, each a Python `int` or an int64 array of shape (K,), one entry
for each member of a family. A half is taken on the way (`i <= N/2`), and refused where a whole number must
come out. No number above `LIMIT` is made, so that nothing overflows and no power runs long.
"""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lagcli.expression import evaluate as walk
from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError

Integers = int | npt.NDArray[np.int64]
Truth = bool | npt.NDArray[np.bool_]
Lookup = Callable[[tree.Name], object]  # an int, a float, an array (K,), or what is no number

LIMIT = 2**53  # above it not every whole number is a double
_FUNCTIONS = ("min", "max", "abs")
_LARGE, _ZERO = "this is beyond the whole numbers up to 2**53", "this divides by zero"
_RULE = "bounds and indices are integer expressions of parameters and earlier indices"


@dataclasses.dataclass(slots=True, eq=False)
class _Fraction:
    """`top / bottom` with `bottom` positive, in lowest terms."""

    top: Integers
    bottom: Integers = 1


def evaluate(node: tree.Node, lookup: Lookup) -> Integers:
    """The value of an integer expression: an `int`, or int64 of shape (K,) where it differs by member.

    `lookup` gives the number or array (K,) of a name, floats with whole values included, and may raise an
    `ExpressionError` of its own. Raises `ExpressionError`: `not-a-whole-number` (with its `member`) for what
    is not whole, above 2**53 or no integer expression, `not-finite` for a division by zero.
    """
    found = _fraction(node, lookup)
    _refuse(node, found.bottom != 1, "this must be a whole number", found)
    return found.top


def holds(node: tree.Node, lookup: Lookup) -> Truth:
    """The truth of a filter: a `bool`, or bool of shape (K,) where it is asked of K members.

    Every comparison is evaluated for every member, whatever those before it say. Raises as `evaluate`.
    """
    match node:
        case tree.Not():
            return _not(holds(node.inner, lookup))
        case tree.And():
            return _all([holds(part, lookup) for part in node.parts])
        case tree.Or():
            return _not(_all([_not(holds(part, lookup)) for part in node.parts]))
        case tree.ComparisonNode():
            values = [_fraction(operand, lookup) for operand in node.operands]
            pairs = zip(values, node.relations, values[1:], strict=False)
            return _all([_RELATIONS[relation](_order(node, u, w), 0) for u, relation, w in pairs])
        case _:
            raise TypeError(node)


_RELATIONS: dict[str, Callable[[Integers, int], Truth]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def _all(truths: list[Truth]) -> Truth:
    total: Truth = True
    for truth in truths:
        total = truth & total
    return total if isinstance(total, bool) else np.asarray(total, dtype=bool)


def _not(truth: Truth) -> Truth:
    return not truth if isinstance(truth, bool) else ~truth


def _fraction(node: tree.Node, lookup: Lookup) -> _Fraction:
    for part in tree.walk(node):
        known = isinstance(part, tree.Call) and part.function in walk.FUNCTION_NAMES
        if isinstance(part, (tree.Vector, tree.Member, tree.Index, tree.Component)) or (
            known and isinstance(part, tree.Call) and part.function not in _FUNCTIONS
        ):
            raise _unfit(part)
    return walk.scalar(node, _Fractions(lookup))


class _Fractions:
    """Fractions as an algebra for `expression.evaluate`."""

    def __init__(self, lookup: Lookup) -> None:
        self._lookup = lookup

    def number(self, node: tree.Number) -> _Fraction:
        value = float(node.text)
        exact = node.text.isdecimal() and value <= LIMIT
        return _Fraction(_integers(node, int(node.text.lstrip("0") or "0") if exact else value))

    def atom(self, node: tree.Name | tree.Member | tree.Index) -> _Fraction:
        if not isinstance(node, tree.Name):
            raise _unfit(node)
        return _Fraction(_integers(node, self._lookup(node)))

    def special(self, node: tree.Call) -> _Fraction:
        raise _unfit(node)

    def add(self, node: tree.Node, left: _Fraction, sign: int, right: _Fraction) -> _Fraction:
        if _is_one(left.bottom) and _is_one(right.bottom):
            return _Fraction(_limited(node, left.top + sign * right.top))
        one = _times(node, left.top, right.bottom)
        other = _times(node, right.top, left.bottom)
        return _reduced(_limited(node, one + sign * other), _times(node, left.bottom, right.bottom))

    def negate(self, node: tree.Node, value: _Fraction) -> _Fraction:
        return _Fraction(-value.top, value.bottom)

    def multiply(self, node: tree.Node, left: _Fraction, right: _Fraction) -> _Fraction:
        # Reduced crosswise, so that the limit is that of the product in lowest terms.
        a, b = _reduced(left.top, right.bottom), _reduced(right.top, left.bottom)
        return _Fraction(_times(node, a.top, b.top), _times(node, a.bottom, b.bottom))

    def divide(self, node: tree.Node, left: _Fraction, right: _Fraction) -> _Fraction:
        return self.multiply(node, left, _inverse(node, right))

    def power(self, node: tree.Node, base: _Fraction, exponent: _Fraction) -> _Fraction:
        _refuse(node, exponent.bottom != 1, "the exponent must be a whole number", exponent)
        negative = exponent.top < 0
        if np.any(negative):
            _refuse(node, negative & (base.top == 0), _ZERO, code="not-finite")
            inverse = _inverse(node, _Fraction(_choose(base.top == 0, 1, base.top), base.bottom))
            base = _either(negative, inverse, base)
        times = _size(exponent.top)
        return _Fraction(_raised(node, base.top, times), _raised(node, base.bottom, times))

    def function(self, node: tree.Node, name: str, arguments: tuple[_Fraction, ...]) -> _Fraction:
        best, *others = arguments
        if name == "abs":
            return _Fraction(_size(best.top), best.bottom)
        for other in others:
            order = _order(node, best, other)
            best = _either(order <= 0 if name == "min" else order >= 0, best, other)
        return best


def _is_one(value: Integers) -> bool:
    return isinstance(value, int) and value == 1


def _size(value: Integers) -> Integers:
    return abs(value) if isinstance(value, int) else np.abs(value)


def _choose(truth: Truth, one: Integers, other: Integers) -> Integers:
    if isinstance(truth, bool):
        return one if truth else other
    return np.where(truth, np.asarray(one, np.int64), np.asarray(other, np.int64))


def _either(truth: Truth, one: _Fraction, other: _Fraction) -> _Fraction:
    bottom = 1 if _is_one(one.bottom) and _is_one(other.bottom) else _choose(truth, one.bottom, other.bottom)
    return _Fraction(_choose(truth, one.top, other.top), bottom)


def _order(node: tree.Node, left: _Fraction, right: _Fraction) -> Integers:
    """Below, at or above zero as `left` is below, at or above `right`."""
    return _times(node, left.top, right.bottom) - _times(node, right.top, left.bottom)


def _inverse(node: tree.Node, value: _Fraction) -> _Fraction:
    _refuse(node, value.top == 0, _ZERO, code="not-finite")
    negative = value.top < 0
    return _Fraction(_choose(negative, -value.bottom, value.bottom), _size(value.top))


def _reduced(top: Integers, bottom: Integers) -> _Fraction:
    if _is_one(bottom):
        return _Fraction(top)
    if isinstance(top, int) and isinstance(bottom, int):
        common = math.gcd(top, bottom)
        return _Fraction(top // common, bottom // common)
    shared = np.gcd(top, bottom)
    return _Fraction(top // shared, bottom // shared)


def _times(node: tree.Node, left: Integers, right: Integers) -> Integers:
    if isinstance(left, int) and isinstance(right, int):
        return _limited(node, left * right)
    return _limited(node, left * right, np.multiply(left, right, dtype=float))


def _raised(node: tree.Node, base: Integers, times: Integers) -> Integers:
    """base ** times, `times` >= 0."""
    if _is_one(base):
        return 1
    # From |base| = 2 on, an exponent above 53 is beyond the limit; below, only its parity counts.
    _refuse(node, (_size(base) > 1) & (times > 53), _LARGE)
    times = _choose(times > 53, 2 + times % 2, times)
    if isinstance(base, int) and isinstance(times, int):
        return _limited(node, base**times)
    base, times = np.asarray(base, np.int64), np.asarray(times, np.int64)
    with np.errstate(over="ignore"):
        return _limited(node, np.power(base, times), np.power(base, times, dtype=float))


def _integers(node: tree.Node, value: object) -> Integers:
    """A number or array that a name stands for, as whole numbers."""
    if isinstance(value, int):
        return _limited(node, value)
    if isinstance(value, tuple):
        raise _unfit(node)
    array = np.asarray(value)
    if array.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            broken = ~(np.abs(array) <= LIMIT) | (array != np.floor(array))
        if broken.any():
            member = int(np.argmax(broken)) if array.ndim else None
            number = float(array.flat[member or 0])
            message = f"this must be a whole number up to 2**53, and is {number:.15g}"
            raise ExpressionError("not-a-whole-number", message, node.start, node.end, _RULE, member=member)
    return _limited(node, array.astype(np.int64) if array.ndim else int(array))


def _limited(node: tree.Node, value: Integers, rough: float | npt.NDArray[np.float64] = 0.0) -> Integers:
    """The value, unless it is beyond the limit; `rough`, in float64, tells where an int64 wrapped around."""
    size = abs(rough) if isinstance(rough, float) else np.abs(rough)
    _refuse(node, (value > LIMIT) | (value < -LIMIT) | (size > 2.0 * LIMIT), _LARGE)
    return value


def _refuse(
    node: tree.Node,
    failing: Truth,
    message: str,
    value: _Fraction | None = None,
    code: str = "not-a-whole-number",
) -> None:
    """Raise where something fails, at the first failing member; value: what is shown."""
    if failing is False or not np.any(failing):
        return
    member = int(np.argmax(failing)) if np.ndim(failing) else None
    if value is not None:
        at = member or 0
        top, bottom = (int(np.ravel(part)[at % np.size(part)]) for part in (value.top, value.bottom))
        message = f"{message}, and is {top}/{bottom}"
    hint = _RULE if code == "not-a-whole-number" else ""
    raise ExpressionError(code, message, node.start, node.end, hint, member=member)


def _unfit(node: tree.Node) -> ExpressionError:
    return ExpressionError("not-a-whole-number", "this is no integer expression", node.start, node.end, _RULE)
