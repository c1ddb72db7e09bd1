"""All real zeros of polynomials with rational coefficients, with the proof that there are no others.

A Groebner basis gives the algebra of functions on the zeros, of finite dimension D where there are finitely many. The
signature of its trace form, in exact arithmetic, is the number of real zeros (Hermite); eigenvectors of multiplication
give them in floating point. Only where as many are found as there must be is the list complete.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from sympy.polys.groebnertools import groebner
from sympy.polys.rings import PolyElement, PolyRing

from lagcli.statics import polynomial_equations

Floats = npt.NDArray[np.float64]
LARGEST = int(np.finfo(float).max)
Rationals = list[list[Fraction]]


class AlgebraParameters:
    """Numbers of the algebra of functions on the zeros; parts are of the size of a zero.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py` and
    `tests/unit/test_numbers_of_statics.py`.
    """

    __slots__ = ()

    most_dimensions: int = 36
    """The dimension D of the algebra: its signature is that of D by D fractions.
    At 3 and at 360 `test_an_algebra_of_thirty_six_dimensions_is_counted_and_one_of_forty_two_is_not` fails."""
    most_zeros: int = 4096
    """Zeros of all blocks together: as many points of rest nobody reads.
    At 409 and at 40 960 `test_four_thousand_zeros_are_listed_and_eight_thousand_are_not` fails."""
    real: float = 1e-4
    """An eigenvalue with a larger imaginary part belongs to no real zero; the count by exact arithmetic
    judges what is left. `test_eigenvalues_that_are_real_to_four_digits_are_refined` fails at 1e-5 and
    0.001."""
    same: float = 1e-7
    """Zeros closer than this are one: they are refined to rounding first.
    At 1e-8 and at 1e-6 `test_zeros_that_are_almost_one_are_not_told_apart` fails."""
    newton_steps: int = 30
    """Newton's steps of a refinement, each of which doubles the digits.
    `test_a_zero_is_refined_by_thirty_newton_steps` fails at 3 and 300."""


PARAMETERS = AlgebraParameters()


class NotCounted(Exception):
    """The zeros are infinitely many, or too many to be counted; the message says which."""


def zeros(ring: PolyRing, equations: Sequence[PolyElement], used: Sequence[int]) -> Floats:
    """All real zeros (Z, unknowns) of equations in the `used` unknowns; the others are zero.

    Raises `NotCounted`, and `SpentError` of the order of the ring.
    """
    found = np.zeros((1, len(ring.gens)))
    for block in _blocks(equations, used):
        indices, polynomials = block
        part = _of_block(ring, polynomials, indices)
        if len(found) * len(part) > PARAMETERS.most_zeros:
            raise NotCounted("there are too many of them")
        found = (found[:, None, :] + part[None, :, :]).reshape(-1, len(ring.gens))
    return found


def _blocks(
    equations: Sequence[PolyElement], used: Sequence[int]
) -> Iterator[tuple[tuple[int, ...], list[PolyElement]]]:
    """Unknowns that hang together, with their equations: the zeros are all combinations of those of the blocks."""
    left = [
        (frozenset(k for m in e.itermonoms() for k, power in enumerate(m) if power), e) for e in equations
    ]
    waiting = set(used)
    for constant in (e for indices, e in left if not indices):
        assert constant
        waiting = set()
        yield (), [constant]
        return
    while waiting:
        block = {min(waiting)}
        while True:
            wider = block.union(*(indices for indices, _ in left if indices & block))
            if wider == block:
                break
            block = wider
        yield tuple(sorted(block)), [e for indices, e in left if indices & block]
        waiting -= block


def _of_block(ring: PolyRing, equations: Sequence[PolyElement], indices: Sequence[int]) -> Floats:
    if not indices:
        return np.zeros((0, len(ring.gens)))  # a constant is no zero
    small = PolyRing([str(ring.symbols[k]) for k in indices], ring.domain, ring.order)
    own = [
        small.from_dict({tuple(m[k] for k in indices): factor for m, factor in e.terms()}) for e in equations
    ]
    basis = groebner(own, small)
    if any(e.is_ground for e in basis):
        return np.zeros((0, len(ring.gens)))
    algebra = _QuotientAlgebra(small, basis)
    real = algebra.real_count()
    roots = algebra.real_zeros(own) if real else np.zeros((0, len(indices)))
    if len(roots) != real:
        raise NotCounted(f"{real} real zeros are proved and {len(roots)} found")
    found = np.zeros((real, len(ring.gens)))
    found[:, list(indices)] = roots
    return found


class _QuotientAlgebra:
    """The functions on the zeros: a basis of monomials, and the matrices of multiplication by the unknowns."""

    def __init__(self, ring: PolyRing, basis: Sequence[PolyElement]) -> None:
        self._ring, self._ideal = ring, list(basis)
        leading = [e.LM for e in basis]
        self.monomials = list(_standard(leading, len(ring.gens)))
        self._index = {monomial: k for k, monomial in enumerate(self.monomials)}
        self.D = len(self.monomials)
        self._by_unknown = [self._multiplication(k) for k in range(len(ring.gens))]

    def _multiplication(self, unknown: int) -> Rationals:
        """Rows: x_k times each monomial of the basis, in the basis."""
        rows = []
        for monomial in self.monomials:
            raised = tuple(power + (k == unknown) for k, power in enumerate(monomial))
            rows.append(self._reduced(raised))
        return rows

    def _reduced(self, monomial: tuple[int, ...]) -> list[Fraction]:
        row = [Fraction(0)] * self.D
        if monomial in self._index:
            row[self._index[monomial]] = Fraction(1)
            return row
        for powers, factor in (
            self._ring.from_dict({monomial: self._ring.domain.one}).rem(self._ideal).terms()
        ):
            row[self._index[powers]] = Fraction(int(factor.numerator), int(factor.denominator))
        return row

    def real_count(self) -> int:
        """The number of distinct real zeros: the signature of the trace form."""
        # The products of all pairs of monomials, row by row: b_i b_j in the basis.
        products: dict[tuple[int, ...], Rationals] = {}
        one = [[Fraction(int(i == j)) for j in range(self.D)] for i in range(self.D)]
        for monomial in self.monomials:
            unknown = next((k for k, power in enumerate(monomial) if power), None)
            if unknown is None:
                products[monomial] = one
                continue
            lower = tuple(power - (k == unknown) for k, power in enumerate(monomial))
            products[monomial] = _times(products[lower], self._by_unknown[unknown])
        traces = [
            sum((M[i][i] for i in range(self.D)), Fraction(0)) for M in (products[m] for m in self.monomials)
        ]
        form = [[_dot(row, traces) for row in products[monomial]] for monomial in self.monomials]
        return _signature(form)

    def real_zeros(self, equations: Sequence[PolyElement]) -> Floats:
        """The real zeros from eigenvectors of a mixed multiplication, refined by Newton's steps.

        Raises `NotCounted` where its numbers are no doubles.
        """
        exact = [*(x for M in self._by_unknown for row in M for x in row), *_factors(equations)]
        if any(abs(x) > LARGEST for x in exact):
            raise NotCounted("their numbers are too large")
        random = np.random.default_rng(0)
        slopes = [[e.diff(x) for x in self._ring.gens] for e in equations]
        matrices = [np.array([[float(x) for x in row] for row in M]) for M in self._by_unknown]
        found: list[Floats] = []
        for _ in range(4):
            weights = random.standard_normal(len(matrices))
            mixed = sum(w * M for w, M in zip(weights, matrices, strict=True))
            _, vectors = np.linalg.eig(mixed)
            one = self._index[(0,) * len(self._ring.gens)]
            for vector in vectors.T:
                if abs(vector[one]) < 1e-14 * np.abs(vector).max():
                    continue
                vector = vector / vector[one]
                values = np.array([(M[one] @ vector) for M in matrices])
                if np.abs(values.imag).max() > PARAMETERS.real * (1 + np.abs(values).max()):
                    continue
                zero = _polished(equations, slopes, values.real)
                if zero is not None and not any(_same(zero, other) for other in found):
                    found.append(zero)
        return np.array(found).reshape(len(found), len(self._ring.gens))


def _factors(equations: Sequence[PolyElement]) -> Iterator[Fraction]:
    for equation in equations:
        for _, factor in equation.terms():
            yield Fraction(int(factor.numerator), int(factor.denominator))


def _same(a: Floats, b: Floats) -> bool:
    return bool(np.abs(a - b).max() <= PARAMETERS.same * (1 + np.abs(a).max()))


def _polished(
    equations: Sequence[PolyElement], slopes: Sequence[Sequence[PolyElement]], x: Floats
) -> Floats | None:
    """A real zero near x, or None."""
    sizes = np.array([max(abs(float(factor)) for _, factor in e.terms()) for e in equations])
    begin = x
    for _ in range(PARAMETERS.newton_steps):
        numbers = x.tolist()
        r = np.array([polynomial_equations.at(e, numbers) for e in equations]) / sizes
        J = np.array([[polynomial_equations.at(d, numbers) for d in row] for row in slopes]) / sizes[:, None]
        step = np.linalg.lstsq(J, -r, rcond=1e-11)[0]
        x = x + step
        if np.abs(step).max() <= 1e-15 * (1 + np.abs(x).max()):
            break
    numbers = x.tolist()
    r = np.array([polynomial_equations.at(e, numbers) for e in equations]) / sizes
    size = (1 + np.abs(x).max()) ** max(sum(m) for e in equations for m in e.itermonoms())
    near = np.abs(x - begin).max() <= 1e-2 * (1 + np.abs(x).max())
    return x if near and np.abs(r).max() <= 1e-11 * size else None


def _standard(leading: Sequence[tuple[int, ...]], count: int) -> list[tuple[int, ...]]:
    """The monomials that no leading one divides, by degree. Raises `NotCounted` where they are too many."""
    for k in range(count):
        if not any(m[k] == sum(m) for m in leading):
            raise NotCounted("they form a continuum")
    found, layer = [], [(0,) * count]
    while layer:
        found += layer
        if len(found) > PARAMETERS.most_dimensions:
            raise NotCounted("there are too many of them")
        further = {tuple(p + (i == k) for i, p in enumerate(m)) for m in layer for k in range(count)}
        layer = sorted(m for m in further if not any(_divides(one, m) for one in leading))
    return found


def _divides(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    return all(a <= b for a, b in zip(one, other, strict=True))


def _times(left: Rationals, right: Rationals) -> Rationals:
    columns = list(zip(*right, strict=True))
    return [[_dot(row, column) for column in columns] for row in left]


def _dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True) if x and y), Fraction(0))


def _signature(form: Rationals) -> int:
    """Positive less negative squares of a symmetric form, by exact elimination."""
    A = [row[:] for row in form]
    signature = 0
    left = list(range(len(A)))
    while left:
        pivot = next((k for k in left if A[k][k]), None)
        if pivot is None:
            pair = next(((i, j) for i, j in itertools.combinations(left, 2) if A[i][j]), None)
            if pair is None:
                break
            i, j = pair  # x_i x_j is the difference of two squares: add row and column j to i
            for k in left:
                A[i][k] += A[j][k]
            for k in left:
                A[k][i] += A[k][j]
            continue
        signature += 1 if A[pivot][pivot] > 0 else -1
        left.remove(pivot)
        for i in left:
            if A[i][pivot]:
                factor = A[i][pivot] / A[pivot][pivot]
                for k in left:
                    A[i][k] -= factor * A[pivot][k]
    return signature
