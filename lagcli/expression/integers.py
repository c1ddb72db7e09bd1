"""Integer expressions: the bounds of ranges, the indices in brackets, the filters of families.

Exact: a value is an `int`, a `Fraction`, or an array (K,) over the members of a family. A half is taken on the way
(`i <= N/2`), and refused where a whole number must come out. Nothing above `LIMIT` is kept: no power runs long.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from lagcli.expression import evaluate as walk
from lagcli.expression import tree
from lagcli.expression.functions import Number
from lagcli.expression.tree import ExpressionError

Integers = int | npt.NDArray[np.int64]
Truth = bool | npt.NDArray[np.bool_]
Lookup = Callable[[tree.Name], object]  # an int, a float, an array (K,), or what is no number
# An `int` or a `Fraction`, or an array (K,) of int64, of objects where a fraction is among them.
Exact = Number

LIMIT = 2**53  # above it not every whole number is a double
_LARGE, _ZERO = "this is beyond the whole numbers up to 2**53", "this divides by zero"
_RULE = "bounds and indices are integer expressions of parameters and earlier indices"

# Of numbers and of arrays, without an overflow.
_TOP, _BOTTOM = (np.frompyfunc(operator.attrgetter(part), 1, 1) for part in ("numerator", "denominator"))
_OPERATIONS: dict[str, Callable[[Exact, Exact], Exact]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": np.frompyfunc(operator.mul, 2, 1),
    "div": np.frompyfunc(Fraction, 2, 1),
    "pow": np.frompyfunc(lambda base, exponent: Fraction(base) ** exponent, 2, 1),
    "min": np.frompyfunc(min, 2, 1),
    "max": np.frompyfunc(max, 2, 1),
}
_RELATIONS: dict[str, Callable[[Exact, Exact], Truth]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def evaluate(node: tree.Node, lookup: Lookup) -> Integers:
    """The value of an integer expression: an `int`, or int64 of shape (K,) where it differs by member.

    `lookup` gives the number or array (K,) of a name, floats with whole values included, and may raise an
    `ExpressionError` of its own. Raises `ExpressionError`: `not-a-whole-number` (with its `member`) for what
    is not whole, above 2**53 or no integer expression, `not-finite` for a division by zero.
    """
    return _whole(node, _exact(node, lookup), "this must be a whole number")


def holds(node: tree.Node, lookup: Lookup) -> Truth:
    """The truth of a filter: a `bool`, or bool of shape (K,) where it is asked of K members. Every comparison is
    evaluated for every member, whatever those before it say. Raises as `evaluate`."""
    match node:
        case tree.Logical():
            truths = [holds(part, lookup) for part in node.parts]
            if node.word == "not":
                return not truths[0] if isinstance(truths[0], bool) else ~truths[0]
            return functools.reduce(operator.and_ if node.word == "and" else operator.or_, truths)
        case tree.ComparisonNode():
            values = [_exact(operand, lookup) for operand in node.operands]
            pairs = zip(values, node.relations, values[1:], strict=False)
            return functools.reduce(operator.and_, [_RELATIONS[relation](u, w) for u, relation, w in pairs])
        case _:
            raise TypeError(node)


def _exact(node: tree.Node, lookup: Lookup) -> Exact:
    for part in tree.walk(node):
        is_known = isinstance(part, tree.Call) and part.function in walk.FUNCTION_NAMES
        if isinstance(part, (tree.Vector, tree.Member, tree.Index, tree.Component)) or (
            is_known and isinstance(part, tree.Call) and part.function not in ("min", "max", "abs")
        ):
            raise _unfit(part)
    return walk.scalar(node, _ExactAlgebra(lookup))


class _ExactAlgebra:
    def __init__(self, lookup: Lookup) -> None:
        self._lookup = lookup

    def number(self, node: tree.Number) -> Exact:
        value = float(node.text)
        is_exact = node.text.isdecimal() and value <= LIMIT
        return _integers(node, int(node.text.lstrip("0") or "0") if is_exact else value)

    def atom(self, node: tree.Reference) -> Exact:
        assert isinstance(node, tree.Name)
        return _integers(node, self._lookup(node))

    def special(self, node: tree.Call) -> Exact:
        raise _unfit(node)

    def operation(self, node: tree.Node, name: str, *parts: Exact) -> Exact:
        first, last = parts[0], parts[-1]
        if name in ("neg", "abs"):
            return -first if name == "neg" else abs(first)
        if name == "div":
            _refuse(node, last == 0, _ZERO, "not-finite")
        elif name == "pow":
            exponent: Exact = _whole(node, last, "the exponent must be a whole number")
            _refuse(node, (exponent < 0) & (first == 0), _ZERO, "not-finite")
            # From 2 on, and down from a half, an exponent above 53 is beyond the limit.
            _refuse(node, (first != 0) & (abs(first) != 1) & (abs(exponent) > 53), _LARGE)
            parts = first, exponent
        return _kept(node, functools.reduce(_OPERATIONS[name], parts))


def _integers(node: tree.Node, value: object) -> Integers:
    """A number or array that a name stands for, as whole numbers."""
    if isinstance(value, int):
        return int(_kept(node, value))
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
    found: Integers = _kept(node, array.astype(np.int64) if array.ndim else int(array))
    return found


def _kept(node: tree.Node, value: Exact) -> Exact:
    """The value, whole numbers as such. Raises where it is beyond the limit."""
    if isinstance(value, int) or getattr(value, "dtype", None) == np.int64:
        _refuse(node, abs(value) > LIMIT, _LARGE)
        return value
    top, bottom = _TOP(value), _BOTTOM(value)
    _refuse(node, (abs(top) > LIMIT) | (bottom > LIMIT), _LARGE)
    if np.any(bottom != 1):
        return value
    return top.astype(np.int64) if isinstance(top, np.ndarray) else top


def _whole(node: tree.Node, value: Exact, message: str) -> Integers:
    """The value as whole numbers. Raises where it is none."""
    if isinstance(value, int):
        return value
    failing = _BOTTOM(value) != 1
    if np.any(failing):
        message += f", and is {np.atleast_1d(value)[int(np.argmax(failing))]}"
    _refuse(node, failing, message)
    found: Integers = value
    return found


def _refuse(node: tree.Node, failing: Truth, message: str, code: str = "not-a-whole-number") -> None:
    if failing is not False and np.any(failing):
        member = int(np.argmax(failing)) if np.ndim(failing) else None
        hint = _RULE if code == "not-a-whole-number" else ""
        raise ExpressionError(code, message, node.start, node.end, hint, member=member)


def _unfit(node: tree.Node) -> ExpressionError:
    return ExpressionError("not-a-whole-number", "this is no integer expression", node.start, node.end, _RULE)
