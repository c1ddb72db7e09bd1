"""First integrals of a completely integrable Pfaffian system (D.3, for rows that are holonomic jointly).

By the theorem of Frobenius C such forms have C independent integrals phi_a, whose differentials span the forms. They
are sought "by some hook or crook", cheap ways first. Each counts only when X(phi) = 0 is proved for every field of a
frame of the kernel, and all together only when they are proved independent.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import sympy

from lagcli.pfaffian import (
    combinations,
    elimination,
    frobenius,
    function_field,
    integrating_factors,
    potential,
    tidy_integral,
)
from lagcli.pfaffian.exact import guarded, normal_form, time_limit, zero_test
from lagcli.pfaffian.forms import form as forms

# Reciprocals among the letters; more letters leave lower degrees alone (`MAX_MONOMIALS`).
MAX_RECIPROCALS = 8
# Each |u| doubles the cases that are proved.
MAX_KINKS = 3
_POWERS = "as a product of powers and exponentials (linear equations for the exponents)"
_SUMS = "as a sum of products with constant coefficients (linear equations for them)"


@dataclass(frozen=True, slots=True)
class SearchResult:
    """A verified first integral; `how` completes the sentence "found ..."."""

    integral: sympy.Expr
    how: str


Proposals = Iterator[SearchResult]
Strategy = Callable[["IntegralSearch"], Proposals]


def _found(
    block: forms.PfaffianBlock, deadline: float, wanted: int | None = None, budget: int | None = None
) -> list[SearchResult]:
    """The verified and independent integrals found in the time; wanted: how many there are, one for each row else;
    budget: of operations."""
    search = IntegralSearch(block, deadline, wanted)
    time_limit.answer(deadline, search.run, budget)
    return search.found


class IntegralSearch:
    """The search for the integrals of one system: its frame, and what was found so far, all of it verified; `factors`:
    invariant surfaces found on the way; `used`: how many integrals were used to eliminate coordinates."""

    def __init__(self, block: forms.PfaffianBlock, deadline: float, wanted: int | None = None) -> None:
        self.block, self.deadline, self._wanted = block, deadline, wanted
        self.found: list[SearchResult] = []
        self._holonomic: list[sympy.Expr] = []
        self.factors: list[sympy.Expr] = []
        self.used = 0

    def run(self) -> None:
        """Search until all integrals are found or nothing is left to try. Raises `TimeUpError` and `NoAnswerError`."""
        block = self.block
        time = [x for x in block.variables if x.name == elimination.TIME]
        gradients = [tuple(forms.partial(f, x) for x in block.variables) for f in block.surface]
        rows = [*gradients, *block.rows]
        self.frame = function_field.kernel(rows, block.variables, block.parameters, time)
        self.entries = [e for row in self.frame.solved for e in row]
        if not function_field.belongs(self.frame, rows, self.deadline, block.surface):
            raise normal_form.NoNormalFormError("the kernel of the rows is not known")
        for f in block.surface:
            if self._is_new(f):
                self._holonomic.append(f)
        for strategy, budget in _WAYS:
            if self.is_complete:
                return
            time_limit.check(self.deadline)
            time_limit.answer(self.deadline, partial(self._take, strategy), budget)

    @property
    def is_complete(self) -> bool:
        """True if no more integrals exist."""
        return len(self.integrals) >= len(self.frame.pivots) or len(self.found) == self._wanted

    @property
    def integrals(self) -> list[sympy.Expr]:
        """The known constants of motion: the surface and what was found."""
        return [*self._holonomic, *(f.integral for f in self.found)]

    def alphabet(self, *more: sympy.Expr) -> combinations.Alphabet:
        """The letters of the frame. On a surface those of the constants too: its points have various of them."""
        constants = sorted(combinations.constants_of(self.frame), key=str) if self.block.surface else []
        return combinations.alphabet(self.entries, self.frame.variables, [*more, *constants])

    def _take(self, strategy: Strategy) -> None:
        """Keep each proposal, or its tidy form, that is proved to be an integral that is new."""
        for proposal in strategy(self):
            ways = [proposal.integral]
            with contextlib.suppress(guarded.NoAnswerError):
                ways.insert(0, time_limit.run(self.deadline, partial(neat, proposal.integral, self.frame)))
            for way in dict.fromkeys(ways):
                if not potential.writable(way):
                    continue
                rates = zero_test.vanish(self.frame.rates(way), self.deadline, self.block.surface)
                if rates.truth is True and self._is_new(way):
                    # What comes after the budget is not found, at whatever moment it is ended.
                    time_limit.check(self.deadline)
                    self.found.append(SearchResult(way, proposal.how))
                    break
            if self.is_complete:
                return

    def _is_new(self, phi: sympy.Expr) -> bool:
        """True if its differential is proved independent of those known, on every side of all kinks."""
        pivots = [self.frame.variables[p] for p in self.frame.pivots]
        matrix = [[forms.partial(f, x) for x in pivots] for f in (*self.integrals, phi)]
        if len(matrix) > len(pivots):
            return False
        sides = forms.kink_sides(matrix, forms.moduli(matrix)[:MAX_KINKS])
        return all(
            function_field.has_rank(side, len(matrix), self.deadline, self.block.surface) for side in sides
        )


def neat(phi: sympy.Expr, frame: function_field.KernelFrame) -> sympy.Expr:
    """The integral as a person would write it; every function of it is one as well."""
    if not phi.has(sympy.log):
        above, below = sympy.fraction(guarded.together(phi))
        if below.free_symbols and not below.free_symbols & set(frame.variables):
            phi = guarded.expand(above)
    if phi.is_Add and not phi.has(sympy.log, sympy.atan):
        rest = phi.primitive()[1]
        rest = -rest if rest.could_extract_minus_sign() else rest
        return min((rest, guarded.factor(rest)), key=lambda way: (way.count_ops(), len(str(way))))
    return tidy_integral.integral(phi, frame.variables)


def search(
    block: forms.PfaffianBlock, deadline: float, wanted: int | None = None, budget: int | None = None
) -> tuple[SearchResult, ...]:
    """Verified and independent first integrals of the rows (C, n), as far as closed forms are found until `deadline`.
    wanted: how many there are where the rows are not completely integrable; budget: of operations."""
    real = {s: sympy.Symbol(s.name, real=True) for s in (*block.variables, *block.parameters)}

    def prepared() -> tuple[forms.PfaffianBlock, elimination.Substitutions]:
        named = forms.in_symbols(block, real)
        rows = tuple(tuple(forms.plain(sympy.sympify(a)) for a in row) for row in named.rows)
        plain = replace(named, rows=rows, surface=tuple(map(forms.plain, named.surface)))
        return elimination.in_angles(elimination.eliminated(plain)[0])

    ready = time_limit.answer(deadline, prepared)
    if ready is None:
        return ()
    flat, angles = ready
    back = {r: s for s, r in real.items()}
    outer = {e: value for e, value in angles.items() if not e.is_Symbol}
    found = []
    for each in _found(flat, deadline, wanted, budget):
        phi = each.integral
        if phi.free_symbols & angles.keys():  # the coordinates of circles instead of their angles
            phi = guarded.expand_trig(phi).xreplace(outer).xreplace(angles)
        found.append(SearchResult(phi.xreplace(back), each.how))
    return tuple(found)


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
    yield from _monomials(search, search.alphabet(), (1, 2, 3))


def _monomials(search: IntegralSearch, letters: combinations.Alphabet, degrees: Sequence[int]) -> Proposals:
    for degree in degrees:
        if degree > 1 and not letters.largest(degree):
            return
        chosen = letters.monomials(degree)
        field = combinations.CombinationField(
            search.frame, letters.letters, len(chosen), search.block.surface
        )
        yield from _combined(search, field, field.monomials(letters, chosen), letters.products(chosen), _SUMS)


def _combined(
    search: IntegralSearch,
    field: combinations.CombinationField,
    numbers: combinations.Numbers,
    functions: Sequence[sympy.Expr],
    how: str,
) -> Proposals:
    """Combinations of functions with these numbers, beside the integrals that are found meanwhile."""
    integrals = search.integrals
    taken = list(field.functions(integrals).slopes) if integrals else []
    for phi, slopes in combinations.proposals(search.frame, numbers, functions, taken):
        before = len(search.found)
        yield SearchResult(phi, how)
        if len(search.found) > before:
            taken.append(slopes)


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
    yield from _monomials(search, combinations.Alphabet(*zip(*pairs, strict=True)), (2, 3))


def rational(search: IntegralSearch) -> Proposals:
    """Sums of products with the reciprocals of what the frame is divided by."""
    below = combinations.denominator(search.entries)
    factors = combinations.factors([below], search.frame.variables)
    if search.block.surface or not below.free_symbols & set(search.frame.variables):
        return
    reciprocals = [1 / q for q in factors if below.has(q) or not q.is_Symbol]
    yield from _monomials(search, search.alphabet(*reciprocals[:MAX_RECIPROCALS]), (1, 2, 3))


def products(search: IntegralSearch) -> Proposals:
    """Products of powers of invariant surfaces, exponentials, and angles."""
    frame, surface = search.frame, search.block.surface
    surfaces = combinations.surfaces_of([f.integral for f in search.found], frame.variables)
    known_factors = combinations.factors(search.entries, frame.variables)
    candidates = list(dict.fromkeys([*known_factors, *surfaces, *search.factors]))
    letters = search.alphabet()
    chosen = letters.monomials(2)
    functions = letters.products(chosen)
    logs = [sympy.log(p) for p in candidates]
    logs += combinations.angles(candidates, frame.variables)
    if surface:
        logs += [c * e for c in sorted(combinations.constants_of(frame), key=str) for e in logs]
    field = combinations.CombinationField(
        frame, [*letters.letters, *candidates], len(chosen) + len(logs), surface
    )
    numbers = combinations.join(field.functions(logs), field.monomials(letters, chosen))
    yield from _combined(search, field, numbers, [*logs, *functions], _POWERS)


def invariant_surfaces(search: IntegralSearch) -> Proposals:
    """More factors from an inverse multiplier; products of them, and polynomials over them."""
    if search.block.surface:
        return
    found = combinations.multipliers(search.frame, search.alphabet())
    for v in found[1:]:
        yield SearchResult(tidy_integral.ratio(v, found[0]), "as a ratio of two inverse multipliers")
    search.factors = combinations.surfaces_of(found, search.frame.variables)
    yield from products(search)
    for q in search.factors:
        if not q.is_Symbol:
            yield from _monomials(search, search.alphabet(1 / q), (2, 3))


def single_rows(search: IntegralSearch) -> Proposals:
    """Combinations of the forms with few differentials, each by itself."""
    if search.block.surface:
        return
    tried: set[tuple[sympy.Expr, ...]] = set()
    block = search.block
    for last in ((), *((x,) for x in block.variables)):
        frame = search.frame
        if last:
            frame = function_field.kernel(block.rows, block.variables, block.parameters, last)
        for a in sorted(range(len(frame.pivots)), key=lambda a: sum(e != 0 for e in frame.solved[a])):
            entries = dict.fromkeys(range(len(block.variables)), sympy.Integer(0))
            entries[frame.pivots[a]] = sympy.Integer(1)
            entries |= {j: -value for j, value in zip(frame.free, frame.solved[a], strict=True)}
            row = tuple(entries.values())
            if row in tried:
                continue
            tried.add(row)
            form = integrating_factors.primitive(forms.Form("row", block.variables, row, block.parameters))
            closed = zero_test.vanish(list(form.wedge().values()), search.deadline)
            if closed.truth is not True:
                continue
            found = integrating_factors.search(form, search.deadline)
            if found is not None:
                yield SearchResult(found.integral, f"for a combination of the forms {found.how}")


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
    for each in _found(smaller, search.deadline):
        how = f"by eliminating a coordinate with another integral, {each.how}"
        yield SearchResult(each.integral.xreplace(constants), how)


def _solved(f: sympy.Expr, variables: Sequence[sympy.Symbol]) -> tuple[sympy.Symbol, sympy.Expr] | None:
    """(x, value) with f = 0 where x = value; linear equations first."""
    occurring = [x for x in variables if x in f.free_symbols and x.name != elimination.TIME]
    ways = []
    for x in occurring:
        slope = forms.partial(f, x)
        if x not in slope.free_symbols:
            value = tidy_integral.ratio(guarded.expand(slope * x - f), slope)
            ways.append((slope.count_ops(), str(x), x, value))
    if ways:
        return min(ways, key=lambda w: w[:2])[2:]
    for x in occurring:
        try:
            roots = guarded.solve(f, x, simplify=False, check=False)
        except guarded.SympyFailure:
            continue
        good = [r for r in roots if potential.writable(r)]
        if good:
            return x, good[-1]
    return None


def linear_flow(search: IntegralSearch) -> Proposals:
    """Of one field, with linear equations x' = A x + b(s), exp(-A s) x - int exp(-A s) b ds (C,)."""
    frame = search.frame
    if search.block.surface or len(frame.free) != 1:
        return
    s = frame.variables[frame.free[0]]
    x = sympy.Matrix([frame.variables[p] for p in frame.pivots])
    speeds = sympy.Matrix([guarded.expand(row[0]) for row in frame.solved])
    moving = {*x, s}
    A = speeds.jacobian(x)
    if any(e.free_symbols & moving for e in A):
        return
    b = (speeds - A * x).applyfunc(guarded.expand)
    if any(e.free_symbols & set(x) for e in b):
        return
    back = _exponential(A, -s)
    if back is None:
        return
    drift = []
    for e in back * b:
        found = potential.antiderivative(guarded.expand(e), s)
        if found is None:
            return
        drift.append(found)
    # Rows l with l A = k l for all rational k, where there are enough of them; else the unit matrix.
    rows = []
    if all(e.is_Rational for e in A):
        for value, _, vectors in guarded.call(A.T.eigenvects, error_when_incomplete=False):
            if value.is_Rational:
                rows += [(v * sympy.ilcm(1, *(e.q for e in v))).T for v in vectors]
    weights = sympy.Matrix.vstack(*rows) if len(rows) == A.rows else sympy.eye(A.rows)
    for phi in (weights * (back * x - sympy.Matrix(drift))).applyfunc(guarded.expand):
        yield SearchResult(phi, "as the solution of linear differential equations")


def _exponential(A: sympy.Matrix, s: sympy.Expr) -> sympy.Matrix | None:
    """exp(A s) in real functions, or None."""
    size = A.rows
    total, power = sympy.eye(size), sympy.eye(size)
    for n in range(1, size + 1):
        power = (power * A).applyfunc(guarded.expand)
        if power.is_zero_matrix:
            return total
        total += power * s**n / sympy.factorial(n)
    if size == 1:
        return sympy.Matrix([[sympy.exp(A[0] * s)]])
    if size == 2:
        # With A = h I + B, B**2 = q I: exp(A s) = exp(h s) (cosh(sqrt(q) s) I + sinh(sqrt(q) s)/sqrt(q) B)
        h = A.trace() / 2
        B = A - h * sympy.eye(2)
        q = guarded.factor(-B.det())
        if q == 0:
            even, odd = sympy.Integer(1), s
        else:
            is_turning = q.is_negative or q.could_extract_minus_sign()
            # sqrt(k**2) = k, of either sign: the functions of it are even.
            w = sympy.sqrt(-q if is_turning else q).replace(sympy.Abs, lambda u: u)
            if is_turning:
                even, odd = sympy.cos(w * s), sympy.sin(w * s) / w
            else:
                even = (sympy.exp(w * s) + sympy.exp(-w * s)) / 2
                odd = (sympy.exp(w * s) - sympy.exp(-w * s)) / (2 * w)
        return (sympy.exp(h * s) * (even * sympy.eye(2) + odd * B)).applyfunc(guarded.expand)
    try:
        found = guarded.call((A * s).exp)
        found = found.applyfunc(lambda e: guarded.expand(e, complex=e.has(sympy.I)))
    except guarded.SympyFailure:
        return None
    return found if all(potential.writable(e) for e in found) else None


_WAYS: tuple[tuple[Strategy, int], ...] = (
    (fixed, 40_000),
    (polynomials, 80_000),
    (products, 80_000),
    (rational, 40_000),
    (turned, 60_000),
    (linear_flow, 80_000),
    (invariant_surfaces, 60_000),
    (eliminations, 120_000),
    (one_form, 120_000),
    (single_rows, 80_000),
    (eliminations, 120_000),
)
"""Ways of searching, cheap ones first, and the operations that each may take."""
