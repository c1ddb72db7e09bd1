"""Coupled forms together: their derived flag and the first integrals of its end I^(oo) (D.3, jointly).

Holonomic rows that give a coordinate as a function of others are solved for it first; then the flag is found on
the coordinates that remain.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import sympy

from lagcli import doubles
from lagcli.linear import decompositions
from lagcli.pfaffian import derived_flag as flags
from lagcli.pfaffian import elimination, first_integrals, frobenius
from lagcli.pfaffian.exact import enclosure, guarded, time_limit
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.function_field import NotDecidedError, Values

Floats = npt.NDArray[np.float64]

# Operations for the search of joint integrals, which rarely ends by itself without a closed form.
SEARCH = 40_000


@dataclass(frozen=True, slots=True)
class Flagged:
    """A block on the coordinates that remain, those that were eliminated in terms of them, and its flag there."""

    block: PfaffianBlock
    values: dict[sympy.Symbol, sympy.Expr]
    flag: flags.Flag


@dataclass(frozen=True, slots=True)
class JointIntegral:
    """phi with d phi in I^(oo), and the rows whose combination d phi is."""

    phi: sympy.Expr
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Solution:
    """First integrals of I^(oo), and forms of a basis for which none is known: sum_k a_k d(x_k) in symbols `d(x)`."""

    integrals: tuple[JointIntegral, ...]
    unsolved: tuple[sympy.Expr, ...]


def flagged(block: PfaffianBlock, time: sympy.Symbol, values: Values, deadline: float) -> Flagged:
    """The flag of a block of real symbols, for the given values of the parameters among others.

    Raises `function_field.NotDecidedError`, at the latest at `deadline`, and `function_field.ExceptionalError`.
    """
    try:
        left, gone = time_limit.run(deadline, lambda: elimination.eliminated(block, values))
        left = time_limit.run(deadline, lambda: elimination.with_constant_arguments(left))
    except time_limit.NO_ANSWER as error:
        raise NotDecidedError("the holonomic rows could not be solved in time") from error
    plain = replace(left, rows=tuple(tuple(forms.plain(a) for a in row) for row in left.rows))
    return Flagged(plain, gone, flags.flag(plain, deadline, time, values))


def solution(found: Flagged, verdicts: Sequence[frobenius.FormVerdict | None], deadline: float) -> Solution:
    """Independent first integrals of I^(oo): those of rows alone first. `verdicts`: of the rows alone."""
    wanted = found.flag.dims[-1]
    block = found.block
    basis = _Independent(block)
    accepted: list[sympy.Expr] = []
    for i, (verdict, inside) in enumerate(zip(verdicts, found.flag.inside, strict=True)):
        # A row that says nothing on the surface may have an integral beside it.
        if inside and i not in found.flag.vanishing and len(accepted) < wanted:
            phi = _of_row(found, i, verdict, deadline)
            if phi is not None and basis.takes(phi.xreplace(found.values)):
                accepted.append(phi)
    if len(accepted) < wanted:
        names = tuple(f"form {i + 1}" for i in range(wanted))
        end = PfaffianBlock(names, block.variables, found.flag.integrable, block.parameters, block.surface)
        more = first_integrals.search(end, deadline, budget=SEARCH)
        accepted += [one.integral for one in more if basis.takes(one.integral)]
    solved = tuple(JointIntegral(phi, basis.rows_of(phi.xreplace(found.values))) for phi in accepted)
    unsolved = [_as_text(block, row) for row in found.flag.integrable if not basis.holds(row)]
    return Solution(solved, tuple(unsolved[: wanted - len(accepted)]))


def _of_row(
    found: Flagged, i: int, verdict: frobenius.FormVerdict | None, deadline: float
) -> sympy.Expr | None:
    """An integral of one row, as it is declared or on the coordinates that remain."""
    if verdict is not None and verdict.integral is not None:
        return verdict.integral
    if not found.values:
        return None
    return frobenius.classify(found.block.form(i), deadline).integral


def without_flag(
    block: PfaffianBlock, wanted: int, verdicts: Sequence[frobenius.FormVerdict | None], deadline: float
) -> Solution:
    """Solve as `solution` does, from rows of which is known only how many integrals they have, `wanted`."""
    left, gone = elimination.eliminated(block)
    basis = _Independent(left)
    accepted = [v.integral for v in verdicts if v is not None and v.integral is not None]
    accepted = [phi for phi in accepted if basis.takes(phi.xreplace(gone))]
    if len(accepted) < wanted:
        found = first_integrals.search(left, deadline, wanted, SEARCH)
        accepted += [one.integral for one in found if basis.takes(one.integral)]
    return Solution(
        tuple(JointIntegral(phi, basis.rows_of(phi.xreplace(gone))) for phi in accepted[:wanted]), ()
    )


def _as_text(block: PfaffianBlock, row: Iterable[sympy.Expr]) -> sympy.Expr:
    terms = (a * differential(x) for a, x in zip(row, block.variables, strict=True))
    above, _ = sympy.fraction(guarded.together(sum(terms, sympy.Integer(0))))
    return above


def differential(x: sympy.Symbol) -> sympy.Symbol:
    """The symbol of dx."""
    return sympy.Symbol(f"d({x.name})", real=True)


class _Independent:
    """Gradients at some points, told apart from combinations of those before them and of the df."""

    def __init__(self, block: PfaffianBlock) -> None:
        self._block = block
        self._points = _points(block)
        self._surface = [self._values(_gradient(block, f)) for f in block.surface]
        self._rows = [self._values(row) for row in block.rows]
        self._accepted: list[list[Floats | None]] = []

    def takes(self, phi: sympy.Expr) -> bool:
        """True if d phi is independent of those taken before; then it is taken."""
        values = self._values(_gradient(self._block, phi))
        if self._spans([*self._surface, *self._accepted], values):
            return False
        self._accepted.append(values)
        return True

    def holds(self, row: Iterable[sympy.Expr]) -> bool:
        """True if a form is a combination of what was taken."""
        return self._spans([*self._surface, *self._accepted], self._values(row))

    def rows_of(self, phi: sympy.Expr) -> tuple[str, ...]:
        """The rows of the block whose combination d phi is."""
        gradient = self._values(_gradient(self._block, phi))
        taking: set[int] = set()
        for i, point in enumerate(gradient):
            rows = [values[i] for values in (*self._surface, *self._rows)]
            if point is None or any(row is None for row in rows):
                continue
            weights = decompositions.least_squares(
                decompositions.unit(np.array(rows)).T, decompositions.unit(point[None])[0]
            )
            first = len(self._surface)
            taking |= {k - first for k in range(first, len(rows)) if abs(weights[k]) > doubles.ZERO}
        return tuple(name for i, name in enumerate(self._block.names) if i in taking)

    def _spans(self, others: list[list[Floats | None]], values: list[Floats | None]) -> bool:
        """True if the gradient is a combination of the others at every point where all have values."""
        for i, point in enumerate(values):
            rows = [other[i] for other in others]
            if point is None or any(row is None for row in rows):
                continue
            unit = decompositions.unit(point[None])[0]
            if not rows:
                return not unit.any()
            if (
                np.abs(decompositions.residual(decompositions.unit(np.array(rows)).T, unit)).max()
                > doubles.ZERO
            ):
                return False
        return True

    def _values(self, row: Iterable[sympy.Expr]) -> list[Floats | None]:
        """The coefficients at the points; None where one has no value."""
        listed = list(row)
        found: list[Floats | None] = []
        for point in self._points:
            evaluator = enclosure.Evaluator(point)
            try:
                found.append(np.array([float(evaluator.value(a).mid) for a in listed]))
            except enclosure.NoValueError:
                found.append(None)
        return found


def _points(block: PfaffianBlock) -> Sequence[enclosure.Point]:
    """Some points of the surface, or of all space where there is none."""
    symbols = (*block.variables, *block.parameters)
    if block.surface:
        return enclosure.points_on(block.surface, symbols)
    return list(enclosure.points(symbols))[:8]


def _gradient(block: PfaffianBlock, phi: sympy.Expr) -> list[sympy.Expr]:
    return [forms.partial(phi, x) for x in block.variables]
