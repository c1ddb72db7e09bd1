"""lambda in closed form, where there are few rows and the result can be read."""

from __future__ import annotations

import dataclasses

import sympy

from lagcli.derivation.symbolic.multiplier_equations import Equation, components
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import by_monomials, tidy, without_squares
from lagcli.pfaffian.forms.notation import TIME, ZERO

# Rows that may be coupled.
MAX_ROWS = 4
# Operations of one closed form that a person still reads.
MAX_OPERATIONS = 120


@dataclasses.dataclass(frozen=True, slots=True)
class ClosedForm:
    """lambda by number of row, or the `reason` why not; `on`: what the rows themselves say, put in."""

    values: dict[int, sympy.Expr]
    reason: str
    on: dict[sympy.Symbol, sympy.Expr]


def solve(system: Symbolic, equation: Equation) -> ClosedForm:
    """lambda = S^-1 (gamma - B M^-1 h) on the constraint surface."""
    count = len(system.rows)
    on = surface(system)
    neighbours = {r: {r} for r in range(count)}
    S = {place: tidy(put(system, value, on)) for place, value in equation.S.items()}
    for (r, other), value in S.items():
        if value != 0:
            neighbours[r].add(other)
    values: dict[int, sympy.Expr] = {}
    reason = ""
    blocks = components(neighbours)
    if (largest := max(map(len, blocks))) > MAX_ROWS:
        message = f"B M⁻¹ Bᵀ couples {largest} rows, and a closed form is tried for up to {MAX_ROWS}"
        return ClosedForm({}, message, on)
    for block in blocks:
        matrix = sympy.Matrix([[S.get((r, other), ZERO) for other in block] for r in block])
        determinant = tidy(matrix.det(method="berkowitz"))
        if determinant == 0:
            names = ", ".join(system.rows[r].name for r in block)
            return ClosedForm({}, f"B M⁻¹ Bᵀ is singular: the rows {names} are not independent", on)
        right = sympy.Matrix([put(system, equation.right[r], on) for r in block])
        above = matrix.adjugate() * right
        for r, value in zip(block, above, strict=True):
            found = _shortest(value, determinant, system.v)
            if found.count_ops() > MAX_OPERATIONS:
                reason = f"λ of {system.rows[r].name} would have {found.count_ops()} operations"
                reason += f", and {MAX_OPERATIONS} are still read"
            else:
                values[r] = found
    return ClosedForm(values, reason, on)


def _shortest(above: sympy.Expr, below: sympy.Expr, rates: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    found = [tidy(tidy(above) / below), tidy(above) / below]
    if above.count_ops() + below.count_ops() <= 2 * MAX_OPERATIONS:
        found += cancelled(above / below, rates)
    return min(found, key=burden)


def cancelled(value: sympy.Expr, rates: tuple[sympy.Symbol, ...]) -> list[sympy.Expr]:
    """Equal forms of a quotient without common factors, as a whole and for each power of the rates.

    sin^2 + cos^2 = 1 hides a common factor where both stand, so that it is looked for with each of them alone too.
    """
    found = []
    together = sympy.together(value)
    for squared, other in ((None, None), (sympy.cos, sympy.sin), (sympy.sin, sympy.cos)):
        above, below = sympy.fraction(together)
        if squared is not None and other is not None:
            above, below = (without_squares(part, squared, other) for part in (above, below))
        if below == 0:  # sin^2 + cos^2 - 1 in disguise: nothing is known of such a quotient
            continue
        found.append(_factored(above / below))
        if not below.free_symbols & set(rates):
            terms = by_monomials(sympy.expand(above), rates)
            found.append(sympy.Add(*(monomial * _factored(part / below) for monomial, part in terms)))
    return found


def _factored(value: sympy.Expr) -> sympy.Expr:
    """A quotient without common factors, above and below tidied."""
    above, below = sympy.fraction(sympy.factor_terms(sympy.cancel(value)))
    return tidy(tidy(above) / tidy(below))


def burden(value: sympy.Expr) -> int:
    """The burden of reading an expression, by its operations."""
    # Fractions in fractions read worst.
    parts = sympy.preorder_traversal(value)
    return int(value.count_ops()) + 3 * sum(1 for part in parts if part.is_Pow and part.exp.is_negative)


def put(system: Symbolic, value: sympy.Expr, on: dict[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """The value with what the rows say put in, also in products of vectors."""
    calculus = system.world.calculus
    replaced = dict(on)
    for symbol in value.free_symbols & calculus.known.keys():
        known = calculus.known[symbol]
        if symbol not in on and known.inner.free_symbols & on.keys() and not known.is_root:
            inner = known.inner.xreplace(on)
            # A product of vectors stays one unless its components become simple.
            if inner.count_ops() < known.inner.count_ops() / 2:
                replaced[symbol] = inner
    return value.xreplace(replaced)


def surface(system: Symbolic) -> dict[sympy.Symbol, sympy.Expr]:
    """Lengths and coordinates that single rows hold at a value: d = L and d' = L', y = 0 and y' = 0."""
    calculus = system.world.calculus
    found: dict[sympy.Symbol, sympy.Expr] = {}
    rates = dict(zip(system.q, system.v, strict=True))
    for row in system.rows:
        if row.f is None:
            continue
        moving = [s for s in row.f.free_symbols if s in rates or s in calculus.known]
        if len(moving) != 1 or moving[0] in found:
            continue
        symbol = moving[0]
        slope = sympy.diff(row.f, symbol)
        if slope.free_symbols & {symbol, *rates, *calculus.known} or (
            symbol in rates and TIME in slope.free_symbols
        ):
            continue
        if symbol in calculus.known and not slope.is_number:
            continue
        value = tidy(-row.f.xreplace({symbol: ZERO}) / slope)
        found[symbol] = value
        moved = sympy.diff(value, TIME)
        if symbol in rates:
            found[rates[symbol]] = moved
        elif symbol in calculus.products:
            found[calculus.products[symbol][0]] = tidy(value * moved)
    return found
