"""First integrals by descent to a system with fewer variables, where the same search goes on."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from lagcli.pfaffian import form as forms
from lagcli.pfaffian import pfaffian_block as blocks
from lagcli.pfaffian.exact import guarded, time_limit
from lagcli.pfaffian.flag import elimination
from lagcli.pfaffian.integrals import matrix_flow
from lagcli.pfaffian.integrals.integral_search import IntegralSearch, Proposals, SearchResult
from lagcli.pfaffian.single_form import potential, tidy_integral


def eliminations(quest: IntegralSearch, slot: float) -> Proposals:
    """An integral that is known gives a coordinate in terms of the others and of its constant value."""
    if len(quest.found) == quest.used or quest.block.surface:
        return
    quest.used = len(quest.found)
    block = quest.block
    values: elimination.Substitutions = {}
    constants: elimination.Substitutions = {}
    for n, f in enumerate(quest.found):
        constant = sympy.Symbol(f"c{len(block.variables)}_{n}_", real=True)
        found = _solved(f.integral.xreplace(values) - constant, block.variables)
        if found is None:
            continue
        x, value = found
        values = {y: v.xreplace({x: value}) for y, v in values.items()} | {x: value}
        constants[constant] = f.integral
    if not values:
        return
    kept = tuple(x for x in block.variables if x not in values)
    rows = tuple(elimination.pulled_back(block.variables, row, values, kept) for row in block.rows)
    smaller = blocks.PfaffianBlock(block.names, kept, rows, (*block.parameters, *constants))
    for each in quest.smaller(smaller, slot):
        yield SearchResult(
            each.integral.xreplace(constants),
            f"by eliminating a coordinate with another integral, {each.how}",
        )


def _solved(f: sympy.Expr, variables: Sequence[sympy.Symbol]) -> tuple[sympy.Symbol, sympy.Expr] | None:
    """(x, value) with f = 0 where x = value; linear equations first."""
    held = [x for x in variables if x in f.free_symbols and x.name != elimination.TIME]
    ways = []
    for x in held:
        slope = forms.partial(f, x)
        if x not in slope.free_symbols:
            ways.append(
                (slope.count_ops(), str(x), x, tidy_integral.ratio(guarded.expand(slope * x - f), slope))
            )
    if ways:
        return min(ways, key=lambda w: w[:2])[2:]
    for x in held:
        try:
            roots = guarded.solve(f, x, simplify=False, check=False)
        except guarded.SympyFailure:
            continue
        good = [r for r in roots if potential.writable(r)]
        if good:
            return x, good[-1]
    return None


def reductions(quest: IntegralSearch, slot: float) -> Proposals:
    """A field of the frame that this search solves, the other free variables held fixed (Mayer, Natani)."""
    if quest.block.surface or len(quest.frame.free) < 2:
        return
    for column in range(len(quest.frame.free)):
        straight = matrix_flow.linear(quest.frame, column) or _solved_flow(quest, column, slot)
        if straight is not None:
            yield from _reduced(quest, straight, slot)


def _reduced(quest: IntegralSearch, straight: matrix_flow.Straight, slot: float) -> Proposals:
    """In the integrals of one field as coordinates the system has one variable less."""
    names = dict(zip(straight.letters, straight.integrals, strict=True))
    for each in quest.smaller(_in_straight_coordinates(quest, straight), slot):
        yield SearchResult(each.integral.xreplace(names), "by reduction to fewer variables (Mayer)")


def _solved_flow(quest: IntegralSearch, column: int, slot: float) -> matrix_flow.Straight | None:
    """The integrals of one field found by this search, the other free variables held fixed, and solved for the
    pivots.
    """
    frame = quest.frame
    s = frame.free[column]
    own = [*frame.pivots, s]
    variables = tuple(frame.variables[k] for k in sorted(own))
    held = tuple(frame.variables[k] for k in frame.free if k != s)
    rows = tuple(tuple(frame.row(a)[k] for k in sorted(own)) for a in range(len(frame.pivots)))
    names = tuple(f"row{n}" for n in range(len(rows)))
    found = quest.smaller(blocks.PfaffianBlock(names, variables, rows, (*frame.parameters, *held)), slot)
    if len(found) < len(rows):
        return None
    letters = matrix_flow.letters(frame)
    integrals = tuple(f.integral for f in found)
    pivots = [frame.variables[p] for p in frame.pivots]
    equations = [u - letter for u, letter in zip(integrals, letters, strict=True)]
    roots = guarded.solve(equations, pivots, dict=True, simplify=False)
    good = [r for r in roots if len(r) == len(pivots) and all(potential.writable(v) for v in r.values())]
    if not good:
        return None
    return matrix_flow.Straight(column, integrals, letters, tuple(good[-1][x] for x in pivots))


def _in_straight_coordinates(quest: IntegralSearch, straight: matrix_flow.Straight) -> blocks.PfaffianBlock:
    """d(u_a) = sum_l X_l(u_a) d(x_l) over the other free variables, in terms of them and the u."""
    frame = quest.frame
    s = frame.variables[frame.free[straight.column]]
    inverse = dict(zip((frame.variables[p] for p in frame.pivots), straight.inverse, strict=True))
    others = [n for n in range(len(frame.free)) if n != straight.column]
    rows = []
    for a, u in enumerate(straight.integrals):
        rates = frame.rates(u)
        speeds = [_without(tidy_integral.shortest(rates[n].xreplace(inverse)), s) for n in others]
        row = [sympy.Integer(int(a == b)) for b in range(len(straight.letters))]
        rows.append((*row, *(-k for k in speeds)))
    variables = (*straight.letters, *(frame.variables[frame.free[n]] for n in others))
    names = tuple(f"row{n}" for n in range(len(rows)))
    return blocks.PfaffianBlock(names, variables, tuple(rows), frame.parameters)


def _without(expression: sympy.Expr, s: sympy.Symbol) -> sympy.Expr:
    """The expression, known not to depend on s, written without it."""
    if s not in expression.free_symbols:
        return expression
    for value in (0, 1, 2):
        fixed = guarded.subs(expression, s, value)
        if potential.writable(fixed):
            return fixed
    raise time_limit.NoAnswerError(f"{s} stays in {expression}")
