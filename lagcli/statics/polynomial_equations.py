"""Equations of a problem as polynomials with exact rational coefficients, where they are such.

Angles in sines and cosines alone become unknowns s, c with s^2 + c^2 = 1; a square root becomes w with w^2 = what it is
of. Decimals are taken as they are written; with a number of more digits than anybody writes nothing is exact.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from sympy.polys.domains import QQ
from sympy.polys.orderings import grevlex
from sympy.polys.rings import PolyElement, PolyRing

from lagcli.arrays import Floats
from lagcli.compiled.program import Program

# The total degree of a numerator or denominator.
DEGREE = 14


class NotPolynomial(Exception):
    """The equations are no polynomials with exact coefficients, or too large; the message says why."""


class SpentError(Exception):
    """The budget of operations is spent."""


class CountedOrder:
    """The order of monomials by degree, that ends a computation after so many comparisons, on every machine alike."""

    def __init__(self, budget: int) -> None:
        self.left = budget

    def __call__(self, monomial: tuple[int, ...]) -> object:
        self.left -= 1
        if self.left < 0:
            raise SpentError
        return grevlex(monomial)


@dataclasses.dataclass(frozen=True, slots=True)
class Quotient:
    """above/below, polynomials."""

    above: PolyElement
    below: PolyElement


@dataclasses.dataclass(frozen=True, slots=True)
class RootUnknown:
    """The square root of a quotient; is_unknown: it stands in the equations."""

    square: Quotient
    is_unknown: bool


@dataclasses.dataclass(frozen=True, slots=True)
class PolynomialEquations:
    """Polynomials that vanish, over the unknowns of `names`.

    plain: the unknowns that are q or lambda themselves, by their number among (q, lambda); angles: coordinates that are
    angles, by number, with their s and c; roots: unknowns that must be positive, with the squares they are roots of;
    denominators must not vanish. signs: quotients that are asked for their sign, with `divisors`, which have to differ
    from zero for them; a root that stands in them alone is no unknown of the equations.
    """

    ring: PolyRing
    names: tuple[str, ...]
    equations: tuple[PolyElement, ...]
    denominators: tuple[PolyElement, ...]
    angles: tuple[int, ...]
    roots: tuple[RootUnknown, ...]
    plain: int
    signs: tuple[Quotient, ...] = ()
    divisors: tuple[PolyElement, ...] = ()

    @property
    def used(self) -> tuple[int, ...]:
        """The unknowns of the equations, by number."""
        free = {k for k, root in self.squares.items() if not root.is_unknown}
        return tuple(k for k in range(len(self.names)) if k not in self.angles and k not in free)

    @property
    def squares(self) -> dict[int, RootUnknown]:
        """The roots by their numbers among the unknowns."""
        first = len(self.names) - len(self.roots)
        return {first + k: root for k, root in enumerate(self.roots)}

    @property
    def is_linear(self) -> bool:
        """True if all equations and signs have degree one, and nothing is divided by."""
        parts = [*self.equations, *(part for sign in self.signs for part in (sign.above, sign.below))]
        degree = max((sum(powers) for part in parts for powers in part.itermonoms()), default=0)
        return degree <= 1 and not self.denominators and not self.divisors and not self.roots

    def unknowns(self, values: Floats) -> Floats:
        """(q, lambda) from values of the polynomials' unknowns."""
        found = np.array(values[: self.plain])
        for k, angle in enumerate(self.angles):
            s, c = values[self.plain + 2 * k : self.plain + 2 * k + 2]
            found[angle] = math.atan2(s, c)
        return found


def exact(value: float) -> Fraction:
    """A number as it was written, with twelve digits or as a quotient. Raises `NotPolynomial` where nobody wrote it."""
    if math.isfinite(value):
        for number in (Fraction(f"{value:.11e}"), Fraction(value).limit_denominator(1000)):
            if abs(float(number) - value) <= 2 * math.ulp(value):  # what a sum of two is off
                return number
    raise NotPolynomial("it holds a number that is not exact")


def equations(
    program: Program,
    unknowns: int,
    parameters: Sequence[float],
    order: CountedOrder,
    asked: Program | None = None,
) -> PolynomialEquations:
    """A function of (unknowns, parameters) as polynomials, and one for signs. Raises `NotPolynomial`, `SpentError`."""
    programs = [program] if asked is None else [program, asked]
    steps = [step for each in programs for step in each.steps]
    # The unknowns on which arguments of sines and cosines depend
    angles: set[int] = set()
    for each in programs:
        depends: dict[int, frozenset[int]] = {}
        for name, out, ins, _ in each.steps:
            if name == "input":
                depends[out[0]] = frozenset([ins[1]]) if ins[0] == 0 else frozenset()
            elif name != "output":
                depends[out[0]] = frozenset().union(*(depends[i] for i in ins))
                angles |= depends[ins[0]] if name in ("sin", "cos", "tan") else frozenset()
    names = [f"x{k}" for k in range(unknowns)] + [f"{letter}{k}" for k in sorted(angles) for letter in "sc"]
    first_root = len(names)
    names += [f"w{k}" for k in range(sum(step[0] in ("sqrt", "pow", "constpow") for step in steps))]
    ring = PolyRing(names, QQ, order)
    translation = _Translation(ring, unknowns, tuple(sorted(angles)))
    occurring = {ins[1] for name, _, ins, _ in steps if name == "input" and ins[0] == 1}
    numbers = [translation.number(x if k in occurring else 0.0) for k, x in enumerate(parameters)]
    inputs = [[Quotient(x, ring.one) for x in ring.gens[:unknowns]], numbers]
    found, signs = program.run(inputs, translation.number, translation.operation), list[Quotient]()
    if asked is not None:
        translation.is_of_equations = False
        signs = asked.run(inputs, translation.number, translation.operation)
    zeros = [value.above for value in found]
    for k in range(unknowns, first_root, 2):
        s, c = ring.gens[k : k + 2]
        zeros.append(s**2 + c**2 - 1)
    for k, root in enumerate(translation.roots):
        if root.is_unknown:
            zeros.append(ring.gens[first_root + k] ** 2 * root.square.below - root.square.above)
    # An angle stands in sines and cosines alone, or there are no polynomials.
    everything = [*zeros, *(part for sign in signs for part in (sign.above, sign.below))]
    for angle in angles:
        if any(powers[angle] for part in everything for powers in part.itermonoms()):
            raise NotPolynomial("an angle stands beside its own sine")
    return PolynomialEquations(
        ring,
        tuple(names[: first_root + len(translation.roots)]),
        tuple(zero for zero in zeros if zero),
        tuple(dict.fromkeys(d for d in translation.denominators if not d.is_ground)),
        tuple(sorted(angles)),
        tuple(translation.roots),
        unknowns,
        tuple(signs),
        tuple(dict.fromkeys(d for d in translation.divisors if not d.is_ground)),
    )


class _Translation:
    """Operations in quotients of polynomials, with their roots, denominators, and divisors of what is asked for."""

    def __init__(self, ring: PolyRing, unknowns: int, angles: tuple[int, ...]) -> None:
        self._ring, self._one = ring, ring.one
        self._count, self._angles = unknowns, angles
        self.is_of_equations = True
        self.roots: list[RootUnknown] = []
        self.denominators: list[PolyElement] = []
        self.divisors: list[PolyElement] = []

    def number(self, value: float) -> Quotient:
        """A number that somebody wrote."""
        found = exact(value)
        return Quotient(self._ring.ground_new(QQ(found.numerator, found.denominator)), self._one)

    def operation(self, name: str, a: Quotient, *further: Quotient) -> Quotient:
        """The result of an operation."""
        b = further[-1] if further else a
        match name:
            case "add" | "sub":
                sign = 1 if name == "add" else -1
                if a.below == b.below:
                    return self._quotient(a.above + sign * b.above, a.below)
                return self._quotient(a.above * b.below + sign * b.above * a.below, a.below * b.below)
            case "mul" | "sq":
                return self._quotient(a.above * b.above, a.below * b.below)
            case "neg":
                return Quotient(-a.above, a.below)
            case "twice":
                return Quotient(2 * a.above, a.below)
            case "assign":
                return a
            case "div":
                return self._divided(a, b)
            case "inv":
                return self._divided(Quotient(self._one, self._one), a)
            case "sqrt":
                return self._root(a)
            case "sin" | "cos" | "tan":
                return self._turned(name, a)
            case "pow" | "constpow":
                return self._power(a, b)
        raise NotPolynomial(f"it holds `{name}`")

    def _quotient(self, above: PolyElement, below: PolyElement) -> Quotient:
        for part in (above, below):
            degree = max(map(sum, part.itermonoms()), default=0)
            if len(part) > 400 or degree > DEGREE:  # a basis of larger ones takes minutes
                raise NotPolynomial("its polynomials are too large")
        if below.is_ground:
            return Quotient(above * (1 / QQ.convert(below.LC)), self._one)
        if above == 0:
            return Quotient(above, self._one)
        above, below = above.cancel(below)
        return Quotient(above, below)

    def _divided(self, a: Quotient, b: Quotient) -> Quotient:
        if b.above == 0:
            raise NotPolynomial("it divides by zero")
        (self.denominators if self.is_of_equations else self.divisors).append(b.above)
        return self._quotient(a.above * b.below, a.below * b.above)

    def _power(self, a: Quotient, exponent: Quotient) -> Quotient:
        if not (exponent.above.is_ground and exponent.below.is_ground):
            raise NotPolynomial("it holds a power with a variable exponent")
        number = Fraction(str(QQ.convert(exponent.above.LC))) if exponent.above else Fraction(0)
        if number.denominator == 2:
            whole = Quotient(self._ring.ground_new(QQ(number.numerator)), self._one)
            return self._power(self._root(a), whole)
        if number.denominator != 1 or abs(number) > DEGREE:
            raise NotPolynomial("it holds a power that is not whole")
        integer = int(number)
        if integer < 0:
            inverse = self._power(a, Quotient(-exponent.above, self._one))
            return self._divided(Quotient(self._one, self._one), inverse)
        return self._quotient(a.above**integer, a.below**integer)

    def _root(self, a: Quotient) -> Quotient:
        if a.above.is_ground and a.below.is_ground:
            value = Fraction(str(QQ.convert(a.above.LC))) if a.above else Fraction(0)
            root = Fraction(math.isqrt(max(0, value.numerator)), math.isqrt(value.denominator))
            if value < 0 or root * root != value:
                raise NotPolynomial("it holds a root that is not rational")
            return Quotient(self._ring.ground_new(QQ(root.numerator, root.denominator)), self._one)
        known = next((k for k, root in enumerate(self.roots) if root.square == a), None)
        if known is None:
            known = len(self.roots)
            self.roots.append(RootUnknown(a, self.is_of_equations))
        elif self.is_of_equations and not self.roots[known].is_unknown:
            self.roots[known] = RootUnknown(a, True)
        if self.is_of_equations:
            # Where the root vanishes its derivative has no value.
            self.denominators.append(a.above)
        return Quotient(self._ring.gens[self._count + 2 * len(self._angles) + known], self._one)

    def _turned(self, name: str, a: Quotient) -> Quotient:
        """The sine or cosine of a sum of whole multiples of angles."""
        if not a.below.is_ground:
            raise NotPolynomial("it holds a sine of a quotient")
        s, c = self._ring.zero, self._one
        for powers, factor in (a.above * (1 / QQ.convert(a.below.LC))).terms():
            turns = Fraction(str(factor))
            if sum(powers) != 1 or turns.denominator != 1 or abs(turns) > 6:
                raise NotPolynomial("it holds a sine of something else than whole angles")
            angle = powers.index(1)
            if angle not in self._angles:
                raise NotPolynomial("it holds a sine of something else than an angle")
            k = self._count + 2 * self._angles.index(angle)
            one_s, one_c = self._ring.gens[k] * (1 if turns > 0 else -1), self._ring.gens[k + 1]
            for _ in range(abs(int(turns))):
                s, c = s * one_c + c * one_s, c * one_c - s * one_s
        if name == "tan":
            return self._divided(Quotient(s, self._one), Quotient(c, self._one))
        return self._quotient(s if name == "sin" else c, self._one)
