"""Coupled forms together: their derived flag and the first integrals of its end I^(oo) (D.3, jointly), on the
coordinates that holonomic rows leave. What is found holds for all that differ in names alone (`Memo`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import sympy

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import decompositions
from lagcli.memory import Memory
from lagcli.pfaffian import derived_flag as flags
from lagcli.pfaffian import elimination, first_integrals, frobenius
from lagcli.pfaffian.exact import enclosure, guarded, time_limit
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms.form import Form, PfaffianBlock
from lagcli.pfaffian.frobenius import FormVerdict
from lagcli.pfaffian.function_field import NotDecidedError, Values

T = TypeVar("T")
# Of the rows alone; None of one that is too large.
RowVerdicts = Sequence[FormVerdict | None]

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
    """The flag of a block of real symbols, for the given values of the parameters among others. Raises
    `function_field.NotDecidedError`, at the latest at `deadline`, and `function_field.ExceptionalError`."""
    try:
        left, gone = time_limit.run(deadline, lambda: elimination.eliminated(block, values))
        left = time_limit.run(deadline, lambda: elimination.with_constant_arguments(left))
    except time_limit.NO_ANSWER as error:
        raise NotDecidedError("the holonomic rows could not be solved in time") from error
    plain = replace(left, rows=tuple(tuple(forms.plain(a) for a in row) for row in left.rows))
    return Flagged(plain, gone, flags.flag(plain, deadline, time, values))


def solution(found: Flagged, verdicts: RowVerdicts, deadline: float) -> Solution:
    """Independent first integrals of I^(oo): those of rows alone first."""
    wanted = found.flag.dims[-1]
    block = found.block
    basis = _Independent(block)
    accepted: list[sympy.Expr] = []
    for i, (verdict, inside) in enumerate(zip(verdicts, found.flag.inside, strict=True)):
        # A row that says nothing on the surface may have an integral beside it.
        if inside and i not in found.flag.vanishing and len(accepted) < wanted:
            phi = None if verdict is None else verdict.integral
            if phi is None and found.values:  # that of the row on the coordinates that remain
                phi = frobenius.classify(block.form(i), deadline).integral
            if phi is not None and basis.takes(phi.xreplace(found.values)):
                accepted.append(phi)
    if len(accepted) < wanted:
        names = tuple(f"form {i + 1}" for i in range(wanted))
        end = PfaffianBlock(names, block.variables, found.flag.integrable, block.parameters, block.surface)
        more = first_integrals.search(end, deadline, budget=SEARCH)
        accepted += [one.integral for one in more if basis.takes(one.integral)]
    solved = basis.solved(accepted, found.values)
    unsolved = []
    for row in (row for row in found.flag.integrable if not basis.spans(basis.values(row))):
        terms = (a * differential(x) for a, x in zip(row, block.variables, strict=True))
        unsolved.append(sympy.fraction(guarded.together(sum(terms, sympy.Integer(0))))[0])
    return Solution(solved, tuple(unsolved[: wanted - len(accepted)]))


def without_flag(block: PfaffianBlock, wanted: int, verdicts: RowVerdicts, deadline: float) -> Solution:
    """Solve as `solution` does, from rows of which is known only how many integrals they have, `wanted`."""
    left, gone = elimination.eliminated(block)
    basis = _Independent(left)
    accepted = [v.integral for v in verdicts if v is not None and v.integral is not None]
    accepted = [phi for phi in accepted if basis.takes(phi.xreplace(gone))]
    if len(accepted) < wanted:
        found = first_integrals.search(left, deadline, wanted, SEARCH)
        accepted += [one.integral for one in found if basis.takes(one.integral)]
    return Solution(basis.solved(accepted[:wanted], gone), ())


def differential(x: sympy.Symbol) -> sympy.Symbol:
    """The symbol of dx."""
    return sympy.Symbol(f"d({x.name})", real=True)


class _Independent:
    """Gradients at some points, told apart from combinations of those before them and of the df."""

    def __init__(self, block: PfaffianBlock) -> None:
        self._block = block
        symbols = (*block.variables, *block.parameters)
        self._points: Sequence[enclosure.Point] = (
            enclosure.points_on(block.surface, symbols)
            if block.surface
            else list(enclosure.points(symbols))[:8]
        )
        self._surface = [self._gradient(f) for f in block.surface]
        self._rows = [self.values(row) for row in block.rows]
        self._accepted: list[list[Floats | None]] = []

    def takes(self, phi: sympy.Expr) -> bool:
        """True if d phi is independent of those taken before; then it is taken."""
        values = self._gradient(phi)
        if self.spans(values):
            return False
        self._accepted.append(values)
        return True

    def solved(self, integrals: Sequence[sympy.Expr], values: Values) -> tuple[JointIntegral, ...]:
        """Integrals with the rows of the block whose combination d phi is, where `values` are put in."""
        found = []
        for phi in integrals:
            taking: set[int] = set()
            for rows, gradient in _together(
                [*self._surface, *self._rows], self._gradient(phi.xreplace(values))
            ):
                weights = decompositions.least_squares(rows.T, gradient)
                own = np.abs(weights[len(self._surface) :]) > doubles.ZERO
                taking |= set(np.flatnonzero(own).tolist())
            names = tuple(name for i, name in enumerate(self._block.names) if i in taking)
            found.append(JointIntegral(phi, names))
        return tuple(found)

    def spans(self, values: list[Floats | None]) -> bool:
        """True if a form is a combination of the df and of what was taken at every point where all have values."""
        for rows, form in _together([*self._surface, *self._accepted], values):
            if not rows.size:
                return not form.any()
            if np.abs(decompositions.residual(rows.T, form)).max() > doubles.ZERO:
                return False
        return True

    def _gradient(self, phi: sympy.Expr) -> list[Floats | None]:
        return self.values(forms.partial(phi, x) for x in self._block.variables)

    def values(self, row: Iterable[sympy.Expr]) -> list[Floats | None]:
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


def _together(
    others: list[list[Floats | None]], values: list[Floats | None]
) -> Iterator[tuple[Floats, Floats]]:
    """Rows (k, n) and a gradient (n,), all of length one, at each point where all have values."""
    for i, gradient in enumerate(values):
        rows = [row for other in others if (row := other[i]) is not None]
        if gradient is not None and len(rows) == len(others):
            unit = decompositions.unit(np.array(rows)) if rows else np.zeros((0, gradient.size))
            yield unit, decompositions.unit(gradient[None])[0]


class Memo:
    """Judges forms and blocks, those once that differ in names alone, as the members of a family of laws do."""

    def __init__(self) -> None:
        self._placeholders: list[sympy.Symbol] = []
        self._forms, self._blocks = Memory(), Memory()

    def _numbered(self, variables: Sequence[sympy.Symbol]) -> dict[sympy.Symbol, sympy.Symbol]:
        """Symbols for coordinates by their numbers."""
        for n in range(len(self._placeholders), len(variables)):
            self._placeholders.append(sympy.Dummy(f"x{n}", real=True))
        return dict(zip(variables, self._placeholders, strict=False))

    def classify(self, form: Form, deadline: float) -> FormVerdict:
        numbered = self._numbered(form.variables)
        pattern = tuple(a.xreplace(numbered) for a in form.coefficients), form.parameters
        known, verdict = self._forms.answer(pattern, lambda: (form, frobenius.classify(form, deadline)))
        if known is form:
            return verdict
        renamed = dict(zip(known.variables, form.variables, strict=True))
        # Every name that differs is that of a member, `x[1]`: it is then told from words in a sentence.
        if not all(x == y or "[" in x.name for x, y in renamed.items()):
            return frobenius.classify(form, deadline)
        names = {x.name: y.name for x, y in renamed.items() if x != y}
        moved = forms.in_symbols(verdict, renamed | names)
        if not names:
            return moved
        longest_first = sorted(map(re.escape, names), key=len, reverse=True)
        written = re.compile(rf"(?<!\w)(?:{'|'.join(longest_first)})(?!\w)")
        return replace(moved, method=written.sub(lambda m: names[m[0]], verdict.method))

    def of_block(self, block: PfaffianBlock, find: Callable[[], T], kind: str) -> T:
        """What `find` gives for a block, or for one that differs in the names of its coordinates and rows alone."""
        numbered = self._numbered(block.variables)
        rows = tuple(tuple(a.xreplace(numbered) for a in row) for row in block.rows)
        pattern = kind, rows, tuple(f.xreplace(numbered) for f in block.surface), block.parameters
        known, found = self._blocks.answer(pattern, lambda: (block, find()))
        renamed = dict(zip(known.variables, block.variables, strict=True))
        renamed |= {differential(x): differential(y) for x, y in renamed.items()}
        renamed |= zip(known.names, block.names, strict=True)
        return found if known is block else forms.in_symbols(found, renamed)
