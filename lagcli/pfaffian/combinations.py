"""First integrals as combinations of given functions with constant coefficients: sum_l c_l X_j(m_l) = 0. They are found
in doubles at random points, and proposed with exact constants: fractions, or by comparing coefficients."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial, reduce
from itertools import combinations_with_replacement
from math import comb, lcm

import numpy as np
import sympy

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import decompositions
from lagcli.pfaffian.exact import constant_combinations, guarded, normal_form, sampling
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.function_field import KernelFrame

# Unknowns of one linear system: all monomials of degree 4 in seven letters.
MAX_MONOMIALS = 330
# Equations beyond the unknowns, so that chance makes no null vector; points at which new differentials are looked at.
_SPARE, _NEAR = 12, 4
# Smooth functions nearly depend on each other: so many with constants that are no fractions are rounding.
_MANY = 12
# A coefficient is a fraction where one has so small a denominator.
_MAX_DENOMINATOR = 360
# Candidates taken, in the order of their letters: each is a column of a linear system.
MAX_SURFACES = 24
# Degrees of inverse multipliers, one after the other: a plane and a conic have 3, two conics 4.
_DEGREES = (2, 3, 4)
# The highest power of a letter without a relation, beyond every degree that is asked for.
_UNBOUNDED = 99
# Values may leave the range of doubles: what is not finite is left out, in `null_vectors` and `is_new`.
_unbounded = partial(np.errstate, over="ignore", invalid="ignore")


@dataclass(frozen=True, slots=True)
class Alphabet:
    """Functions of which monomials are made, with the highest power of each (others follow from a relation)."""

    letters: tuple[sympy.Expr, ...]
    highest: tuple[int, ...]

    def monomials(self, degree: int) -> list[tuple[int, ...]]:
        """The index tuples of the monomials up to `degree`, fewer where they are more than `MAX_MONOMIALS`."""
        size = len(self.letters)
        while degree > 1 and comb(size + degree, degree) > MAX_MONOMIALS:
            degree -= 1
        numbered = list(enumerate(self.letters))
        opposite = {(i, k) for i, a in numbered for k, b in numbered if i < k and a * b == 1}
        found = []
        for d in range(1, degree + 1):
            for m in combinations_with_replacement(range(size), d):
                allowed = all(m.count(i) <= self.highest[i] for i in set(m))
                if allowed and not any(i in m and k in m for i, k in opposite):
                    found.append(m)
        return found[:MAX_MONOMIALS]

    def products(self, chosen: Sequence[tuple[int, ...]]) -> list[sympy.Expr]:
        """The monomials of some index tuples."""
        return [sympy.Mul(*(self.letters[i] for i in m)) for m in chosen]

    def largest(self, degree: int) -> bool:
        """True if the monomials of `degree` are few enough."""
        return comb(len(self.letters) + degree, degree) <= MAX_MONOMIALS


def alphabet(
    entries: Sequence[sympy.Expr], variables: Sequence[sympy.Symbol], more: Sequence[sympy.Expr] = ()
) -> Alphabet:
    """The variables and the functions that occur in the entries, and `more`. Raises `normal_form.NoNormalFormError`."""
    basis = normal_form.NormalForm(entries)
    moving = set(variables)
    letters: dict[sympy.Expr, int] = dict.fromkeys(variables, _UNBOUNDED)
    for letter in basis.letters[::-1]:
        meaning = basis.means(letter)
        if not meaning.free_symbols & moving:
            continue
        if isinstance(meaning, sympy.exp):
            letters[meaning] = letters[1 / meaning] = _UNBOUNDED
        elif isinstance(meaning, (sympy.cos, sympy.Abs)):
            letters[meaning] = 1
        elif meaning.is_Pow and meaning.exp.is_Rational and not meaning.exp.is_Integer:
            letters[meaning] = int(meaning.exp.q) - 1
        else:
            letters.setdefault(meaning, _UNBOUNDED)
    for m in more:
        letters.setdefault(m, _UNBOUNDED)
    return Alphabet(tuple(letters), tuple(letters.values()))


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Values of N functions at points: along (rows, N) the defects of each, terms (rows, N) the size of the terms that
    add up to them, slopes (N, C, near) the derivatives for the pivots at a few of the points."""

    along: Floats
    terms: Floats
    slopes: Floats


class CombinationField:
    """A frame with sample points: the numbers of functions along its fields."""

    def __init__(
        self,
        frame: KernelFrame,
        entries: Sequence[sympy.Expr],
        columns: int,
        surface: Sequence[sympy.Expr] = (),
    ) -> None:
        count = int(1.3 * columns / max(len(frame.free), 1)) + _SPARE
        probes = [*(e for row in frame.solved for e in row), *entries]
        self.frame = frame
        self.sample = sampling.draw(probes, frame.variables, frame.parameters, count, surface)
        self._solved = [[self.sample.of(e) for e in row] for row in frame.solved]

    def derivatives(self, function: sympy.Expr) -> tuple[Floats, Floats, Floats]:
        """X_j(function) (n - C, points), the size of its terms, and the derivatives for the pivots (C, points)."""
        frame = self.frame
        slopes = [self.sample.of(forms.partial(function, frame.variables[p])) for p in frame.pivots]
        rates, sizes = [], []
        with _unbounded():
            for column, j in enumerate(frame.free):
                terms = [row[column] * s for row, s in zip(self._solved, slopes, strict=True)]
                terms.append(self.sample.of(forms.partial(function, frame.variables[j])))
                rates.append(sum(terms))
                sizes.append(sum(abs(e) for e in terms))
        return np.array(rates), np.array(sizes), np.array(slopes)

    def monomials(
        self, letters: Alphabet, chosen: Sequence[tuple[int, ...]], weight: Floats | None = None
    ) -> Numbers:
        """The numbers of the monomials m; `weight` (n - C, points): of X_j(m) - weight_j m instead."""
        values = np.array([self.sample.of(g) for g in letters.letters])
        found = [self.derivatives(g) for g in letters.letters]
        rates, sizes, slopes = (np.array([f[n] for f in found]) for n in range(3))
        along, terms, near = [], [], []
        with _unbounded():
            for m in chosen:
                index = list(m)
                # The product rule as a sum: a letter may be zero, on a surface even everywhere.
                others = np.ones((len(m), self.sample.count))
                for k, other in enumerate(others):
                    other *= np.prod(values[index[:k] + index[k + 1 :]], axis=0)
                rate, size, slope = (
                    np.einsum("kjp,kp->jp", of[index], weights)
                    for of, weights in ((rates, others), (sizes, np.abs(others)), (slopes, others))
                )
                if weight is not None:
                    value = np.prod(values[index], axis=0)
                    rate, size = rate - weight * value, size + np.abs(weight * value)
                along.append(rate.ravel())
                terms.append(size.ravel())
                near.append(slope[:, :_NEAR])
        return Numbers(np.array(along).T, np.array(terms).T, np.array(near))

    def functions(self, chosen: Sequence[sympy.Expr]) -> Numbers:
        found = [self.derivatives(g) for g in chosen]
        along, terms = (np.array([f[n].ravel() for f in found]).T for n in range(2))
        return Numbers(along, terms, np.array([f[2][:, :_NEAR] for f in found]))


def join(*both: Numbers) -> Numbers:
    """The numbers of the functions of both."""
    along, terms = np.hstack([one.along for one in both]), np.hstack([one.terms for one in both])
    return Numbers(along, terms, np.concatenate([one.slopes for one in both]))


def null_vectors(numbers: Numbers) -> list[dict[int, float]]:
    """Combinations of the columns of defects that vanish: {column: coefficient}, one for each column that depends on
    earlier ones, with the coefficient 1, in those that depend on no others."""
    finite = np.all(np.isfinite(numbers.terms) & np.isfinite(numbers.along), axis=1)
    along, terms = numbers.along[finite], numbers.terms[finite]
    if not len(along):
        return []
    scale = terms.max(axis=1)
    scale[scale == 0] = 1.0
    rows = along / scale[:, None]
    lengths = np.linalg.norm(terms / scale[:, None], axis=0)
    independent, dependent, c = sampling.dependences(rows, lengths)
    found = []
    for n, k in enumerate(dependent):
        least = doubles.ROOT * max(float(lengths[k]), 1e-300)
        parts = ((i, -float(v)) for i, v in zip(independent, c[:, n], strict=True) if i < k)
        found.append({i: v for i, v in parts if abs(v) * lengths[i] > least} | {k: 1.0})
    return found


def is_new(slopes: Floats, taken: Sequence[Floats]) -> bool:
    """True if the slopes (C, near) of a proposal are independent of those taken, at one of the points."""
    for n in range(slopes.shape[1]):
        matrix = np.array([t[:, n] for t in (*taken, slopes)])
        if not np.all(np.isfinite(matrix)):
            continue
        norms = np.linalg.norm(matrix, axis=1)
        if not (np.all(norms > doubles.ZERO) and np.all(np.isfinite(norms))):
            continue
        singular = decompositions.singular_values(matrix / norms[:, None])
        if len(singular) == len(matrix) and singular[-1] > doubles.ROOT:
            return True
    return False


def proposals(
    frame: KernelFrame, numbers: Numbers, functions: Sequence[sympy.Expr], taken: Sequence[Floats]
) -> Iterator[tuple[sympy.Expr, Floats]]:
    """Combinations of the functions that seem to be new first integrals, simple ones first, with their slopes; taken:
    the slopes of the integrals already found, which may grow."""

    def length(vector: dict[int, float]) -> tuple[bool, int, int]:
        # An angle jumps where it starts again: last.
        return any(functions[i].has(sympy.atan2) for i in vector), len(vector), max(vector)

    for vector in sorted(null_vectors(numbers), key=length):
        with _unbounded():
            slopes = np.asarray(sum(c * numbers.slopes[i] for i, c in vector.items()))
        if is_new(slopes, taken):
            phi = exact(vector, functions, frame.rates, constants_of(frame))
            if phi is not None:
                yield phi, slopes


def constants_of(frame: KernelFrame) -> frozenset[sympy.Expr]:
    """The parameters and irrational numbers that occur in the frame."""
    entries = [e for row in frame.solved for e in row]
    numbers = {p for e in entries for p in sympy.preorder_traversal(e) if p.is_number and not p.is_Rational}
    return frozenset(numbers | {s for e in entries for s in e.free_symbols if s in frame.parameters})


def exact(
    vector: dict[int, float],
    functions: Sequence[sympy.Expr],
    defects: Callable[[sympy.Expr], list[sympy.Expr]],
    constants: frozenset[sympy.Expr],
) -> sympy.Expr | None:
    """The combination with exact constants, fractions of small numbers or else such as hold parameters, free of
    denominators; `defects` gives what is to vanish."""
    fractions = {i: Fraction(c).limit_denominator(_MAX_DENOMINATOR) for i, c in vector.items()}
    errors = {i: abs(float(f) - vector[i]) for i, f in fractions.items()}
    if all(error <= doubles.ZERO * max(1.0, abs(vector[i])) for i, error in errors.items()):
        scale = lcm(*(f.denominator for f in fractions.values()))
        return sympy.Add(*(int(f * scale) * functions[i] for i, f in fractions.items()))
    used = sorted(vector)
    if not constants or len(used) > _MANY:  # smooth functions may nearly depend on each other
        return None
    columns = [defects(functions[i]) for i in used]
    for found in constant_combinations.null_vectors(columns, constants):
        if found[-1] == 0:
            continue
        common = guarded.lcm_list([sympy.fraction(c)[1] for c in found])
        pairs = zip(found, used, strict=True)
        return sympy.Add(*(guarded.cancel(c * common) * functions[i] for c, i in pairs))
    return None


# Invariant surfaces: p with X_j(p) = K_j p, of which logarithmic integrals are made. Candidates are factors of
# coefficients, of known integrals, and of an inverse multiplier V: theta_1 ^ ... ^ theta_C = d(phi_1) ^ ... ^
# d(phi_C)/V, X_j(V) = div_j V (G. Darboux, Bull. Sci. Math. 2, 1878; Jacobi's last multiplier is 1/V).


def factors(entries: Sequence[sympy.Expr], variables: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """The letters of the entries and the factors of their numerators and denominators. Raises `NoNormalFormError`."""
    return normal_form.NormalForm([*entries, *variables]).surfaces(entries, variables)[:MAX_SURFACES]


def denominator(entries: Sequence[sympy.Expr]) -> sympy.Expr:
    """The least common denominator in the normal form. Raises `normal_form.NoNormalFormError`."""
    basis = normal_form.NormalForm(entries)
    parts = (basis.element(e).denom for e in entries)
    return basis.expression(reduce(lambda a, b: a.lcm(b), parts, basis.ring.one))


def angles(surfaces: Iterable[sympy.Expr], variables: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """atan2(v, u) for each surface u**2 + v**2 = (u + i v)(u - i v) that is quadratic in a variable."""
    found = []
    for p in surfaces:
        for x in (x for x in variables if x in p.free_symbols and p.is_polynomial(*variables)):
            a, b, c = (guarded.Poly(p, x).coeff_monomial(x**n) for n in (2, 1, 0))
            if a == 0 or a.free_symbols & set(variables) or guarded.degree(p, x) != 2:
                continue
            # 4 a p = (2 a x + b)**2 + (4 a c - b**2)
            v = _square_root(guarded.expand(4 * a * c - b**2), variables)
            if v is not None:
                # Both without their common factor, with plain signs.
                u = guarded.expand(2 * a * x + b)
                common = guarded.gcd(v, u)
                parts = [guarded.cancel(e / common) for e in (v, u)]
                plain = (guarded.expand(-e if e.could_extract_minus_sign() else e) for e in parts)
                found.append(sympy.atan2(*plain))
                break
    return found


def _square_root(square: sympy.Expr, variables: Sequence[sympy.Symbol]) -> sympy.Expr | None:
    """v with v**2 = square, polynomial in the variables and not constant, or None."""
    constant, parts = guarded.factor_list(square)
    moving = set(variables)
    if not square.free_symbols & moving or any(n % 2 for f, n in parts if f.free_symbols & moving):
        return None
    for f, n in parts:
        constant *= 1 if f.free_symbols & moving else f**n
    if constant.is_negative:
        return None
    root = sympy.sqrt(constant).replace(sympy.Abs, lambda u: u)
    return root * sympy.Mul(*(f ** (n // 2) for f, n in parts if f.free_symbols & moving))


def multipliers(frame: KernelFrame, letters: Alphabet) -> list[sympy.Expr]:
    """Inverse multipliers V: polynomials in the letters over the common denominator of the frame. Raises
    `NoAnswerError`."""
    below = denominator([e for row in frame.solved for e in row])
    divergences = []
    for j in range(len(frame.free)):
        pairs = zip(frame.pivots, frame.solved, strict=True)
        terms = (forms.partial(row[j], frame.variables[p]) for p, row in pairs)
        divergences.append(sum(terms, sympy.Integer(0)))
    weights = [d + r / below for d, r in zip(divergences, frame.rates(below), strict=True)]
    constants = constants_of(frame)

    def defects(w: sympy.Expr) -> list[sympy.Expr]:
        return [r - k * w for r, k in zip(frame.rates(w), weights, strict=True)]

    for degree in _DEGREES:
        if not letters.largest(degree):
            break
        chosen = [(), *letters.monomials(degree)]
        functions = letters.products(chosen)
        field = CombinationField(frame, weights, len(chosen))
        weight = np.array([field.sample.of(w) for w in weights])
        numbers = field.monomials(letters, chosen, weight)
        found = []
        for vector in null_vectors(numbers)[:4]:
            w = exact(vector, functions, defects, constants)
            if w is not None:
                found.append(w / below)
        if found:
            return found
    return []


def surfaces_of(functions: Iterable[sympy.Expr], variables: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """Irreducible factors of rational functions, those that hold variables."""
    found: list[sympy.Expr] = []
    for e in functions:
        if e.atoms(sympy.log, sympy.atan2):
            continue
        try:
            for part in sympy.fraction(guarded.together(e)):
                found += [f for f, _ in guarded.factor_list(part)[1]]
        except guarded.SympyFailure:
            continue
    moving = set(variables)
    return [f for f in dict.fromkeys(found) if f.free_symbols & moving and not isinstance(f, sympy.exp)]
