"""Proposals for first integrals: combinations of known functions, single forms, linear equations, fewer coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from lagcli.pfaffian import (
    combinations,
    darboux,
    elimination,
    frobenius,
    integrating_factors,
    matrix_flow,
    potential,
    tidy_integral,
)
from lagcli.pfaffian import kernel_frame as frames
from lagcli.pfaffian.exact import guarded, zero_test
from lagcli.pfaffian.exact.guarded import SympyFailure
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.integral_search import IntegralSearch, Proposals, SearchResult

# Reciprocals among the letters; more letters leave lower degrees alone (`MAX_MONOMIALS`).
MAX_RECIPROCALS = 8


def fixed(search: IntegralSearch) -> Proposals:
    """The variables as integrals of as many forms: all of them stay constant."""
    if not search.frame.free:
        yield from (SearchResult(x, "as a coordinate that cannot change") for x in search.frame.variables)


def one_form(search: IntegralSearch) -> Proposals:
    """A system of one form."""
    if len(search.frame.pivots) == 1 and not search.block.surface:
        row = next(r for r in search.block.rows if any(a != 0 for a in r))
        form = forms.Form("row", search.block.variables, row, search.block.parameters)
        verdict = frobenius.classify(form, search.deadline)
        if verdict.integral is not None:
            yield SearchResult(verdict.integral, "by an integrating factor")


def polynomials(search: IntegralSearch) -> Proposals:
    """Sums of products of the variables and functions that occur in the frame, with constant coefficients."""
    yield from monomials(search, search.alphabet(), (1, 2, 3))


def monomials(search: IntegralSearch, letters: combinations.Alphabet, degrees: Sequence[int]) -> Proposals:
    """Sums of products of the letters."""
    how = "as a sum of products with constant coefficients (linear equations for them)"
    for degree in degrees:
        if degree > 1 and not letters.largest(degree):
            return
        chosen = letters.monomials(degree)
        functions = [sympy.Mul(*(letters.letters[i] for i in m)) for m in chosen]
        field = combinations.CombinationField(
            search.frame, letters.letters, len(chosen), search.block.surface
        )
        known = combinations.Known(field, search.integrals)
        numbers = field.monomials(letters, chosen)
        for phi, slopes in combinations.proposals(search.frame, numbers, functions, known):
            before = len(search.found)
            yield SearchResult(phi, how)
            if len(search.found) > before:
                known.take(slopes)


def turned(search: IntegralSearch) -> Proposals:
    """Guesses with the sines and cosines of coordinates that the frame does not depend on, where others have some."""
    occurring = set().union(*(e.free_symbols for e in search.entries))
    cyclic = [x for x in search.frame.variables if x not in occurring and x.name != elimination.TIME]
    angles = set().union(*(e.atoms(sympy.sin, sympy.cos) for e in search.entries))
    if search.block.surface or not angles or not cyclic:
        return
    letters = search.alphabet(*(f(x) for x in cyclic for f in (sympy.sin, sympy.cos)))
    # Angles by themselves would only burden the sums.
    pairs = [
        (e, 1 if isinstance(e, sympy.cos) else highest)
        for e, highest in zip(letters.letters, letters.highest, strict=True)
        if e not in cyclic and not any(e in f.free_symbols for f in angles)
    ]
    yield from monomials(search, combinations.Alphabet(*zip(*pairs, strict=True)), (2, 3))


def rational(search: IntegralSearch) -> Proposals:
    """Sums of products with the reciprocals of what the frame is divided by."""
    below = darboux.denominator(search.entries)
    factors_ = darboux.factors([below], search.frame.variables)
    if search.block.surface or not below.free_symbols & set(search.frame.variables):
        return
    reciprocals = [1 / q for q in factors_ if below.has(q) or not q.is_Symbol]
    yield from monomials(search, search.alphabet(*reciprocals[:MAX_RECIPROCALS]), (1, 2, 3))


def products(search: IntegralSearch) -> Proposals:
    """Products of powers of invariant surfaces, exponentials, and angles."""
    how = "as a product of powers and exponentials (linear equations for the exponents)"
    frame = search.frame
    surfaces = darboux.surfaces_of([f.integral for f in search.found], frame.variables)
    known_factors = darboux.factors(search.entries, frame.variables)
    candidates = list(dict.fromkeys([*known_factors, *surfaces, *search.factors]))
    letters = search.alphabet()
    chosen = letters.monomials(2)
    functions = [sympy.Mul(*(letters.letters[i] for i in m)) for m in chosen]
    logs = [sympy.log(p) for p in candidates]
    logs += darboux.angles(candidates, frame.variables)
    if search.block.surface:
        logs += [c * e for c in sorted(combinations.constants_of(frame), key=str) for e in logs]
    field = combinations.CombinationField(
        frame, [*letters.letters, *candidates], len(chosen) + len(logs), search.block.surface
    )
    numbers = combinations.join(field.functions(logs), field.monomials(letters, chosen))
    known = combinations.Known(field, search.integrals)
    for phi, slopes in combinations.proposals(frame, numbers, [*logs, *functions], known):
        before = len(search.found)
        yield SearchResult(phi, how)
        if len(search.found) > before:
            known.take(slopes)


def invariant_surfaces(search: IntegralSearch) -> Proposals:
    """More factors from an inverse multiplier; products of them, and polynomials over them."""
    if search.block.surface:
        return
    letters = search.alphabet()
    found = darboux.multipliers(search.frame, letters)
    for v in found[1:]:
        yield SearchResult(tidy_integral.ratio(v, found[0]), "as a ratio of two inverse multipliers")
    search.factors = darboux.surfaces_of(found, search.frame.variables)
    yield from products(search)
    for q in search.factors:
        if not q.is_Symbol:
            more = search.alphabet(1 / q)
            yield from monomials(search, more, (2, 3))


def single_rows(search: IntegralSearch) -> Proposals:
    """Combinations of the forms with few differentials, each by itself."""
    if search.block.surface:
        return
    tried: set[tuple[sympy.Expr, ...]] = set()
    block = search.block
    for last in ((), *((x,) for x in block.variables)):
        frame = search.frame if not last else frames.of(block.rows, block.variables, block.parameters, last)
        for a in sorted(range(len(frame.pivots)), key=lambda a: sum(e != 0 for e in frame.solved[a])):
            row = frame.row(a)
            if row in tried:
                continue
            tried.add(row)
            form = integrating_factors.primitive(forms.Form("row", block.variables, row, block.parameters))
            if (
                zero_test.vanish(list(form.wedge().values()), search.deadline).truth
                is not zero_test.Truth.YES
            ):
                continue
            found = integrating_factors.search(form, search.deadline)
            if found is not None:
                yield SearchResult(found.integral, f"for a combination of the forms {found.how}")


def linear_flow(search: IntegralSearch) -> Proposals:
    """One field, with linear equations."""
    how = "as the solution of linear differential equations"
    if search.block.surface or len(search.frame.free) != 1:
        return
    yield from (SearchResult(u, how) for u in matrix_flow.linear(search.frame, 0) or ())


def eliminations(search: IntegralSearch) -> Proposals:
    """An integral that is known gives a coordinate in terms of the others and of its constant value."""
    if len(search.found) == search.used or search.block.surface:
        return
    search.used = len(search.found)
    block = search.block
    values: elimination.Substitutions = {}
    constants: elimination.Substitutions = {}
    for n, f in enumerate(search.found):
        constant = sympy.Symbol(f"c{len(block.variables)}_{n}_", real=True)
        found = _solved(f.integral.xreplace(values) - constant, block.variables)
        if found is None:
            continue
        x, value = found
        values = {y: v.xreplace({x: value}) for y, v in values.items()} | {x: value}
        constants[constant] = f.integral
    if not values:
        return
    remaining = tuple(x for x in block.variables if x not in values)
    rows = tuple(elimination.pulled_back(block.variables, row, values, remaining) for row in block.rows)
    smaller = forms.PfaffianBlock(block.names, remaining, rows, (*block.parameters, *constants))
    for each in search.smaller(smaller):
        yield SearchResult(
            each.integral.xreplace(constants),
            f"by eliminating a coordinate with another integral, {each.how}",
        )


def _solved(f: sympy.Expr, variables: Sequence[sympy.Symbol]) -> tuple[sympy.Symbol, sympy.Expr] | None:
    """(x, value) with f = 0 where x = value; linear equations first."""
    occurring = [x for x in variables if x in f.free_symbols and x.name != elimination.TIME]
    ways = []
    for x in occurring:
        slope = forms.partial(f, x)
        if x not in slope.free_symbols:
            ways.append(
                (slope.count_ops(), str(x), x, tidy_integral.ratio(guarded.expand(slope * x - f), slope))
            )
    if ways:
        return min(ways, key=lambda w: w[:2])[2:]
    for x in occurring:
        try:
            roots = guarded.solve(f, x, simplify=False, check=False)
        except SympyFailure:
            continue
        good = [r for r in roots if potential.writable(r)]
        if good:
            return x, good[-1]
    return None
