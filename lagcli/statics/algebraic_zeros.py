"""All real zeros of polynomials with rational coefficients, each exactly, with the proof that there are no others.

A Groebner basis gives the algebra of functions on the zeros, of finite dimension D where these are finitely many; they
are told apart by one unknown (`univariate`). Of infinitely many those on which a denominator vanishes are taken out
(Rabinowitsch: d u = 1).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType

from sympy.polys.groebnertools import groebner
from sympy.polys.rings import PolyElement, PolyRing

from lagcli.statics import univariate
from lagcli.statics.polynomial_equations import RootUnknown
from lagcli.statics.univariate import Enclosure, NotCounted, RealRoot, Representation, Whole

Powers = tuple[int, ...]
Element = tuple[Whole, int]  # coefficients in the basis of an algebra, and their denominator


class AlgebraicZero:
    """One real zero: the zeros of its blocks together."""

    def __init__(self, parts: Sequence[_BlockZero]) -> None:
        self._parts = parts
        self._owner = {k: (part, i) for part in parts for i, k in enumerate(part.block.indices)}

    def value(self, unknown: int) -> float:
        """The nearest double."""
        if unknown not in self._owner:
            return 0.0
        part, i = self._owner[unknown]
        low, high = part.enclosure(i, 60)  # seven binary digits more than a double has
        try:
            return float((low + high) / 2)
        except OverflowError:
            raise NotCounted("their numbers are too large") from None

    def sign(self, polynomial: PolyElement, squares: Mapping[int, RootUnknown] = MappingProxyType({})) -> int:
        """The sign of a polynomial, exactly; squares: of roots that it may hold besides, by their numbers. Raises
        `NotCounted` where it is not decided."""
        indices = _indices(polynomial)
        parts = {id(part): part for part, _ in (self._owner[k] for k in indices if k in self._owner)}
        if len(parts) == 1 and indices <= self._owner.keys():
            (part,) = parts.values()
            return part.sign(polynomial)
        for digits in (64, 256, 1024):
            low, high = self._bounds(polynomial, squares, digits)
            if low > 0 or high < 0 or low == high:
                return (low > 0) - (high < 0)
        raise NotCounted("a sign is not decided exactly")

    def _enclosed(self, unknown: int, squares: Mapping[int, RootUnknown], digits: int) -> Enclosure:
        if unknown in self._owner:
            part, i = self._owner[unknown]
            return part.enclosure(i, digits)
        square = squares[unknown].square
        above, below = (self._bounds(part, squares, digits) for part in (square.above, square.below))
        if below[0] <= 0 <= below[1]:
            raise NotCounted("a root has no value at a zero")
        ends = [x / y for x in above for y in below]
        if max(ends) < 0:
            raise NotCounted("a root has no value at a zero")
        scale = 1 << 2 * digits
        low, high = (math.isqrt(max(0, math.floor(end * scale))) for end in (min(ends), max(ends)))
        return Fraction(low, 1 << digits), Fraction(high + 1, 1 << digits)

    def _bounds(self, polynomial: PolyElement, squares: Mapping[int, RootUnknown], digits: int) -> Enclosure:
        least = most = Fraction(0)
        for powers, factor in polynomial.terms() if polynomial else ():
            low = high = Fraction(int(factor.numerator), int(factor.denominator))
            for unknown, power in enumerate(powers):
                ends = self._enclosed(unknown, squares, digits) if power else (low, high)
                for _ in range(power):
                    products = [x * y for x in (low, high) for y in ends]
                    low, high = min(products), max(products)
            least, most = least + low, most + high
        return least, most


def zeros(
    ring: PolyRing,
    equations: Sequence[PolyElement],
    used: Sequence[int],
    denominators: Sequence[PolyElement] = (),
) -> list[AlgebraicZero]:
    """All real zeros of equations in the `used` unknowns at which no denominator vanishes. Raises `NotCounted`, and
    `SpentError` of the order of the ring."""
    found: list[tuple[_BlockZero, ...]] = [()]
    for indices, polynomials in _blocks(equations, used, denominators):
        if not indices:
            return []  # a constant is no zero
        own = [d for d in denominators if _indices(d) <= set(indices)]
        try:
            block = _ZeroBlock(ring, polynomials, indices)
        except Infinite:
            if not own:
                raise
            block = _ZeroBlock(ring, polynomials, indices, own)
        every = [_BlockZero(block, root) for root in block.roots]
        part = [zero for zero in every if all(zero.sign(d) for d in own)]
        if len(found) * len(part) > 4096:  # as many points of rest nobody reads
            raise NotCounted("there are too many of them")
        found = [(*before, one) for before in found for one in part]
    return [AlgebraicZero(parts) for parts in found]


def _indices(polynomial: PolyElement) -> frozenset[int]:
    return frozenset(k for m in polynomial.itermonoms() for k, power in enumerate(m) if power)


def _blocks(
    equations: Sequence[PolyElement], used: Sequence[int], denominators: Sequence[PolyElement]
) -> Iterator[tuple[Powers, list[PolyElement]]]:
    """Unknowns that hang together, with their equations: the zeros are all combinations of those of the blocks."""
    left = [(_indices(e), e) for e in equations]
    tied = [*(indices for indices, _ in left), *map(_indices, denominators)]
    waiting = set(used)
    for constant in (e for indices, e in left if not indices):
        yield (), [constant]
        return
    while waiting:
        block = {min(waiting)}
        while True:
            wider = block.union(*(indices for indices in tied if indices & block))
            if wider == block:
                break
            block = wider
        yield tuple(sorted(block)), [e for indices, e in left if indices & block]
        waiting -= block


class Infinite(NotCounted):
    """The zeros are infinitely many, in complex numbers at the least."""


class _ZeroBlock:
    """The zeros of the equations of some unknowns, saturated by denominators if there are any."""

    def __init__(
        self,
        ring: PolyRing,
        equations: Sequence[PolyElement],
        indices: Powers,
        denominators: Sequence[PolyElement] = (),
    ) -> None:
        self.indices = indices
        names = [str(ring.symbols[k]) for k in indices] + [f"u{k}" for k in range(len(denominators))]
        self._ring = PolyRing(names, ring.domain, ring.order)
        inverses = self._ring.gens[len(indices) :]
        own = [self.taken(e) for e in equations]
        own += [self.taken(d) * u - 1 for d, u in zip(denominators, inverses, strict=True)]
        basis = groebner(own, self._ring)
        self.roots: list[RealRoot] = []
        if any(e.is_ground for e in basis):
            return
        self._algebra = _QuotientAlgebra(self._ring, basis)
        self._representation = Representation(self._algebra.generators, self._algebra.traces)
        self.one = self._representation.one  # g_1
        self.roots = self._representation.roots()
        # g and a factor of each unknown: x_k is g/(factor g_1)
        own_rows = self._algebra.generators[: len(indices)]
        self.unknowns = [(self._representation.of(rows[0]), below) for rows, below in own_rows]

    def taken(self, polynomial: PolyElement) -> PolyElement:
        """A polynomial over the unknowns of this block."""
        more = (0,) * (len(self._ring.gens) - len(self.indices))
        terms = {(*(m[k] for k in self.indices), *more): factor for m, factor in polynomial.terms()}
        return self._ring.from_dict(terms)

    def function(self, polynomial: PolyElement) -> Whole:
        """g: the polynomial is g/(factor g_1) at each zero, with a factor that is positive."""
        coefficients, _ = self._algebra.reduced(self.taken(polynomial))
        return self._representation.of(coefficients)


class _BlockZero:
    """One zero of a block."""

    def __init__(self, block: _ZeroBlock, root: RealRoot) -> None:
        self.block, self._root = block, root
        self._known: dict[tuple[int, int], Enclosure] = {}

    def enclosure(self, index: int, digits: int) -> Enclosure:
        """Bounds of an unknown of the block. Raises `NotCounted`."""
        if (index, digits) not in self._known:
            g, factor = self.block.unknowns[index]
            self._known[index, digits] = self._root.enclosure(g, factor, digits)
        return self._known[index, digits]

    def sign(self, polynomial: PolyElement) -> int:
        """The sign of a polynomial in the unknowns of the block. Raises `NotCounted`."""
        return self._root.sign(self.block.function(polynomial)) * self._root.sign(self.block.one)


class _QuotientAlgebra:
    """The functions on the zeros: a basis of monomials, and the matrices of multiplication by the unknowns."""

    def __init__(self, ring: PolyRing, basis: Sequence[PolyElement]) -> None:
        self._ring, self._ideal = ring, list(basis)
        leading = [e.LM for e in basis]
        self.monomials = _standard(leading, len(ring.gens))
        self._index = {monomial: k for k, monomial in enumerate(self.monomials)}
        self.D = len(self.monomials)
        # Rows: x_k times each monomial of the basis, in the basis, over one denominator
        self.generators: list[tuple[list[Whole], int]] = []
        for k in range(len(ring.gens)):
            raised = (tuple(p + (i == k) for i, p in enumerate(m)) for m in self.monomials)
            rows = [self.reduced(ring.from_dict({m: ring.domain.one})) for m in raised]
            common = math.lcm(*(below for _, below in rows))
            self.generators.append(([[x * (common // below) for x in row] for row, below in rows], common))
        self._products: dict[Powers, Element] = {}
        # The traces of all products of two monomials of the basis, over one denominator
        sums = [[tuple(map(operator.add, a, b)) for b in self.monomials] for a in self.monomials]
        pairs = [[self._product(monomial) for monomial in row] for row in sums]
        single = [
            sum((Fraction(pairs[j][i][0][i], pairs[j][i][1]) for i in range(self.D)), Fraction(0))
            for j in range(self.D)
        ]
        below = math.lcm(*(x.denominator for x in single))
        whole = [x.numerator * (below // x.denominator) for x in single]
        traces = [
            [Fraction(univariate.dot(element, whole), below * denominator) for element, denominator in row]
            for row in pairs
        ]
        common = math.lcm(*(x.denominator for row in traces for x in row))
        self.traces = [[x.numerator * (common // x.denominator) for x in row] for row in traces], common

    def reduced(self, polynomial: PolyElement) -> Element:
        """A polynomial in the basis."""
        terms = polynomial.rem(self._ideal).terms() if polynomial else []
        below = math.lcm(*(int(factor.denominator) for powers, factor in terms))
        found = [0] * self.D
        for powers, factor in terms:
            if factor:
                found[self._index[powers]] = int(factor.numerator) * (below // int(factor.denominator))
        return found, below

    def _product(self, monomial: Powers) -> Element:
        """A monomial in the basis, by way of lower ones."""
        if monomial not in self._products:
            if monomial in self._index:
                self._products[monomial] = [int(m == monomial) for m in self.monomials], 1
            else:
                unknown = next(k for k, power in enumerate(monomial) if power)
                lower = tuple(power - (k == unknown) for k, power in enumerate(monomial))
                element, below = self._product(lower)
                rows, denominator = self.generators[unknown]
                found = univariate.combined(element, rows)
                common = math.gcd(below * denominator, *found)
                self._products[monomial] = [x // common for x in found], below * denominator // common
        return self._products[monomial]


def _standard(leading: Sequence[Powers], count: int) -> list[Powers]:
    """The monomials that no leading one divides, by degree. Raises `NotCounted` where they are too many."""
    for k in range(count):
        if not any(m[k] == sum(m) for m in leading):
            raise Infinite("they form a continuum")
    found, layer = [], [(0,) * count]
    while layer:
        found += layer
        if len(found) > 36:  # the cost grows with the fourth power
            raise NotCounted("there are too many of them")
        further = {tuple(p + (i == k) for i, p in enumerate(m)) for m in layer for k in range(count)}
        layer = sorted(m for m in further if not any(all(map(operator.le, one, m)) for one in leading))
    return found
