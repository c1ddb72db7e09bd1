"""A zero of the equations of rest in many digits: where curvatures vanish doubles tell it to a part of theirs.

Newton's steps come nearer by a part of the way there, and forces vanish with its powers: three hundred digits hold what
is left of them where the point has twenty. Numbers are taken as they are written.
"""

from __future__ import annotations

import decimal
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np

from lagcli import doubles, memory
from lagcli.arrays import Floats
from lagcli.compiled import multiprecision
from lagcli.compiled.program import Program
from lagcli.linear import decompositions, surface
from lagcli.linear.surface import Point
from lagcli.start import precise_rows
from lagcli.statics import polynomial_equations, rest_equations
from lagcli.statics.rest_equations import LENGTHS, RestEquations
from lagcli.statics.static_problem import StaticProblem

Numbers = list[Decimal]
ZERO = Decimal(0)


# The arithmetic of zeros, and that in which signs of curvatures are looked for, of which twenty digits are rounding: no
# zero has to be found there that is degenerate.
ZEROS, SIGNS = decimal.Context(prec=300), decimal.Context(prec=60)
ARRIVED = Decimal("1e-20")  # the last step, as a part of the size of things: a double has sixteen digits


def is_doubtful(equations: RestEquations, x: Floats) -> bool:
    """True if gradients may be dependent, or vanish, at a zero near x."""
    found = equations(x)
    if found is None:
        return False
    widths, n = np.linalg.norm(found[1], axis=0), equations.problem.n
    widths[:n] = np.maximum(widths[:n], 1 / equations.scales.length)  # forces are measured by their unit
    sizes = decompositions.singular_values(found[1] / np.where(widths > 0, widths, 1.0))
    return bool(sizes.size and sizes[-1] <= rest_equations.SMALL * max(1.0, sizes[0]))


def known(equations: RestEquations, x: Floats) -> Program | None:
    """The equations with their gradient, where they have many digits: they are few, for the cost grows with the cube of
    their number, and hold no t and no function that is not known in them."""
    if len(equations.problem.times) > 1 or x.size > 12 or equations.closed is None:
        return None
    program = equations.problem.precise_program(equations.closed)
    return program if _has_digits(program) else None


def _has_digits(program: Program) -> bool:
    try:
        multiprecision.require_known(program)
    except multiprecision.Unknown:
        return False
    return True


def nearest(equations: RestEquations, x: Floats) -> Floats | None:
    """The zero (k,) of the equations that Newton's steps from x come to, as doubles; None where they come to none near
    by, and where the equations are large, hold t or a function that is not known in many digits."""
    problem, length, program = equations.problem, equations.scales.length, known(equations, x)
    found = None if program is None else _approached(problem, program, x, length)
    if found is None:
        return None
    # What is below the rounding of lengths is zero.
    n = problem.n
    found[:n] = np.where(np.abs(found[:n]) <= doubles.EPS * length, 0.0, found[:n])
    # A point that is right to rounding, its multipliers too, stays where doubles balance.
    moved = np.abs(found - x)
    is_rounding = moved[:n].max(initial=0.0) <= 8 * doubles.EPS * length
    is_rounding &= moved[n:].max(initial=0.0) <= rest_equations.SMALL * np.abs(x[n:]).max(initial=0.0)
    return x if is_rounding else found


def is_met(problem: StaticProblem, q: Floats, length: float) -> bool:
    """True if all conditions are zero together at or near q (n,), or have no functions known in many digits."""
    program = problem.with_gradient(problem.laws.c)
    return not _has_digits(program) or _approached(problem, program, q, length) is not None


def _approached(problem: StaticProblem, program: Program, x: Floats, length: float) -> Floats | None:
    """The zero (k,) near x of the values of a program, with their gradients behind them; None where none is met."""
    with decimal.localcontext(ZEROS):
        at = _AtPoint(problem, program, x, length, ARRIVED)
        # At a power of twelve each step leaves ten elevenths of the way.
        end = surface.approach(at, at.begun, steps=1000)
        arrived = None if end is None else at(end.x)
        if end is None or arrived is None or not arrived.is_there:
            return None
        return end.x.astype(float)


def value(problem: StaticProblem, q: Floats) -> float:
    """The value at a place (n,), of which cancelling leaves all digits that are known; nan where there is none."""
    if not _has_digits(problem.value_program):
        return problem.value(q)
    with decimal.localcontext(SIGNS):
        given = [multiprecision.decimal_of(x) for x in q.tolist()]
        numbers = [number(x) for x in (problem.t, *problem.p.tolist())]
        try:
            return float(multiprecision.run(problem.value_program, [given, numbers], number)[0])
        except multiprecision.NotFinite:
            return np.nan


def led_to(equations: RestEquations, program: Program, x: Floats) -> Floats | None:
    """x (k,), or where Newton's first step in many digits leaves its neighbourhood the zero it leads to, or None:
    beside terms of 1e14, and along a direction that is hardly held, doubles see no force where no zero is near."""
    with decimal.localcontext(SIGNS):
        at = _AtPoint(equations.problem, program, x, equations.scales.length, _rounding(), math.inf)
        begun = at(at.begun)
        if begun is None or begun.distance <= LENGTHS.near:
            return x
        end = surface.approach(at, at.begun)
        return end.x.astype(float) if end is not None and end.is_met else None


def signs(equations: RestEquations, x: Floats) -> tuple[int, int, int] | None:
    """How many curvatures of the function, on what rows and closed contacts leave at the zero next to x, are positive,
    negative and zero. None where Newton's steps do not square their length, as beside a zero that is degenerate, or
    where a number of the equations is not exact: a curvature might be its rounding."""
    n, problem, program = equations.problem.n, equations.problem, known(equations, x)
    if program is None:
        return None
    constants = (step[-1] for step in program.steps if step[0] == "const")
    if any(_written(value) is None for value in (problem.t, *problem.p.tolist(), *constants)):
        return None
    with decimal.localcontext(SIGNS):
        at = _AtPoint(problem, program, x, equations.scales.length, _rounding())
        end = surface.approach(at, at.begun)
        there = at(end.x) if end is not None and end.is_met else None
        if there is None:
            return None
        # Vectors that span what rows leave, and the curvatures along them
        K, rows = there.gradients[:n, :n], there.gradients[n:, :n]
        done, _ = precise_rows.eliminated(rows.tolist(), n, _largest(rows) * _rounding())
        taken = {j for j, _ in done}
        units = [[Decimal(i == j) for i in range(n)] for j in range(n) if j not in taken]
        free = np.array([_with_pivots(done, unit, [ZERO] * len(done)) for unit in units], dtype=object)
        H = -free @ K @ free.T if units else np.zeros((0, 0), dtype=object)
        up = down = 0
        while (largest := _largest(H)) > _largest(K) * _rounding():
            i = int(np.argmax(np.abs(H.diagonal())))
            if abs(H[i, i]) < largest:  # along x_i = +-x_j, one of the two, there is more
                i, j = divmod(int(np.argmax(np.abs(H))), len(H))
                sign = 1 if (H[i, i] + H[j, j]) * H[i, j] >= 0 else -1
                H[i] += sign * H[j]
                H[:, i] += sign * H[:, j]
            up, down = up + (H[i, i] > 0), down + (H[i, i] < 0)
            others = np.arange(len(H)) != i
            H = (H - np.outer(H[:, i], H[i]) / H[i, i])[others][:, others]
        return up, down, len(H)


class _AtPoint:
    """A program, values and their gradients, at a point (k,) of `Decimal`; None without values and far from x."""

    def __init__(
        self,
        problem: StaticProblem,
        program: Program,
        x: Floats,
        length: float,
        arrived: Decimal,
        far: float = LENGTHS.stride,
    ) -> None:
        self._program, self._n = program, problem.n
        self._numbers = [number(value) for value in (problem.t, *problem.p.tolist())]
        self._length, self._arrived, self._most = Decimal(length), arrived, Decimal(far) * Decimal(length)
        self._count = program.results // (x.size + 1)
        self.begun = np.array([multiprecision.decimal_of(value) for value in x.tolist()])

    def __call__(self, x: Point) -> _InDigits | None:
        way = max(map(abs, x[: self._n] - self.begun[: self._n]))
        if way > self._most:
            return None  # along a tail steps go on for ever
        try:
            values = multiprecision.run(self._program, [list(x), self._numbers], number)
        except multiprecision.NotFinite:
            return None
        gradients = np.array(values[self._count :], dtype=object).reshape(-1, self._count).T
        return _InDigits(values[: self._count], gradients, self._length, self._arrived)


def number(value: float) -> Decimal:
    """A number as it was written, or the quotient that was, in the digits of the context."""
    written = _written(value)
    if written is None:
        return multiprecision.decimal_of(value)
    return Decimal(written.numerator) / Decimal(written.denominator)


@memory.remembered(4096)
def _written(value: float) -> Fraction | None:
    try:
        return polynomial_equations.exact(value)
    except polynomial_equations.NotPolynomial:
        return None


class _InDigits:
    """Equations f (m,) with gradients (m, k) at a point, in many digits."""

    def __init__(self, f: Numbers, gradients: Point, length: Decimal, arrived: Decimal) -> None:
        self.gradients = gradients
        # f + gradients x = 0 by elimination with the largest pivots, 0 of unknowns that are left free
        k = gradients.shape[1]
        equations = [[*row, -value] for row, value in zip(gradients.tolist(), f, strict=True)]
        done, over = precise_rows.eliminated(equations, k, _largest(gradients) * _rounding())
        self._step = _with_pivots(done, [ZERO] * k, [row[k] for _, row in done])
        left = max((abs(row[k]) for row in over), default=ZERO)
        steepest = _largest(gradients)
        longest = max(map(abs, self._step), default=ZERO)
        # Of a degenerate zero the steps fall and not the forces: those of a steep direction cancel the others before.
        self.distance, self.is_there = float(longest / length), longest <= arrived * length
        # What no step changes is no zero, but where it is of the second order of the step.
        self.is_there &= left <= steepest * (longest + length * _rounding())

    def step(self) -> Point:
        """The step (k,) to where the linear equations vanish."""
        return np.array(self._step)


def _largest(rows: Point) -> Decimal:
    return Decimal(max(map(abs, rows.flat), default=ZERO))


def _rounding() -> Decimal:
    """The part of the largest entry that an elimination leaves of zero."""
    return Decimal(10) ** (20 - decimal.getcontext().prec)


def _with_pivots(done: list[tuple[int, Numbers]], x: Numbers, right: Numbers) -> Numbers:
    """x (k,) with rows x = right (pivots,): the unknowns with a pivot follow from the others."""
    for (j, row), value in reversed(list(zip(done, right, strict=True))):
        x[j] = (value - sum((row[i] * x[i] for i in range(len(x)) if x[i] and i != j), ZERO)) / row[j]
    return x
