"""The zero test: does an expression vanish identically? Yes, no or unknown, never a guess.

"Yes" comes from the exact normal form only (`normal_form`), "no" from a rigorous interval at a rational point that does
not hold zero (`enclosure`), or from a normal form in algebraically independent generators. It holds for real symbols,
generic values of the parameters and wherever the expression is defined.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import sympy

from lagcli.pfaffian.exact import enclosure, guarded, normal_form, time_limit

Proof = Literal["symbolic", "numeric", "none"]


@dataclass(frozen=True, slots=True)
class Finding:
    """An answer, None where it is unknown, with its proof; `reason`: why it is unknown; `value`: a numeric proof."""

    truth: bool | None
    proof: Proof
    reason: str = ""
    value: enclosure.NonZero | None = None


def is_zero(
    expression: sympy.Expr, deadline: float, surface: tuple[sympy.Expr, ...] = (), exact_first: bool = False
) -> Finding:
    """Tell if the expression vanishes identically, or wherever all expressions of `surface` do; unknown at `deadline`.
    On a surface "no" is a value at points found by Newton's method with 50 digits; exact_first: a "no" is proved by
    numbers only where there is no symbolic proof."""
    finding = _everywhere(expression, deadline, exact_first)
    if not surface or finding.truth is True or expression.is_Rational:
        return finding
    try:
        values = time_limit.run(deadline, lambda: enclosure.values_on(expression, surface))
        if any(abs(value) > enclosure.ZERO for value in values):
            return Finding(False, "numeric")
        remainder = time_limit.run(
            deadline, lambda: normal_form.NormalForm([expression], surface).element(expression)
        )
    except time_limit.NO_ANSWER as error:
        return _unknown(error)
    if remainder == 0:
        return Finding(True, "symbolic")
    return _unknown("whether it vanishes on the surface of the constraints is not known")


def vanish(
    expressions: Iterable[sympy.Expr], deadline: float, surface: tuple[sympy.Expr, ...] = ()
) -> Finding:
    """Tell if all the expressions vanish identically: the first that does not decides, then the first unknown one."""
    unknown: Finding | None = None
    for expression in expressions:
        finding = is_zero(expression, deadline, surface)
        if finding.truth is False:
            return finding
        if finding.truth is None:
            unknown = unknown or finding
    return unknown or Finding(True, "symbolic")


def _unknown(why: Exception | str) -> Finding:
    """What is told of an expression of which nothing was found."""
    if isinstance(why, time_limit.TimeUpError):
        why = "the time was over before it was known"
    elif isinstance(why, Exception) and not isinstance(why, normal_form.NoNormalFormError):
        why = f"no normal form ({type(why).__name__})"
    return Finding(None, "none", str(why))


def _everywhere(expression: sympy.Expr, deadline: float, exact_first: bool) -> Finding:
    if expression.is_Rational:
        return Finding(bool(expression == 0), "symbolic")
    if expression.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
        return _unknown("it is not a finite real expression")

    def exactly() -> Finding:
        try:
            basis = guarded.attempt(normal_form.NormalForm, [expression])
            remainder = guarded.attempt(basis.element, expression)
        except guarded.NoAnswerError as error:
            return _unknown(error)
        if not enclosure.has_value(expression):
            return _unknown("no point was found where it has a real value")
        if remainder == 0:
            return Finding(True, "symbolic")
        if basis.independent:
            return Finding(False, "symbolic")
        return _unknown("its parts may depend on each other in a way that is not known")

    exact = None
    try:
        if exact_first:
            exact = time_limit.run(deadline, exactly)
        if exact is None or exact.truth is None:
            number = time_limit.run(deadline, lambda: enclosure.nonzero(expression))
            if number is not None:
                return Finding(False, "numeric", value=number)
        return exact if exact is not None else time_limit.run(deadline, exactly)
    except time_limit.TimeUpError as error:
        return _unknown(error)
