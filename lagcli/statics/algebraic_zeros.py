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
from lagcli.statics.univariate import Enclosure, NotCounted, RealRoot, Representation, Rows, Whole

Powers = tuple[int, ...]
Element = tuple[Whole, int]  # coefficients in the basis of an algebra, and their denominator


class AlgebraicZero:
    """One real zero: a root of each block of unknowns."""

    def __init__(self, parts: Sequence[tuple[_ZeroBlock, RealRoot]]) -> None:
        self._owner = {k: (*part, i) for part in parts for i, k in enumerate(part[0].indices)}

    def value(self, unknown: int) -> float:
        """The nearest double."""
        if unknown not in self._owner:
            return 0.0
        block, root, i = self._owner[unknown]
        low, high = block.enclosure(root, i, 60)  # seven binary digits more than a double has
        try:
            return float((low + high) / 2)
        except OverflowError:
            raise NotCounted("their numbers are too large") from None

    def sign(self, polynomial: PolyElement, squares: Mapping[int, RootUnknown] = MappingProxyType({})) -> int:
        """The sign of a polynomial, exactly; squares: of roots that it may hold besides, by their numbers. Raises
        `NotCounted` where it is not decided."""
        indices = _indices(polynomial)
        parts = {self._owner[k][:2] for k in indices if k in self._owner}
        if len(parts) == 1 and indices <= self._owner.keys():
            ((block, root),) = parts
            return block.sign(root, polynomial)
        for digits in (64, 256, 1024):
            low, high = self._bounds(polynomial, squares, digits)
            if low > 0 or high < 0 or low == high:
                return (low > 0) - (high < 0)
        raise NotCounted("a sign is not decided exactly")

    def _enclosed(self, unknown: int, squares: Mapping[int, RootUnknown], digits: int) -> Enclosure:
        if unknown in self._owner:
            block, root, i = self._owner[unknown]
            return block.enclosure(root, i, digits)
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
    """All real zeros in `used` unknowns where no denominator vanishes. Raises `NotCounted`, `SpentError`."""
    found: list[tuple[tuple[_ZeroBlock, RealRoot], ...]] = [()]
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
        part = [(block, root) for root in block.roots if all(block.sign(root, d) for d in own)]
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
    """The zeros of the equations of some unknowns, saturated by denominators if there are any: with the algebra of the
    functions on them, a basis of monomials and the matrices of multiplication by the unknowns."""

    def __init__(
        self,
        ring: PolyRing,
        equations: Sequence[PolyElement],
        indices: Powers,
        denominators: Sequence[PolyElement] = (),
    ) -> None:
        self.indices = indices
        self._known: dict[tuple[RealRoot, int, int], Enclosure] = {}
        names = [str(ring.symbols[k]) for k in indices] + [f"u{k}" for k in range(len(denominators))]
        self._ring = ring = PolyRing(names, ring.domain, ring.order)
        own = [self._taken(e) for e in equations]
        inverses = ring.gens[len(indices) :]
        own += [self._taken(d) * u - 1 for d, u in zip(denominators, inverses, strict=True)]
        self._ideal = groebner(own, ring)
        self.roots: list[RealRoot] = []
        if any(e.is_ground for e in self._ideal):
            return
        monomials = _standard([e.LM for e in self._ideal], len(ring.gens))
        self._index = {monomial: k for k, monomial in enumerate(monomials)}
        # Rows: x_k times each monomial of the basis, in the basis, over one denominator
        self._generators: list[Rows] = []
        for k in range(len(ring.gens)):
            raised = (tuple(p + (i == k) for i, p in enumerate(m)) for m in monomials)
            rows = [self._reduced(ring.from_dict({m: ring.domain.one})) for m in raised]
            common = math.lcm(*(below for _, below in rows))
            self._generators.append(([[x * (common // below) for x in row] for row, below in rows], common))
        self._products: dict[Powers, Element] = {}
        # The traces of all products of two monomials of the basis, over one denominator
        sums = [[tuple(map(operator.add, a, b)) for b in monomials] for a in monomials]
        pairs = [[self._product(monomial) for monomial in row] for row in sums]
        single = [
            sum((Fraction(row[j][0][i], row[j][1]) for i, row in enumerate(pairs)), Fraction(0))
            for j in range(len(pairs))
        ]
        below = math.lcm(*(x.denominator for x in single))
        whole = [x.numerator * (below // x.denominator) for x in single]
        traces = [
            [Fraction(univariate.dot(element, whole), below * denominator) for element, denominator in row]
            for row in pairs
        ]
        common = math.lcm(*(x.denominator for row in traces for x in row))
        whole_traces = [[x.numerator * (common // x.denominator) for x in row] for row in traces]
        self._representation = Representation(self._generators, (whole_traces, common))
        self.roots = self._representation.roots()

    def _taken(self, polynomial: PolyElement) -> PolyElement:
        """A polynomial over the unknowns of this block."""
        more = (0,) * (len(self._ring.gens) - len(self.indices))
        terms = {(*(m[k] for k in self.indices), *more): factor for m, factor in polynomial.terms()}
        return self._ring.from_dict(terms)

    def _reduced(self, polynomial: PolyElement) -> Element:
        """A polynomial in the basis."""
        terms = polynomial.rem(self._ideal).terms() if polynomial else []
        below = math.lcm(*(int(factor.denominator) for powers, factor in terms))
        found = [0] * len(self._index)
        for powers, factor in terms:
            if factor:
                found[self._index[powers]] = int(factor.numerator) * (below // int(factor.denominator))
        return found, below

    def _product(self, monomial: Powers) -> Element:
        """A monomial in the basis, by way of lower ones."""
        if monomial in self._index:
            return [int(m == monomial) for m in self._index], 1
        if monomial not in self._products:
            unknown = next(k for k, power in enumerate(monomial) if power)
            lower = tuple(power - (k == unknown) for k, power in enumerate(monomial))
            element, below = self._product(lower)
            rows, denominator = self._generators[unknown]
            found = univariate.combined(element, rows)
            common = math.gcd(below * denominator, *found)
            self._products[monomial] = [x // common for x in found], below * denominator // common
        return self._products[monomial]

    def enclosure(self, root: RealRoot, index: int, digits: int) -> Enclosure:
        """Bounds of an unknown of the block at a zero. Raises `NotCounted`."""
        key = root, index, digits
        if key not in self._known:
            # x_k is g/(factor g_1), with its row of the products with 1
            rows, factor = self._generators[index]
            self._known[key] = root.enclosure(self._representation.of(rows[0]), factor, digits)
        return self._known[key]

    def sign(self, root: RealRoot, polynomial: PolyElement) -> int:
        """The sign of a polynomial in the unknowns of the block at a zero. Raises `NotCounted`."""
        # It is g/(factor g_1) at each zero, with a factor that is positive.
        g = self._representation.of(self._reduced(self._taken(polynomial))[0])
        return root.sign(g) * root.sign(self._representation.one)


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
