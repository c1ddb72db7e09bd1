"""Proposals for first integrals: combinations of known functions, single forms, linear equations, fewer coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from lagcli.pfaffian.exact import guarded, zero_test
from lagcli.pfaffian.exact.guarded import SympyFailure
from lagcli.pfaffian.flag import elimination
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.integrals import combinations, darboux, matrix_flow
from lagcli.pfaffian.integrals import kernel_frame as frames
from lagcli.pfaffian.integrals.integral_search import IntegralSearch, Proposals, SearchResult
from lagcli.pfaffian.single_form import frobenius, integrating_factors, potential, tidy_integral

# Reciprocals among the letters; more letters leave lower degrees alone (`MAX_MONOMIALS`).
MAX_RECIPROCALS = 8


def fixed(quest: IntegralSearch) -> Proposals:
    """As many forms as variables: all of them stay constant."""
    if not quest.frame.free:
        yield from (SearchResult(x, "as a coordinate that cannot change") for x in quest.frame.variables)


def one_form(quest: IntegralSearch) -> Proposals:
    """A system of one form."""
    if len(quest.frame.pivots) == 1 and not quest.block.surface:
        row = next(r for r in quest.block.rows if any(a != 0 for a in r))
        form = forms.Form("row", quest.block.variables, row, quest.block.parameters)
        verdict = frobenius.classify(form, quest.deadline)
        if verdict.integral is not None:
            yield SearchResult(verdict.integral, "by an integrating factor")


def polynomials(quest: IntegralSearch) -> Proposals:
    """Sums of products of the variables and functions that occur in the frame, with constant coefficients."""
    yield from monomials(quest, quest.alphabet(), (1, 2, 3))


def monomials(quest: IntegralSearch, letters: combinations.Alphabet, degrees: Sequence[int]) -> Proposals:
    """Sums of products of the letters."""
    how = "as a sum of products with constant coefficients (linear equations for them)"
    for degree in degrees:
        if degree > 1 and not letters.largest(degree):
            return
        chosen = letters.monomials(degree)
        functions = [sympy.Mul(*(letters.letters[i] for i in m)) for m in chosen]
        field = combinations.CombinationField(quest.frame, letters.letters, len(chosen), quest.block.surface)
        known = combinations.Known(field, quest.integrals)
        numbers = field.monomials(letters, chosen)
        for phi, slopes in combinations.proposals(quest.frame, numbers, functions, known):
            before = len(quest.found)
            yield SearchResult(phi, how)
            if len(quest.found) > before:
                known.take(slopes)


def turned(quest: IntegralSearch) -> Proposals:
    """Guesses with the sines and cosines of coordinates that the frame does not depend on, where others have some."""
    occurring = set().union(*(e.free_symbols for e in quest.entries))
    cyclic = [x for x in quest.frame.variables if x not in occurring and x.name != elimination.TIME]
    angles = set().union(*(e.atoms(sympy.sin, sympy.cos) for e in quest.entries))
    if quest.block.surface or not angles or not cyclic:
        return
    letters = quest.alphabet(*(f(x) for x in cyclic for f in (sympy.sin, sympy.cos)))
    # Angles by themselves would only burden the sums.
    pairs = [
        (e, 1 if isinstance(e, sympy.cos) else highest)
        for e, highest in zip(letters.letters, letters.highest, strict=True)
        if e not in cyclic and not any(e in f.free_symbols for f in angles)
    ]
    yield from monomials(quest, combinations.Alphabet(*zip(*pairs, strict=True)), (2, 3))


def rational(quest: IntegralSearch) -> Proposals:
    """Sums of products with the reciprocals of what the frame is divided by."""
    below = darboux.denominator(quest.entries)
    factors_ = darboux.factors([below], quest.frame.variables)
    if quest.block.surface or not below.free_symbols & set(quest.frame.variables):
        return
    reciprocals = [1 / q for q in factors_ if below.has(q) or not q.is_Symbol]
    yield from monomials(quest, quest.alphabet(*reciprocals[:MAX_RECIPROCALS]), (1, 2, 3))


def products(quest: IntegralSearch) -> Proposals:
    """Products of powers of invariant surfaces, exponentials, and angles."""
    how = "as a product of powers and exponentials (linear equations for the exponents)"
    frame = quest.frame
    surfaces = darboux.surfaces_of([f.integral for f in quest.found], frame.variables)
    known_factors = darboux.factors(quest.entries, frame.variables)
    candidates = list(dict.fromkeys([*known_factors, *surfaces, *quest.factors]))
    letters = quest.alphabet()
    chosen = letters.monomials(2)
    functions = [sympy.Mul(*(letters.letters[i] for i in m)) for m in chosen]
    logs = [sympy.log(p) for p in candidates]
    logs += darboux.angles(candidates, frame.variables)
    if quest.block.surface:
        logs += [c * e for c in sorted(combinations.constants_of(frame), key=str) for e in logs]
    field = combinations.CombinationField(
        frame, [*letters.letters, *candidates], len(chosen) + len(logs), quest.block.surface
    )
    numbers = combinations.join(field.functions(logs), field.monomials(letters, chosen))
    known = combinations.Known(field, quest.integrals)
    for phi, slopes in combinations.proposals(frame, numbers, [*logs, *functions], known):
        before = len(quest.found)
        yield SearchResult(phi, how)
        if len(quest.found) > before:
            known.take(slopes)


def invariant_surfaces(quest: IntegralSearch) -> Proposals:
    """More factors from an inverse multiplier; products of them, and polynomials over them."""
    if quest.block.surface:
        return
    letters = quest.alphabet()
    found = darboux.multipliers(quest.frame, letters)
    for v in found[1:]:
        yield SearchResult(tidy_integral.ratio(v, found[0]), "as a ratio of two inverse multipliers")
    quest.factors = darboux.surfaces_of(found, quest.frame.variables)
    yield from products(quest)
    for q in quest.factors:
        if not q.is_Symbol:
            more = quest.alphabet(1 / q)
            yield from monomials(quest, more, (2, 3))


def single_rows(quest: IntegralSearch) -> Proposals:
    """Combinations of the forms with few differentials, each by itself."""
    if quest.block.surface:
        return
    tried: set[tuple[sympy.Expr, ...]] = set()
    block = quest.block
    for last in ((), *((x,) for x in block.variables)):
        frame = quest.frame if not last else frames.of(block.rows, block.variables, block.parameters, last)
        for a in sorted(range(len(frame.pivots)), key=lambda a: sum(e != 0 for e in frame.solved[a])):
            row = frame.row(a)
            if row in tried:
                continue
            tried.add(row)
            form = integrating_factors.primitive(forms.Form("row", block.variables, row, block.parameters))
            if zero_test.vanish(list(form.wedge().values()), quest.deadline).truth is not zero_test.Truth.YES:
                continue
            found = integrating_factors.search(form, quest.deadline)
            if found is not None:
                yield SearchResult(found.integral, f"for a combination of the forms {found.how}")


def linear_flow(quest: IntegralSearch) -> Proposals:
    """One field, with linear equations."""
    how = "as the solution of linear differential equations"
    if quest.block.surface or len(quest.frame.free) != 1:
        return
    yield from (SearchResult(u, how) for u in matrix_flow.linear(quest.frame, 0) or ())


def eliminations(quest: IntegralSearch) -> Proposals:
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
    smaller = forms.PfaffianBlock(block.names, kept, rows, (*block.parameters, *constants))
    for each in quest.smaller(smaller):
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
        except SympyFailure:
            continue
        good = [r for r in roots if potential.writable(r)]
        if good:
            return x, good[-1]
    return None
