"""The facts about an expression known before any dynamics, as one more algebra: its value if constant, what it reads,
its degree; and what is wrong with a formula and where, with the first member of a family that it is wrong of."""

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
_PRODUCTS = ("mul", "div", "pow")
# Of floats, and of arrays.
_ARITHMETIC: dict[str, tuple[Callable[..., float], Callable[..., Value]]] = {
    **{name: (rule, rule) for name, rule in functions.ARITHMETIC.items()},
    "pow": (math.pow, np.power),
}

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
    """lookup: gives the facts of a name; allowed: what the expression may read; subject: how errors call it ("a
    potential"); linear: degrees above one in differentials are errors, which quote a term of the text."""

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

    def operation(self, node: tree.Node, name: str, *parts: Facts) -> Facts:
        if name == "div":
            divisor = parts[1].value
            if divisor is not None and not (divisor if divisor.__class__ is float else np.all(divisor)):
                member = int(np.argmin(divisor != 0.0)) if np.ndim(divisor) else None
                raise ExpressionError(
                    "not-finite", "this divides by zero", node.start, node.end, member=member
                )
        for part in parts:
            if part.value is None:
                break
        else:
            return self._constant(node, name, *map(constant, parts))
        left, right = parts[0], parts[-1]
        if name in ("add", "sub"):
            if left.value.__class__ is float and left.value == 0.0:
                return right
            if left is right or (right.value.__class__ is float and right.value == 0.0):
                return left
            low = left.low if left.low < right.low else right.low
            high = left.high if left.high > right.high else right.high
            if left.reads is right.reads and left.value is None and left.low == low and left.high == high:
                return left  # in a long sum one term is like the other
            return Facts(None, left.reads | right.reads, low, high)
        if name == "neg":
            return left
        if name == "mul":
            low, high = left.low + right.low, min(NONLINEAR, left.high + right.high)
            return self._checked(node, Facts(None, left.reads | right.reads, low, high))
        low, high = 0, NONLINEAR if any(part.high for part in parts) else 0
        if name == "div":
            low, high = left.low, high if right.high else left.high
        elif name == "pow" and high:
            every = np.array(math.nan) if right.value is None else np.asarray(right.value)
            if np.all((every == np.floor(every)) & (every >= 0.0)):
                # Exponents 0, 1, 2, ..., up to `NONLINEAR`.
                capped = np.minimum(every, NONLINEAR)
                low = left.low * int(np.min(capped, initial=NONLINEAR))
                high = min(NONLINEAR, left.high * int(np.max(capped, initial=0)))
        reads = NOTHING.union(*[part.reads for part in parts])
        return self._checked(node, Facts(None, reads, low, high), name == "div" and bool(right.high))

    def _constant(self, node: tree.Node, name: str, *values: Value) -> Facts:
        """An operation on constants: a number, or one for each member."""
        row = functions.TABLE.get(name)
        number, array = (row.value, row.array) if row else _ARITHMETIC[name]
        if all(isinstance(value, float) for value in values):
            try:
                result = number(*values)
            except (ValueError, ZeroDivisionError):
                message = f"`{'**' if name == 'pow' else name}` is not defined for this value"
                raise ExpressionError("not-finite", message, node.start, node.end) from None
            except OverflowError:
                result = math.inf
            if result == 0.0 and name in _PRODUCTS:
                _require_kept(node, all(values))
            return Facts(self._finite(node, result))
        with np.errstate(all="ignore"):
            found = np.asarray(array(*values), dtype=float)
        broken = ~np.isfinite(found)
        if name in _PRODUCTS and not found.all():
            broken |= (found == 0.0) & (values[0] != 0.0) & (values[1] != 0.0)
        if broken.any():
            # The first of them says what is wrong.
            member = int(np.argmax(broken))
            try:
                self._constant(
                    node, name, *(float(np.broadcast_to(value, found.shape).flat[member]) for value in values)
                )
                self._finite(node, math.inf)
            except ExpressionError as error:
                error.member = member if found.ndim else None
                raise
        return Facts(found if found.ndim else float(found))

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
