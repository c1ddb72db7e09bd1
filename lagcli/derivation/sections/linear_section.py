"""Small oscillations: M dq'' + C dq' + K dq = B^T dlambda and its rows, about a reference motion.

    K = d(M a - h - B^T lambda)/dq,    C = d(M a - h)/dv,    D = d(A v + b)/dq

at constant a and lambda, with what is zero at the reference put in, and the lengths that rows hold.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Literal

import sympy

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.symbolic import multiplier_equations
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import tidy
from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms.notation import TIME, ZERO, exact

Kind = Literal["equilibrium", "steady", "general"]
Entries = dict[tuple[int, int], sympy.Expr]
Matrices = dict[str, Entries]
"""The entries that are not zero: M, C, K by coordinates, B and D (of differential rows) by row and coordinate."""
# Coordinates, operations of one entry and of all entries that are written out.
MOST, LONGEST, LONGEST_IN_ALL = 30, 120, 600
# Operations that are differentiated, and those of all derivatives that are made shorter.
MOST_DIFFERENTIATED, MOST_SHORTENED = 5000, 3000
TITLE = "Small oscillations  M δq̈ + C δq̇ + K δq = Bᵀ δλ"
ABOUT = {
    "equilibrium": "About the declared start, an equilibrium; what is zero there is put in.",
    "steady": "About the declared start, an instant of a steady motion; what is zero there is put in.",
    "accelerated": (
        "About the motion from the declared start, which is uniformly accelerated: no steady motion, but its linear"
        " equations have constant coefficients; what is zero there is put in."
    ),
    "general": (
        "The declared start is no equilibrium and no steady motion. About any point of rest, with the coordinates and λ"
        " of that point (the command equilibrium finds them):"
    ),
}


class NotLinearizedError(Exception):
    """The reason why linear equations are not written out."""


@dataclasses.dataclass(frozen=True, slots=True)
class LinearPoint:
    """A point that equations are linearized about: an instant of a reference motion, or any point of rest (`general`).

    numbers: q, v, a (n) and lambda of the rows and of the `closed` contacts, 0 where they are rounding; empty for any
    point of rest. reason: why nothing is linearized, or empty.
    """

    kind: Kind = "general"
    t: float = 0.0
    numbers: tuple[tuple[float, ...], ...] = ()
    closed: tuple[int, ...] = ()
    reason: str = ""


def lines(whole: Symbolic, signs: Signs, point: LinearPoint) -> Iterator[Line]:
    """The linear equations coordinate by coordinate and row by row, then the values at the start of what is in them;
    or why they are not written."""
    if point.reason:
        yield Line(note=f"Not written out: {point.reason}.")
        return
    system = whole.closed(point.closed)
    try:
        linear = matrices(system, point)
    except NotLinearizedError as error:
        general = "the declared start is no equilibrium and no steady motion, and about any point of rest "
        yield Line(note=f"Not written out: {general if point.kind == 'general' else ''}{error}.")
        return
    is_accelerated = point.kind == "steady" and any(point.numbers[2])
    yield Line(note=ABOUT["accelerated" if is_accelerated else point.kind])
    if point.closed:
        names = ", ".join(whole.contacts.rows[j].name for j in point.closed)
        yield Line(note=f"Contacts that press count as rows: {names}.")
    elif whole.contacts.rows:
        yield Line(note="No contact counts as a row: they are open.")
    if not any(linear[letter] for letter in "CKBD"):
        yield Line(note="C and K are zero, and there are no rows: M δq̈ = 0, deviations drift.")
        return
    yield from _equations(system, signs, linear)
    if point.kind == "general":
        return
    # The values at the start of letters that are in the equations
    present = {symbol for part in linear.values() for value in part.values() for symbol in value.free_symbols}
    for letters, numbers in zip((system.q, system.v, system.a, system.lam), point.numbers, strict=True):
        for letter, number in zip(letters, numbers, strict=True):
            if letter in present:
                value: f.FormulaNode = f.FormulaNumber(f"{abs(number):.10g}")
                sides = signs.node(letter), f.negative(value) if number < 0 else value
                yield Line(sides=sides, kind="at the start", family="start")


def _equations(system: Symbolic, signs: Signs, linear: Matrices) -> Iterator[Line]:
    """The equations of motion by coordinate, then B dq = 0 of holonomic rows and A dq' + D dq = 0 of others."""
    # Symbols of dq, dq', dq'' by coordinate, and of dlambda by row, with their signs
    levels: list[tuple[sympy.Symbol, ...]] = []
    for dots, letters in enumerate((system.q, system.q, system.q, system.lam)):
        symbols = tuple(sympy.Symbol(f"deviation {dots} {letter}") for letter in letters)
        for symbol, letter in zip(symbols, letters, strict=True):
            sign = signs.sign(letter)
            signs.show_as(symbol, f.Sign("δ" + sign.base, sign.sub, dots % 3))
        levels.append(symbols)
    dq, dv, da, dlam = levels

    across = {(i, r): value for (r, i), value in linear["B"].items()}

    def terms(letter: str, i: int, symbols: tuple[sympy.Symbol, ...]) -> list[tuple[int, f.FormulaNode]]:
        """The terms of one row of a matrix times deviations."""
        part = linear.get(letter, across)
        nodes = (signs.node(part[i, j] * symbol) for j, symbol in enumerate(symbols) if (i, j) in part)
        return [term for node in nodes for term in f.terms_of(node)]

    for i, name in enumerate(system.names):
        left = f.joined([*terms("M", i, da), *terms("C", i, dv), *terms("K", i, dq)])
        sides = left, f.joined(terms("B^T", i, dlam))
        yield Line(sides=sides, kind="deviation", family=f.family(name))
    for r, row in enumerate(system.rows):
        left_terms = terms("B", r, dq) if row.f is not None else [*terms("B", r, dv), *terms("D", r, dq)]
        if left_terms:
            yield Line(sides=(f.joined(left_terms), f.ZERO), kind="deviation row", family=row.family)


def matrices(system: Symbolic, point: LinearPoint) -> Matrices:
    """The matrices of a system about a point. Raises `NotLinearizedError`."""
    count = len(system.q)
    if count > MOST:
        raise NotLinearizedError(f"there are {count} coordinates, and they are written out for up to {MOST}")
    at = _Substitution(system, point)
    accelerations = [at.zeros.get(a, a) for a in system.a]
    inertial = [system.inertial(i, accelerations, -system.h[i]) for i in range(count)]
    residual = [value - system.pull(i, system.lam) for i, value in enumerate(inertial)]
    if sum(value.count_ops() for value in residual) > MOST_DIFFERENTIATED:
        raise NotLinearizedError("the equations of motion are too long to be differentiated")
    at.require_smooth(residual)
    linear: Matrices = {letter: {} for letter in "MCKBD"}
    for i in range(count):
        for j in range(count):
            at.enter(linear["M"], (i, j), system.matrix(i, j))
        at.enter_slopes(linear["C"], i, inertial[i], system.v)
        at.enter_slopes(linear["K"], i, residual[i], system.q)
    for r, row in enumerate(system.rows):
        if point.kind == "general" and row.b != 0:
            reason = "moves, so that there is no point of rest in general"
            raise NotLinearizedError(f"the row {row.name} {reason}")
        for i, slope in row.B.items():
            at.enter(linear["B"], (r, i), slope)
        if row.f is None:
            at.enter_slopes(linear["D"], r, system.velocity(row), system.q)
    return linear


class _Substitution:
    """The values that are put into entries at a point, and the bounds of entries."""

    def __init__(self, system: Symbolic, point: LinearPoint) -> None:
        self._system, self._point, self._calculus = system, point, system.table.calculus
        self._rates = frozenset(system.v)
        self._used = self._raw = 0
        if point.kind == "general":
            self.zeros = dict.fromkeys((*system.v, *system.a), ZERO)
        else:
            letters = (system.q, system.v, system.a, system.lam)
            known = zip(letters, point.numbers, strict=True)
            pairs = [pair for level in known for pair in zip(*level, strict=True)]
            self.zeros = {letter: ZERO for letter, number in pairs if number == 0}
        on_surface = multiplier_equations.surface(system)
        self._on_surface = {x: value for x, value in on_surface.items() if TIME not in value.free_symbols}

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
        plain = tidy(self._calculus.expanded(value, self._rates))
        return tidy(plain.xreplace(self._on_surface).xreplace(self.zeros))

    def require_smooth(self, values: list[sympy.Expr]) -> None:
        """Raise `NotLinearizedError` where something bends or jumps at the very point."""
        for value in values:
            plain = self._calculus.expanded(value, self._rates)
            bending = [bent.args[0] for bent in plain.atoms(sympy.Abs, sympy.sign, sympy.Heaviside)]
            for bent in plain.atoms(sympy.Min, sympy.Max):
                bending += [one - other for one, other in itertools.combinations(bent.args, 2)]
            for argument in bending:
                is_general = self._point.kind == "general"
                if not argument.is_number and (is_general or self._put(argument) == 0):
                    raise NotLinearizedError(
                        "an abs, sign, min, max or step in the equations may bend or jump there"
                    )
