"""The facts about an expression known before any dynamics: its value if constant, what it reads, its degree.

One more algebra for `evaluate`, which finds what is wrong with a formula and where. A constant of a family is an array
with one entry for each member; an error names the first that it is of.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli.expression import evaluate, functions, hints, tokens, tree
from lagcli.expression.tree import ExpressionError

Flag = Literal["position", "cartesian", "velocity", "time", "differential", "mass", "acceleration", "result"]

Value = float | npt.NDArray[np.float64]

# The degree of what is no polynomial; higher ones count as this.
NONLINEAR = 9

# What is 0 only where an operand is.
_PRODUCTS: tuple[Callable[..., Value], ...] = (np.multiply, np.divide, np.power)

NOTHING: frozenset[Flag] = frozenset()
POSITION_OR_TIME: frozenset[Flag] = frozenset(("position", "time"))
POSITION: frozenset[Flag] = POSITION_OR_TIME | {"cartesian"}
MOTION: frozenset[Flag] = POSITION | {"velocity"}
FORCE: frozenset[Flag] = MOTION | {"mass"}
DIFFERENTIAL: frozenset[Flag] = MOTION | {"differential"}
OUTPUT: frozenset[Flag] = MOTION | {"acceleration", "result"}


@dataclasses.dataclass(slots=True, eq=False)
class Facts:
    """About a scalar: its `value` if that depends on parameters and indices only (a float, or an array of shape (K,)
    for the K members of a family), what it `reads`, and its lowest and highest degree in differentials and velocities
    (`low`, `high`). Never changed once made (see `tree`), and equal to itself alone."""

    value: Value | None = None
    reads: frozenset[Flag] = NOTHING
    low: int = 0
    high: int = 0


Either = Facts | tuple[Facts, Facts, Facts]  # of a scalar, or of the three components of a vector
Lookup = Callable[[tree.Node], Either]

FLAG_ERRORS: dict[str, tuple[str, str]] = {
    "position": ("position-not-allowed", "may not depend on positions or coordinates"),
    "cartesian": ("position-not-allowed", "may not depend on the positions of Cartesian particles"),
    "velocity": ("velocity-not-allowed", "may not depend on velocities or rates"),
    "time": ("time-not-allowed", "may not depend on the time `t`"),
    "differential": ("differential-not-allowed", "may not hold differentials"),
    "acceleration": ("result-not-allowed", "may not depend on accelerations"),
    "result": ("result-not-allowed", "may not depend on multipliers, reactions or energies"),
}


class FactsAlgebra:
    """lookup: gives the facts of a name; allowed: what the expression may read; subject: how the error calls the
    expression ("a potential"); linear: whether degrees above one in differentials are errors; text: the expression as
    it is written, of which that error quotes the term."""

    def __init__(
        self,
        lookup: Lookup,
        allowed: frozenset[Flag],
        subject: str,
        linear: bool = False,
        text: str = "",
    ) -> None:
        self.lookup = lookup
        self._allowed = allowed
        self._subject = subject
        self._linear = linear
        self._text = text
        self._numbers: dict[str, Facts] = {}

    def number(self, node: tree.Number) -> Facts:
        known = self._numbers.get(node.text)
        if known is None:
            value = self._finite(node, float(node.text))
            if value == 0.0:
                _require_kept(node, tokens.has_size(node.text))
            known = self._numbers[node.text] = Facts(value)
        return known

    def atom(self, node: tree.Reference) -> Either:
        return self._leaf(node, self.lookup(node))

    def special(self, node: tree.Call) -> Either:
        if node.function != "d":
            return self._leaf(node, self.lookup(node))
        if "differential" not in self._allowed:
            self._refuse(node, _differential_of(Facts()))
        inner = FactsAlgebra(self.lookup, POSITION, "a differential `d(...)` is of positions and time; it")
        value = evaluate.value(node.arguments[0], inner)
        return self._leaf(node, evaluate.each(_differential_of, value))

    def _leaf(self, node: tree.Node, value: Either) -> Either:
        for part in value if isinstance(value, tuple) else (value,):
            if part.high > 1 or not part.reads <= self._allowed:
                self._refuse(node, part)
        return value

    def _refuse(self, node: tree.Node, fact: Facts) -> None:
        """Raise the error for the first thing `fact` reads and the expression may not."""
        for flag, (code, words) in FLAG_ERRORS.items():
            if flag in fact.reads and flag not in self._allowed:
                message = f"{self._subject} {words}"
                hint = hints.way_out(flag, self._subject, _written(node))
                raise ExpressionError(code, message, node.start, node.end, hint)
        self._checked(node, fact)

    def _checked(self, node: tree.Node, fact: Facts, quotient: bool = False) -> Facts:
        """The fact itself, unless its degree in differentials and velocities is too high."""
        if not self._linear or fact.high <= 1:
            return fact
        term = self._text[node.start : node.end]
        message, hint = hints.nonlinear(term, fact.high, frozenset(fact.reads), quotient)
        raise ExpressionError("nonlinear-differential", message, node.start, node.end, hint)

    def add(self, node: tree.Node, left: Facts, sign: int, right: Facts) -> Facts:
        one, other = left.value, right.value
        if one is not None:
            if other is not None:
                if one.__class__ is float and other.__class__ is float:
                    return Facts(self._finite(node, one + sign * other))
                return self._each(
                    node, lambda u, w: u + sign * w, lambda u, w: self.add(node, u, sign, w), one, other
                )
            if one.__class__ is float and one == 0.0:
                return right
        elif left is right or (other.__class__ is float and other == 0.0):
            return left
        low = left.low if left.low < right.low else right.low
        high = left.high if left.high > right.high else right.high
        if left.reads is right.reads and left.value is None and left.low == low and left.high == high:
            return left  # in a long sum one term is like the other
        return Facts(None, left.reads | right.reads, low, high)

    def negate(self, node: tree.Node, value: Facts) -> Facts:
        return value if value.value is None else Facts(-value.value)

    def multiply(self, node: tree.Node, left: Facts, right: Facts) -> Facts:
        one, other = left.value, right.value
        if one is not None and other is not None:
            if one.__class__ is float and other.__class__ is float:
                return Facts(self._product(node, one * other, one, other))
            return self._each(node, np.multiply, lambda u, w: self.multiply(node, u, w), one, other)
        low, high = left.low + right.low, min(NONLINEAR, left.high + right.high)
        return self._checked(node, Facts(None, left.reads | right.reads, low, high))

    def divide(self, node: tree.Node, left: Facts, right: Facts) -> Facts:
        one, other = left.value, right.value
        if other is not None and not (other if other.__class__ is float else np.all(other)):
            member = int(np.argmin(other != 0.0)) if np.ndim(other) else None
            raise ExpressionError("not-finite", "this divides by zero", node.start, node.end, member=member)
        if one is not None and other is not None:
            if one.__class__ is float and other.__class__ is float:
                return Facts(self._product(node, one / other, one, other))
            return self._each(node, np.divide, lambda u, w: self.divide(node, u, w), one, other)
        high = NONLINEAR if right.high else left.high
        return self._checked(node, Facts(None, left.reads | right.reads, left.low, high), bool(right.high))

    def power(self, node: tree.Node, base: Facts, exponent: Facts) -> Facts:
        one, other = base.value, exponent.value
        if one is not None and other is not None:
            if isinstance(one, float) and isinstance(other, float):
                power = self._constant(node, "**", math.pow, one, other)
                return Facts(self._product(node, power, one, other))
            return self._each(node, np.power, lambda u, w: self.power(node, u, w), one, other)
        reads = base.reads | exponent.reads
        if not base.high and not exponent.high:
            return Facts(None, reads)
        low, high = 0, NONLINEAR
        every = np.array(math.nan) if other is None else np.asarray(other)
        if np.all((every == np.floor(every)) & (every >= 0.0)):
            # Exponents 0, 1, 2, ..., up to `NONLINEAR`.
            capped = np.minimum(every, NONLINEAR)
            low = base.low * int(np.min(capped, initial=NONLINEAR))
            high = min(NONLINEAR, base.high * int(np.max(capped, initial=0)))
        return self._checked(node, Facts(None, reads, low, high))

    def function(self, node: tree.Node, name: str, arguments: tuple[Facts, ...]) -> Facts:
        values = [a.value for a in arguments if a.value is not None]
        if len(values) == len(arguments):
            if all(isinstance(value, float) for value in values):
                return Facts(self._constant(node, name, functions.TABLE[name].value, *values))
            return self._each(
                node, functions.TABLE[name].array, lambda *parts: self.function(node, name, parts), *values
            )
        reads = frozenset[Flag]().union(*(a.reads for a in arguments))
        high = NONLINEAR if any(a.high for a in arguments) else 0
        return self._checked(node, Facts(None, reads, 0, high))

    def _each(
        self, node: tree.Node, compute: Callable[..., Value], again: Callable[..., Facts], *values: Value
    ) -> Facts:
        """A constant for each member. For the first that is not finite, `again` says what is wrong."""
        with np.errstate(all="ignore"):
            found = np.asarray(compute(*values), dtype=float)
        broken = ~np.isfinite(found)
        if compute in _PRODUCTS and not found.all():
            broken |= (found == 0.0) & (values[0] != 0.0) & (values[1] != 0.0)
        if broken.any():
            member = int(np.argmax(broken))
            try:
                again(*(Facts(float(np.broadcast_to(value, found.shape).flat[member])) for value in values))
                self._finite(node, math.inf)
            except ExpressionError as error:
                error.member = member if found.ndim else None
                raise
        return Facts(found if found.ndim else float(found))

    def _constant(self, node: tree.Node, name: str, compute: Callable[..., float], *values: Value) -> float:
        try:
            value = compute(*values)
        except (ValueError, ZeroDivisionError):
            message = f"`{name}` is not defined for this value"
            raise ExpressionError("not-finite", message, node.start, node.end) from None
        except OverflowError:
            value = math.inf
        return self._finite(node, value)

    def _product(self, node: tree.Node, value: float, one: float, other: float) -> float:
        """The product, quotient or power of two constants, which is 0 only where one of them is."""
        if value == 0.0:
            _require_kept(node, one != 0.0 and other != 0.0)
        return self._finite(node, value)

    @staticmethod
    def _finite(node: tree.Node, value: float) -> float:
        if not math.isfinite(value):
            message = "this constant is not finite: it is larger than 1.8e308 or not a number"
            raise ExpressionError("not-finite", message, node.start, node.end)
        return value


def _require_kept(node: tree.Node, has_size: bool) -> None:
    """Raise `ExpressionError` of a constant that doubles hold as 0, and that is something."""
    if has_size:
        message = "this constant is not 0, and smaller than 4.9e-324, the least number there is"
        hint = "choose units in which it is nearer to 1, or leave it out where it does not matter"
        raise ExpressionError("not-finite", message, node.start, node.end, hint)


def constant(fact: Facts) -> Value:
    """The value of what depends on parameters and indices only."""
    assert fact.value is not None
    return fact.value


def _written(node: tree.Node) -> str:
    match node:
        case tree.Name() | tree.Member():
            return f"{node.owner}.{node.member}" if node.member else node.owner
        case tree.Index():
            return f"{node.owner}[...]"
        case tree.Call():
            return f"{node.function}({', '.join(map(_written, node.arguments))})"
        case tree.Number():
            return node.text
    return "..."


def _differential_of(part: Facts) -> Facts:
    return Facts(None, part.reads | {"differential"}, 1, 1)
