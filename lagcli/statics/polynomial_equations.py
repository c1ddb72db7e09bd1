"""Equations of a problem as polynomials with exact rational coefficients, where they are such.

Angles that occur in sines and cosines alone become two unknowns s, c with s^2 + c^2 = 1; a square root becomes an
unknown w with w^2 = what it is of. Decimals of a model are taken as they are written: a number with more digits than
anybody writes is none, and the equations are not exact then.
"""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from sympy.polys.domains import QQ
from sympy.polys.orderings import grevlex
from sympy.polys.rings import PolyElement, PolyRing

from lagcli.compiled.program import Program

Floats = npt.NDArray[np.float64]


class PolynomialParameters:
    """Sizes of polynomials. The tests are of `tests/unit/test_numbers_of_statics.py`."""

    __slots__ = ()

    written_digits: int = 12
    """Digits of a number that somebody wrote: 0.1 is 1/10.
    At 1 and at 120 `test_twelve_digits_are_written_and_thirteen_are_not` fails."""
    roundings: int = 2
    """Units of the last digit by which a number may differ from these digits: what a sum of two is off.
    At 20 `test_a_rounding_of_a_sum_is_forgiven_and_four_are_not` fails."""
    most_divisor: int = 1000
    """Divisor of a quotient that somebody wrote: 0.333... is 1/3.
    At 100 and 10 000 `test_quotients_are_exact_up_to_a_thousand` fails."""
    most_terms: int = 400
    """Terms of a numerator or denominator: a basis of larger ones takes minutes.
    At 40 and 4000 `test_polynomials_have_degree_fourteen_and_four_hundred_terms_at_most` fails."""
    most_degree: int = 14
    """Their total degree. `test_polynomials_have_degree_fourteen_and_four_hundred_terms_at_most` fails at 1 and 140."""
    most_turns: int = 6
    """Whole multiples of an angle, each of which raises the degree.
    At 1 and at 60 `test_six_turns_of_an_angle_are_a_polynomial_and_seven_are_not` fails."""


PARAMETERS = PolynomialParameters()


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
        first = len(self.names) - len(self.roots)
        free = {first + k for k, root in enumerate(self.roots) if not root.is_unknown}
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


def equations(
    program: Program, unknowns: int, parameters: Floats, order: CountedOrder, signs: int = 0
) -> PolynomialEquations:
    """The first output of a function of (unknowns, parameters) as polynomials; its last values are no equations, but
    asked for their signs. Raises `NotPolynomial`, `SpentError`."""
    return _Translation(program, unknowns, parameters, order).result(program.results - signs)


def exact(value: float) -> Fraction:
    """A number as it was written, or computed of such numbers. Raises `NotPolynomial` for one that nobody wrote."""
    text = f"{value:.{PARAMETERS.written_digits - 1}e}"
    if math.isfinite(value):
        for number in (Fraction(text), Fraction(value).limit_denominator(PARAMETERS.most_divisor)):
            if abs(float(number) - value) <= PARAMETERS.roundings * math.ulp(value):
                return number
    raise NotPolynomial("it holds a number that is not exact")


class _Translation:
    """One program, its operations carried out in quotients of polynomials."""

    def __init__(self, program: Program, unknowns: int, parameters: Floats, order: CountedOrder) -> None:
        self._program, self._count, self._parameters = program, unknowns, parameters
        # The inputs on which arguments of sines and cosines depend
        depends: dict[int, frozenset[int]] = {}
        angles: set[int] = set()
        for name, out, ins, _ in program.steps:
            if name == "input":
                depends[out[0]] = frozenset([ins[1]]) if ins[0] == 0 else frozenset()
            elif name != "output":
                depends[out[0]] = frozenset().union(*(depends.get(i, frozenset()) for i in ins))
                if name in ("sin", "cos", "tan"):
                    angles |= depends[ins[0]]
        self._angles = tuple(sorted(angles))
        roots = sum(step[0] in ("sqrt", "pow", "constpow") for step in program.steps)
        names = [f"x{k}" for k in range(unknowns)]
        names += [f"{letter}{k}" for k in self._angles for letter in "sc"]
        self._first_root = len(names)
        names += [f"w{k}" for k in range(roots)]
        self._ring = PolyRing(names, QQ, order)
        self._one = self._ring.one
        self._is_of_equations = True
        self._roots: list[RootUnknown] = []
        self._denominators: list[PolyElement] = []
        self._divisors: list[PolyElement] = []

    def result(self, count: int) -> PolynomialEquations:
        """The first outputs as equations, the others as signs."""
        # For each step whether one of the equations needs it, from the last step on
        needed: set[int] = set()
        of_equations: list[bool] = []
        for name, out, ins, _ in reversed(self._program.steps):
            if name == "output":
                is_needed = out[0] == 0 and out[1] < count
            else:
                is_needed = out[0] in needed
                needed.discard(out[0])
            of_equations.append(is_needed)
            if is_needed and name not in ("input", "const"):
                needed.update(ins)
        registers: dict[int, Quotient] = {}
        outputs: dict[int, Quotient] = {}
        for name, out, ins, value in self._program.steps:
            self._is_of_equations = of_equations.pop()
            if name == "output":
                if out[0] == 0:
                    outputs[out[1]] = registers[ins[0]]
            elif name == "input" and ins[0] == 0:
                registers[out[0]] = Quotient(self._ring.gens[ins[1]], self._one)
            elif name == "input":
                registers[out[0]] = self._number(float(self._parameters[ins[1]]))
            elif name == "const":
                registers[out[0]] = self._number(value)
            else:
                registers[out[0]] = self._operation(name, [registers[i] for i in ins])
        zeros = [outputs[k].above for k in range(count)]
        gens = self._ring.gens
        for k in range(len(self._angles)):
            s, c = gens[self._count + 2 * k : self._count + 2 * k + 2]
            zeros.append(s**2 + c**2 - 1)
        for k, root in enumerate(self._roots):
            if root.is_unknown:
                zeros.append(gens[self._first_root + k] ** 2 * root.square.below - root.square.above)
        signs = tuple(outputs[k] for k in range(count, len(outputs)))
        # An angle stands in sines and cosines alone, or there are no polynomials.
        everything = [*zeros, *(part for sign in signs for part in (sign.above, sign.below))]
        for angle in self._angles:
            if any(powers[angle] for part in everything for powers in part.itermonoms()):
                raise NotPolynomial("an angle stands beside its own sine")
        return PolynomialEquations(
            self._ring,
            tuple(map(str, self._ring.symbols))[: self._first_root + len(self._roots)],
            tuple(zero for zero in zeros if zero),
            tuple(dict.fromkeys(d for d in self._denominators if not d.is_ground)),
            self._angles,
            tuple(self._roots),
            self._count,
            signs,
            tuple(dict.fromkeys(d for d in self._divisors if not d.is_ground)),
        )

    def _number(self, value: float) -> Quotient:
        found = exact(value)
        return Quotient(self._ring.ground_new(QQ(found.numerator, found.denominator)), self._one)

    def _operation(self, name: str, given: list[Quotient]) -> Quotient:
        a, b = given[0], given[-1]
        match name:
            case "add" | "sub":
                sign = 1 if name == "add" else -1
                if a.below == b.below:
                    return self._quotient(a.above + sign * b.above, a.below)
                return self._quotient(a.above * b.below + sign * b.above * a.below, a.below * b.below)
            case "mul":
                return self._quotient(a.above * b.above, a.below * b.below)
            case "neg":
                return Quotient(-a.above, a.below)
            case "sq":
                return self._quotient(a.above**2, a.below**2)
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
            if len(part) > PARAMETERS.most_terms or degree > PARAMETERS.most_degree:
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
        (self._denominators if self._is_of_equations else self._divisors).append(b.above)
        return self._quotient(a.above * b.below, a.below * b.above)

    def _power(self, a: Quotient, exponent: Quotient) -> Quotient:
        if not (exponent.above.is_ground and exponent.below.is_ground):
            raise NotPolynomial("it holds a power with a variable exponent")
        number = Fraction(str(QQ.convert(exponent.above.LC))) if exponent.above else Fraction(0)
        if number.denominator == 2:
            whole = Quotient(self._ring.ground_new(QQ(number.numerator)), self._one)
            return self._power(self._root(a), whole)
        if number.denominator != 1 or abs(number) > PARAMETERS.most_degree:
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
        known = next((k for k, root in enumerate(self._roots) if root.square == a), None)
        if known is None:
            known = len(self._roots)
            self._roots.append(RootUnknown(a, self._is_of_equations))
        elif self._is_of_equations and not self._roots[known].is_unknown:
            self._roots[known] = RootUnknown(a, True)
        if self._is_of_equations:
            # Where the root vanishes its derivative has no value.
            self._denominators.append(a.above)
        return Quotient(self._ring.gens[self._first_root + known], self._one)

    def _turned(self, name: str, a: Quotient) -> Quotient:
        """The sine or cosine of a sum of whole multiples of angles."""
        if not a.below.is_ground:
            raise NotPolynomial("it holds a sine of a quotient")
        s, c = self._ring.zero, self._one
        for powers, factor in (a.above * (1 / QQ.convert(a.below.LC))).terms():
            turns = Fraction(str(factor))
            if sum(powers) != 1 or turns.denominator != 1 or abs(turns) > PARAMETERS.most_turns:
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
