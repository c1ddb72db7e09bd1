"""The identity (D.31) for one model: sum_k m_k a_k . dr_k/dq_j = d/dt dT/dq'_j - dT/dq_j, proved or tried.

The left side comes from x_n(q, t) differentiated twice, the right side from the T that is printed.
"""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Iterator

import sympy

from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.pfaffian.forms.notation import ZERO

# Above this many operations the identity is not expanded but tried with numbers.
MAX_OPERATIONS = 1500
POINTS, DIGITS = 2, 30
AGREED = sympy.Float("1e-20", DIGITS)


@dataclasses.dataclass(frozen=True, slots=True)
class IdentityVerdict:
    """For coordinate number `coordinate`: whether the identity `holds`, and how that is known."""

    coordinate: int
    holds: bool
    method: str


def verify(system: Symbolic) -> Iterator[IdentityVerdict]:
    """The identity for every generalized coordinate that dependent particles move with."""
    left: dict[int, sympy.Expr] = {}
    for number in range(len(system.table.particles)):
        if system.table.is_dependent(number):
            for j, term in _of_particle(system, number):
                left[j] = left.get(j, ZERO) + term
    for j in sorted(left):
        difference = system.table.calculus.expanded(left[j] - _of_energy(system, j))
        if difference.count_ops() <= MAX_OPERATIONS:
            # As exponentials multiplied out; no answer counts as no
            waves = (
                difference.rewrite(sympy.exp)
                if difference.has(sympy.sin, sympy.cos, sympy.tan)
                else difference
            )
            is_zero = sympy.expand(difference) == 0
            if is_zero or sympy.expand(sympy.powsimp(sympy.expand(waves))) == 0:
                yield IdentityVerdict(j, True, "identically")
                continue
        holds = _agrees(system, j, left[j])
        yield IdentityVerdict(j, holds, f"at {POINTS} random points, to 20 digits")


def _of_particle(system: Symbolic, number: int) -> Iterator[tuple[int, sympy.Expr]]:
    """m a . dr/dq_j of one particle."""
    calculus, table = system.table.calculus, system.table
    position = table.position(number)
    acceleration = [_rate(system, part) for part in table.velocity(number)]
    present = frozenset().union(*(calculus.symbols(part) for part in position))
    for j, q in enumerate(system.q):
        if q in present:
            slopes = (calculus.partial(part, q) for part in position)
            work = sum((a * slope for a, slope in zip(acceleration, slopes, strict=True)), ZERO)
            yield j, table.mass(number) * work


def _rate(system: Symbolic, value: sympy.Expr) -> sympy.Expr:
    """d/dt of a function of coordinates, rates and time, along the accelerations."""
    calculus, total = system.table.calculus, system.table.calculus.rate(value)
    present = calculus.symbols(value)
    for v, a in zip(system.v, system.a, strict=True):
        if v in present:
            total += calculus.partial(value, v) * a
    return total


def _of_energy(system: Symbolic, j: int) -> sympy.Expr:
    """d/dt dT/dq'_j - dT/dq_j, of T as it is printed."""
    calculus, T = system.table.calculus, system.general
    return _rate(system, calculus.partial(T, system.v[j])) - calculus.partial(T, system.q[j])


def _agrees(system: Symbolic, j: int, left: sympy.Expr) -> bool:
    """True if both sides are the same numbers at random points."""
    source = random.Random(20060311)
    calculus = system.table.calculus
    one, other = calculus.expanded(left), calculus.expanded(_of_energy(system, j))
    symbols = sorted(one.free_symbols | other.free_symbols, key=str)
    for _ in range(POINTS):
        point = {s: sympy.Rational(source.randint(200, 1800), 1000) for s in symbols}
        a, b = (sympy.N(side.xreplace(point), DIGITS) for side in (one, other))
        if not (a.is_number and b.is_number) or abs(a - b) > AGREED * (1 + abs(a)):
            return False
    return True
