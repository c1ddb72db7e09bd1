"""(B M^-1 B^T) lambda = gamma - B M^-1 h, row by row and by small blocks of M; lambda in closed form, where there are
few rows and the result can be read."""

from __future__ import annotations

import dataclasses

import sympy

from lagcli.derivation.symbolic.calculus import Key, Triple, pieces
from lagcli.derivation.symbolic.symbol_table import SymbolTable
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import by_monomials, tidy, without_squares
from lagcli.pfaffian.forms.notation import TIME, ZERO

# The largest block of M that is inverted in symbols, and the most operations an entry of its inverse may have.
MAX_BLOCK, MAX_ENTRY = 3, 400
# Rows that may be coupled in a closed form of lambda, and its operations that a person still reads.
MAX_ROWS, MAX_OPERATIONS = 4, 120


@dataclasses.dataclass(frozen=True, slots=True)
class Equation:
    """S lambda = right: S by numbers of rows (all pairs that are not zero, both ways), right (C)."""

    S: dict[tuple[int, int], sympy.Expr]
    right: tuple[sympy.Expr, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Inverse:
    """M^-1 by numbers of coordinates; None with the reason where it is not written out."""

    entries: dict[tuple[int, int], sympy.Expr] | None
    reason: str = ""


def inverse(system: Symbolic) -> Inverse:
    """M^-1 for the coordinates that do not obey Newton's equations, block by block."""
    entries: dict[tuple[int, int], sympy.Expr] = {}
    # The coordinates that M couples
    neighbours: dict[int, set[int]] = {i: {i} for i in system.lagrange}
    for i, j in system.M:
        if i in neighbours and j in neighbours:
            neighbours[i].add(j)
            neighbours[j].add(i)
    for block in components(neighbours):
        if len(block) > MAX_BLOCK:
            return Inverse(None, f"M has a block of {len(block)} coupled coordinates, more than {MAX_BLOCK}")
        matrix = sympy.Matrix([[system.matrix(i, j) for j in block] for i in block])
        determinant = tidy(matrix.det(method="berkowitz"))
        if determinant == 0:
            return Inverse(None, "M is singular")
        adjugate = matrix.adjugate()
        for row, i in enumerate(block):
            for column, j in enumerate(block):
                entry = tidy(tidy(adjugate[row, column]) / determinant)
                if entry.count_ops() > MAX_ENTRY:
                    return Inverse(None, f"an entry of M⁻¹ has {entry.count_ops()} operations")
                if entry != 0:
                    entries[i, j] = entry
    return Inverse(entries)


def components(neighbours: dict[int, set[int]]) -> list[list[int]]:
    """The connected parts of a graph, each in order."""
    parts, seen = [], set[int]()
    for start in neighbours:
        if start in seen:
            continue
        part, stack = {start}, [start]
        while stack:
            for other in neighbours[stack.pop()] - part:
                part.add(other)
                stack.append(other)
        seen |= part
        parts.append(sorted(part))
    return parts


def _dot(
    table: SymbolTable, u: Triple, w: Triple, known: dict[Triple, list[tuple[sympy.Expr, Key]] | None]
) -> sympy.Expr:
    """u . w in the vectors of the model, as a person writes it; known: the pieces of vectors met before."""
    for triple in (u, w):
        if triple not in known:
            vector = table.recognizer.vector(triple)
            known[triple] = None if vector is None else pieces(vector)
    one, other = known[u], known[w]
    total = ZERO
    if one is None or other is None:
        total = sum((a * b for a, b in zip(u, w, strict=True)), ZERO)
        # 1 where it is the square of a root over itself
        for symbol in sorted(total.free_symbols & table.calculus.known.keys(), key=str):
            root = table.calculus.known[symbol]
            if root.is_root and total.count_ops() < 100 and root.inner.count_ops() < 100:
                above = tidy(sympy.expand(total * symbol**2) - sympy.expand(root.inner))
                if above == 0:
                    return sympy.Integer(1)
        return total
    for c, key in one:
        for e, across in other:
            if key[0] and across[0]:
                product = table.product(key, across)
            else:
                a, b = map(table.recognizer.components, (key, across))
                product = sum((x * y for x, y in zip(a, b, strict=True)), ZERO)
            total += c * e * product
    return total


def equation(system: Symbolic, inverted: dict[tuple[int, int], sympy.Expr]) -> Equation:
    """The linear system for lambda (D.24)."""
    S: dict[tuple[int, int], sympy.Expr] = {}
    right = [row.gamma for row in system.rows]
    free = system.free
    # 1/m B_ik . B_jk and 1/m B_ik . F_k of particles that obey Newton's equations
    touching: dict[int, list[tuple[int, Triple]]] = {}
    for r, row in enumerate(system.rows):
        for first in sorted({i - i % 3 for i in row.B if i - i % 3 in free}):
            touching.setdefault(first, []).append((r, part(row.B, first)))
    known: dict[Triple, list[tuple[sympy.Expr, Key]] | None] = {}
    for first, rows in touching.items():
        mass = system.table.mass(free[first])
        h = (system.h[first], system.h[first + 1], system.h[first + 2])
        for r, u in rows:
            right[r] -= _dot(system.table, u, h, known) / mass
            for other, w in rows:
                if other >= r:
                    S[r, other] = S.get((r, other), ZERO) + _dot(system.table, u, w, known) / mass
    # B M^-1 B^T and B M^-1 h of the other coordinates
    slopes: dict[int, list[tuple[int, sympy.Expr]]] = {}
    for r, row in enumerate(system.rows):
        for i, slope in row.B.items():
            if i - i % 3 not in free:
                slopes.setdefault(i, []).append((r, slope))
    for (i, j), entry in inverted.items():
        for r, slope in slopes.get(i, ()):
            right[r] -= slope * entry * system.h[j]
            for other, across in slopes.get(j, ()):
                S[r, other] = S.get((r, other), ZERO) + slope * entry * across
    short: dict[tuple[int, int], sympy.Expr] = {}
    for (r, other), value in S.items():
        if other >= r and (entry := tidy(value)) != 0:
            short[r, other] = short[other, r] = entry
    return Equation(short, tuple(tidy(value) for value in right))


def part(values: dict[int, sympy.Expr], first: int) -> Triple:
    """Three neighbours of a sparse vector."""
    return values.get(first, ZERO), values.get(first + 1, ZERO), values.get(first + 2, ZERO)


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
    S = {entry: tidy(put(system, value, on)) for entry, value in equation.S.items()}
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
            forms = [tidy(tidy(value) / determinant), tidy(value) / determinant]
            if value.count_ops() + determinant.count_ops() <= 2 * MAX_OPERATIONS:
                forms += cancelled(value / determinant, system.v)
            shortest = min(forms, key=complexity)
            if shortest.count_ops() > MAX_OPERATIONS:
                reason = f"λ of {system.rows[r].name} would have {shortest.count_ops()} operations"
                reason += f", and {MAX_OPERATIONS} are still read"
            else:
                values[r] = shortest
    return ClosedForm(values, reason, on)


def cancelled(value: sympy.Expr, rates: tuple[sympy.Symbol, ...]) -> list[sympy.Expr]:
    """Equal forms of a quotient without common factors, as a whole and for each power of the rates.

    sin^2 + cos^2 = 1 hides a common factor where both stand, so that it is looked for with each of them alone too.
    """
    forms = []
    together = sympy.together(value)
    for squared, other in ((None, None), (sympy.cos, sympy.sin), (sympy.sin, sympy.cos)):
        above, below = sympy.fraction(together)
        if squared is not None and other is not None:
            above, below = (without_squares(part, squared, other) for part in (above, below))
        if below == 0:  # sin^2 + cos^2 - 1 in disguise: nothing is known of such a quotient
            continue
        forms.append(_factored(above / below))
        if not below.free_symbols & set(rates):
            terms = by_monomials(sympy.expand(above), rates)
            forms.append(sympy.Add(*(monomial * _factored(part / below) for monomial, part in terms)))
    return forms


def _factored(value: sympy.Expr) -> sympy.Expr:
    """A quotient without common factors, above and below tidied."""
    above, below = sympy.fraction(sympy.factor_terms(sympy.cancel(value)))
    return tidy(tidy(above) / tidy(below))


def complexity(value: sympy.Expr) -> int:
    """The effort of reading an expression, by its operations."""
    # Fractions in fractions read worst.
    parts = sympy.preorder_traversal(value)
    return int(value.count_ops()) + 3 * sum(1 for part in parts if part.is_Pow and part.exp.is_negative)


def put(system: Symbolic, value: sympy.Expr, on: dict[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """The value with what the rows say put in, also in products of vectors."""
    calculus = system.table.calculus
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
    calculus = system.table.calculus
    on_surface: dict[sympy.Symbol, sympy.Expr] = {}
    rates = dict(zip(system.q, system.v, strict=True))
    for row in system.rows:
        if row.f is None:
            continue
        moving = [s for s in row.f.free_symbols if s in rates or s in calculus.known]
        if len(moving) != 1 or moving[0] in on_surface:
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
        on_surface[symbol] = value
        moved = sympy.diff(value, TIME)
        if symbol in rates:
            on_surface[rates[symbol]] = moved
        elif symbol in calculus.products:
            on_surface[calculus.products[symbol][0]] = tidy(value * moved)
    return on_surface
