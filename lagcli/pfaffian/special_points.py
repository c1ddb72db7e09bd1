"""Points in the symbols of a block: what vanishes on all of them, equations that say so, and what motions keep to.

A start is known to 50 digits: an expression vanishes there where these leave nothing of it. Other points are those that
motions were followed to, in doubles: what vanishes there but for rounding has to be proved. Each value goes with the
sum of what it would change by if every coordinate and every intermediate result changed by its own size.

A motion along the fields X of D = ker I keeps to a place e = 0 where e and all its derivatives X(e), X(Y(e)), ...
vanish at the start: rows are analytic. On e = 0 the X(e) may vanish identically, and then it is kept; one that does not
vanish at the start leads away; else the place where they vanish too is looked at in its turn.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

import sympy

from lagcli import doubles
from lagcli.expression import term_sizes
from lagcli.pfaffian import elimination
from lagcli.pfaffian.exact import enclosure, guarded, normal_form
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms import notation
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.function_field import FunctionField, NotDecidedError

# Derivatives of derivatives: a place of more generations is left open.
GENERATIONS = 8
Doubles = Mapping[sympy.Symbol, float]
Expression: TypeAlias = sympy.Expr  # as an equation: where it is zero
Symbol: TypeAlias = sympy.Symbol


@dataclass(frozen=True, slots=True)
class SpecialPoint:
    """Coordinates, time and parameters as doubles, by their symbols; digits: the same to 50 digits, of a start; sizes:
    of what coordinates were computed from, others have their own."""

    doubles: Doubles
    digits: Mapping[sympy.Symbol, Fraction] | None = None
    sizes: Doubles = dataclasses.field(default_factory=dict)


def point(names: Iterable[str], values: Iterable[float], time: float, parameters: Doubles) -> SpecialPoint:
    """Coordinates, time and parameters as doubles, by their symbols."""
    found = {sympy.Symbol(name, real=True): float(x) for name, x in zip(names, values, strict=True)}
    return SpecialPoint({**found, sympy.Symbol(elimination.TIME, real=True): time, **parameters})


def beside(expression: sympy.Expr, point: SpecialPoint) -> bool:
    """True if an expression that is not zero at a start is so near to zero that doubles cannot tell."""
    is_near = _is_small(expression, SpecialPoint(point.doubles), otherwise=False)
    return is_near and not vanishes(expression, [point])


def vanishes(expression: sympy.Expr, points: Sequence[SpecialPoint]) -> bool:
    """True if an expression is zero on all points, but for rounding, or has no value."""
    return all(_is_small(expression, one, otherwise=True) for one in points)


def is_nothing(expression: sympy.Expr, points: Sequence[SpecialPoint]) -> bool:
    """True if an expression has values on all points, all of them zero but for rounding."""
    return all(_is_small(expression, one, otherwise=False) for one in points)


def _is_small(expression: sympy.Expr, point: SpecialPoint, otherwise: bool) -> bool:
    """True if the value of an expression at a point is zero but for rounding; `otherwise` where it has none."""

    def leaf(e: sympy.Basic) -> term_sizes.Pair:
        if isinstance(e, (sympy.Number, sympy.NumberSymbol)):
            return float(e), 0.0 if e.is_Integer else abs(float(e))
        value = point.doubles.get(e, math.nan)
        return value, max(abs(value), point.sizes.get(e, 0.0))

    def result(name: str, *parts: term_sizes.Pair) -> term_sizes.Pair:
        value, size = parts[0]
        if value == 0.0 and (name == "sqrt" or (name == "pow" and parts[1][0] > 0.0)):
            return 0.0, size  # a root rises without bound there, and is zero
        return term_sizes.result(name, *parts)

    try:
        value, size = notation.folded(expression, leaf, result, {})
        if not (math.isfinite(value) and math.isfinite(size)):
            return otherwise
        if point.digits is None or abs(value) > doubles.ZERO * size:
            return abs(value) <= doubles.ZERO * size
        return bool(abs(enclosure.middle(expression, point.digits)) <= enclosure.CANCELLED * size)
    except (ArithmeticError, ValueError, enclosure.NoValueError):
        return otherwise


def own_factor(factors: Iterable[sympy.Expr], here: SpecialPoint) -> sympy.Expr:
    """The factor that vanishes at a start, if one alone does, or is all but zero there; else the product."""
    listed = list(factors)
    own = [e for e in listed if vanishes(e, [here])] or [e for e in listed if beside(e, here)]
    return own[0] if len(own) == 1 else sympy.Mul(*listed)


def sheets(block: PfaffianBlock, points: Sequence[SpecialPoint]) -> list[sympy.Expr]:
    """The factors that vanish on all points, of each holonomic row that has several."""
    found = []
    for f in block.surface:
        basis = normal_form.NormalForm([f])
        powers = basis.element(f).numer.factor_list()[1]
        own = [e for e in (basis.expression(part) for part, _ in powers) if vanishes(e, points)]
        if len(powers) > 1 or powers[0][1] > 1:
            found += own
    return found


def of(divisors: Iterable[sympy.Expr | None], points: Sequence[SpecialPoint]) -> list[sympy.Expr]:
    """The factors of expressions (None: unknown) that vanish on all points."""
    there = (one for one in divisors if one is not None and vanishes(one, points))
    return [factor for divisor in there for factor in factors(divisor) if vanishes(factor, points)]


def factors(expression: sympy.Expr) -> list[sympy.Expr]:
    """The factors of an expression, each once, roots being letters. Raises `guarded.NoAnswerError`."""
    basis = normal_form.NormalForm([expression])
    return [basis.expression(part) for part, _ in basis.element(expression).numer.factor_list()[1]]


def distinct(*several: Iterable[sympy.Expr]) -> list[sympy.Expr]:
    """Each of some expressions once, whatever its sign."""
    found: dict[sympy.Expr, None] = {}
    for e in (e for some in several for e in some):
        if e not in found and -e not in found:
            found[e] = None
    return list(found)


def sentences(block: PfaffianBlock, equations: Iterable[sympy.Expr], here: SpecialPoint) -> list[str]:
    """Equations as texts, and on which side of the kinks of |u| a point lies."""
    kinks = sorted({e for row in block.rows for a in row for e in forms.plain(a).atoms(sympy.Abs)}, key=str)
    found = [f"{notation.written(e)} = 0" for e in equations if not e.has(sympy.Abs)]
    for kink in kinks:
        u = kink.args[0]
        found.append(f"{notation.written(u)} {'>' if is_positive(u, here) else '<'} 0")
    return found


def on_side(expression: sympy.Expr, here: SpecialPoint) -> sympy.Expr:
    """An expression as it is on the side of a point of its kinks: there numbers go on beyond them."""
    return expression.replace(
        lambda e: isinstance(e, sympy.Abs) and not vanishes(e.args[0], [here]),
        lambda e: e.args[0] if is_positive(e.args[0], here) else -e.args[0],
    )


def is_positive(u: sympy.Expr, here: SpecialPoint) -> bool:
    """True if an expression is positive at a point, in doubles."""
    return float(u.xreplace({x: sympy.Float(v) for x, v in here.doubles.items()})) > 0


def kept(
    block: PfaffianBlock,
    equations: Sequence[sympy.Expr],
    rank: int | None,
    vanishes: Callable[[sympy.Expr], bool],
    deadline: float,
) -> tuple[sympy.Expr, ...]:
    """All equations that follow for the motions from a start on a place, or none where they leave it.

    equations: of the place, the last one in question; rank: of all rows where the others hold, None if it is not known;
    vanishes: whether an expression does at the start. Raises `NotDecidedError` where rows that are independent at the
    start are fewer and do not keep to the place, and where algebra comes to no end.
    """
    all_of_them, new = [*equations], [equations[-1]]
    for _ in range(GENERATIONS):
        try:
            slopes, independent = _slopes(block, all_of_them, new, vanishes, deadline)
        except guarded.NoAnswerError as error:
            raise NotDecidedError(str(error)) from error
        if not slopes:
            return tuple(all_of_them)
        if independent != rank:
            raise NotDecidedError("the rows have another rank at the start than beside it")
        if not all(map(vanishes, slopes)):
            return ()
        # The factors that vanish at the start, each once, say all that an expression does around it.
        new = [sympy.Mul(*filter(vanishes, factors(e))) for e in distinct(slopes)]
        all_of_them += new
    raise NotDecidedError("the places on which motions from the start stay have no end that algebra sees")


def _slopes(
    block: PfaffianBlock,
    equations: Sequence[sympy.Expr],
    new: Sequence[sympy.Expr],
    vanishes: Callable[[sympy.Expr], bool],
    deadline: float,
) -> tuple[list[sympy.Expr], int]:
    """The X(e) of the new equations that do not vanish where all of them hold, X being the fields of the rows that are
    independent at the start; and how many these are."""
    field = FunctionField(dataclasses.replace(block, surface=(*block.surface, *equations)), deadline, {})
    solved = field.solved(
        field.rows([*field.gradients[: len(block.surface)], *block.rows]), vanishes=vanishes
    )
    gradients = field.rows([forms.partial(e, x) for x in block.variables] for e in new)
    frame = field.frame(solved, len(block.variables))
    found = [field.sum(zip(X, gradient, strict=True)) for X in frame for gradient in gradients]
    if any(vanishes(field.expression(a.denom)) for a in found):
        raise NotDecidedError("a place has no differential at the start")
    return [field.expression(a.numer) for a in found if a], solved.count


def vanishing(block: PfaffianBlock, equations: Sequence[sympy.Expr]) -> frozenset[str]:
    """The rows that vanish on a place. Raises `NotDecidedError`."""
    rows = [[forms.plain(a) for a in row] for row in block.rows]
    try:
        basis = normal_form.NormalForm([a for row in rows for a in row], (*block.surface, *equations))
        found = [not any(map(basis.element, row)) for row in rows]
    except guarded.NoAnswerError as error:
        raise NotDecidedError(str(error)) from error
    return frozenset(name for name, is_nothing in zip(block.names, found, strict=True) if is_nothing)
