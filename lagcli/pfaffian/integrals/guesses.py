"""Proposals for first integrals: combinations of known functions, single forms, linear equations."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from lagcli.pfaffian import form as forms
from lagcli.pfaffian.exact import zero_test
from lagcli.pfaffian.flag import elimination
from lagcli.pfaffian.integrals import combinations, darboux, matrix_flow
from lagcli.pfaffian.integrals import kernel_frame as frames
from lagcli.pfaffian.integrals.integral_search import IntegralSearch, Proposals, SearchResult
from lagcli.pfaffian.single_form import frobenius, integrating_factors, tidy_integral

MAX_RECIPROCALS = 8


def fixed(quest: IntegralSearch, slot: float) -> Proposals:
    """As many forms as variables: all of them stay constant."""
    if not quest.frame.free:
        yield from (SearchResult(x, "as a coordinate that cannot change") for x in quest.frame.variables)


def one_form(quest: IntegralSearch, slot: float) -> Proposals:
    """A system of one form."""
    if len(quest.frame.pivots) == 1 and not quest.block.surface:
        row = next(r for r in quest.block.rows if any(a != 0 for a in r))
        form = forms.Form("row", quest.block.variables, row, quest.block.parameters)
        verdict = frobenius.classify(form, slot)
        if verdict.integral is not None:
            yield SearchResult(verdict.integral, "by an integrating factor")


def polynomials(degrees: tuple[int, ...], quest: IntegralSearch, slot: float) -> Proposals:
    """Sums of products of the variables and functions that occur in the frame, with constant coefficients."""
    yield from monomials(quest, quest.alphabet(), degrees)


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


def turned(quest: IntegralSearch, slot: float) -> Proposals:
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


def rational(quest: IntegralSearch, slot: float) -> Proposals:
    """Sums of products with the reciprocals of what the frame is divided by."""
    below = darboux.denominator(quest.entries)
    factors_ = darboux.factors([below], quest.frame.variables)
    if quest.block.surface or not below.free_symbols & set(quest.frame.variables):
        return
    reciprocals = [1 / q for q in factors_ if below.has(q) or not q.is_Symbol]
    yield from monomials(quest, quest.alphabet(*reciprocals[:MAX_RECIPROCALS]), (1, 2, 3))


def products(quest: IntegralSearch, slot: float) -> Proposals:
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


def invariant_surfaces(quest: IntegralSearch, slot: float) -> Proposals:
    """More factors from an inverse multiplier; products of them, and polynomials over them."""
    if quest.block.surface:
        return
    letters = quest.alphabet()
    found = darboux.multipliers(quest.frame, letters)
    for v in found[1:]:
        yield SearchResult(tidy_integral.ratio(v, found[0]), "as a ratio of two inverse multipliers")
    quest.factors = darboux.surfaces_of(found, quest.frame.variables)
    yield from products(quest, slot)
    for q in quest.factors:
        if not q.is_Symbol:
            more = quest.alphabet(1 / q)
            yield from monomials(quest, more, (2, 3))


def single_rows(quest: IntegralSearch, slot: float) -> Proposals:
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
            if zero_test.vanish(list(form.wedge().values()), slot).truth is not zero_test.Truth.YES:
                continue
            found = integrating_factors.search(form, slot)
            if found is not None:
                yield SearchResult(found.integral, f"for a combination of the forms {found.how}")


def linear_flow(quest: IntegralSearch, slot: float) -> Proposals:
    """One field, with linear equations."""
    how = "as the solution of linear differential equations"
    if quest.block.surface or len(quest.frame.free) != 1:
        return
    straight = matrix_flow.linear(quest.frame, 0)
    if straight is not None:
        yield from (SearchResult(u, how) for u in straight.integrals)
