"""M, C, K, B, D of the equations of small deviations, in symbols (theory: small oscillations).

    K = d(M a - h - B^T lambda)/dq,    C = d(M a - h)/dv,    D = d(A v + b)/dq

at constant a and lambda, with what is zero at the reference put in, and the lengths that rows hold.
"""

from __future__ import annotations

import dataclasses
from typing import Literal

import sympy

from lagcli.derivation.symbolic import multiplier_equations
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import tidy
from lagcli.pfaffian.forms.notation import TIME, ZERO, exact

Kind = Literal["equilibrium", "steady", "general"]
Entries = dict[tuple[int, int], sympy.Expr]
# Coordinates, operations of one entry and of all entries that are written out.
MOST, LONGEST, LONGEST_IN_ALL = 30, 120, 600
# Operations that are differentiated, and those of all derivatives that are made shorter.
MOST_DIFFERENTIATED, MOST_SHORTENED = 5000, 3000


class NotLinearizedError(Exception):
    """The reason why linear equations are not written out."""


@dataclasses.dataclass(frozen=True, slots=True)
class LinearPoint:
    """A point that equations are linearized about: an instant of a reference motion, or any point of rest (`general`).

    numbers: q, v, a (n) and lambda of the rows and of the `closed` contacts after them, 0 where they are rounding;
    empty for any point of rest. reason: why nothing is linearized, or empty.
    """

    kind: Kind = "general"
    t: float = 0.0
    numbers: tuple[tuple[float, ...], ...] = ()
    closed: tuple[int, ...] = ()
    reason: str = ""


@dataclasses.dataclass(frozen=True, slots=True)
class Matrices:
    """The entries that are not zero: M, C, K by coordinates, B (all rows) and D (differential rows) by row and
    coordinate."""

    M: Entries
    C: Entries
    K: Entries
    B: Entries
    D: Entries

    @property
    def symbols(self) -> set[sympy.Symbol]:
        """All letters in them."""
        parts = (self.M, self.C, self.K, self.B, self.D)
        return {symbol for part in parts for value in part.values() for symbol in value.free_symbols}


def matrices(system: Symbolic, point: LinearPoint) -> Matrices:
    """The matrices of a system about a point. Raises `NotLinearizedError`."""
    count = len(system.q)
    if count > MOST:
        raise NotLinearizedError(f"there are {count} coordinates, and they are written out for up to {MOST}")
    at = _Substitution(system, point)
    inertial = [
        sum((system.matrix(i, j) * at.acceleration(j) for j in range(count)), -system.h[i])
        for i in range(count)
    ]
    pairs = list(zip(system.rows, system.lam, strict=True))
    residual = [
        value - sum((row.B[i] * lam for row, lam in pairs if i in row.B), ZERO)
        for i, value in enumerate(inertial)
    ]
    if sum(value.count_ops() for value in residual) > MOST_DIFFERENTIATED:
        raise NotLinearizedError("the equations of motion are too long to be differentiated")
    at.require_smooth(residual)
    linear = Matrices({}, {}, {}, {}, {})
    for i in range(count):
        for j in range(count):
            at.enter(linear.M, (i, j), system.matrix(i, j))
        for part, value, letters in ((linear.C, inertial[i], system.v), (linear.K, residual[i], system.q)):
            at.enter_slopes(part, i, value, letters)
    for r, row in enumerate(system.rows):
        if point.kind == "general" and row.b != 0:
            raise NotLinearizedError(
                f"the row {row.name} moves, so that there is no point of rest in general"
            )
        for i, slope in row.B.items():
            at.enter(linear.B, (r, i), slope)
        if row.f is None:
            rate = sum((slope * system.v[i] for i, slope in row.B.items()), row.b)
            at.enter_slopes(linear.D, r, rate, system.q)
    return linear


class _Substitution:
    """The values that are put into entries at a point, and the bounds of entries."""

    def __init__(self, system: Symbolic, point: LinearPoint) -> None:
        self._system, self._point, self._calculus = system, point, system.table.calculus
        self._rates = frozenset(system.v)
        self._used = self._raw = 0
        if point.kind == "general":
            self._zeros = dict.fromkeys((*system.v, *system.a), ZERO)
        else:
            letters = (system.q, system.v, system.a, system.lam)
            known = zip(letters, point.numbers, strict=True)
            pairs = [pair for level in known for pair in zip(*level, strict=True)]
            self._zeros = {letter: ZERO for letter, number in pairs if number == 0}
        on_surface = multiplier_equations.surface(system)
        self._on_surface = {x: value for x, value in on_surface.items() if TIME not in value.free_symbols}

    def acceleration(self, j: int) -> sympy.Expr:
        """a_j, or 0."""
        return self._zeros.get(self._system.a[j], self._system.a[j])

    def enter_slopes(
        self, part: Entries, i: int, value: sympy.Expr, letters: tuple[sympy.Symbol, ...]
    ) -> None:
        """Keep the derivatives of a value by some letters as row i. Raises `NotLinearizedError`."""
        present = self._calculus.symbols(value)
        for j, x in enumerate(letters):
            if x in present:
                self.enter(part, (i, j), self._calculus.partial(value, x))

    def enter(self, part: Entries, index: tuple[int, int], value: sympy.Expr) -> None:
        """Keep an entry that is not zero. Raises `NotLinearizedError` for what is too long or no number."""
        if value == 0:
            return
        self._raw += value.count_ops()
        if self._raw > MOST_SHORTENED:
            raise NotLinearizedError(f"the derivatives have more than {MOST_SHORTENED} operations together")
        put = self._put(value)
        if TIME in put.free_symbols:
            if self._point.kind == "general":
                raise NotLinearizedError("the linear equations depend on t")
            put = tidy(put.xreplace({TIME: exact(self._point.t)}))
        if put.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
            raise NotLinearizedError("an expression of the model has no derivative there as it is written")
        if put == 0:
            return
        operations = put.count_ops()
        self._used += operations
        if operations > LONGEST:
            raise NotLinearizedError(f"an entry has {operations} operations, and {LONGEST} are still read")
        if self._used > LONGEST_IN_ALL:
            raise NotLinearizedError(f"the entries have more than {LONGEST_IN_ALL} operations together")
        part[index] = put

    def _put(self, value: sympy.Expr) -> sympy.Expr:
        return tidy(
            tidy(self._calculus.expanded(value, self._rates)).xreplace(self._on_surface).xreplace(self._zeros)
        )

    def require_smooth(self, values: list[sympy.Expr]) -> None:
        """Raise `NotLinearizedError` where something bends or jumps at the very point."""
        for value in values:
            plain = self._calculus.expanded(value, self._rates)
            for bent in plain.atoms(sympy.Abs, sympy.sign, sympy.Heaviside):
                self._require_off(bent.args[0])
            for bent in plain.atoms(sympy.Min, sympy.Max):
                for k, one in enumerate(bent.args):
                    for other in bent.args[k + 1 :]:
                        self._require_off(one - other)

    def _require_off(self, argument: sympy.Expr) -> None:
        if argument.is_number:
            return
        if self._point.kind == "general" or self._put(argument) == 0:
            raise NotLinearizedError("an abs, sign, min, max or step in the equations may bend or jump there")
