"""The functions on a block as a field with derivations, and forms solved for their pivots in it. Not zero is what is
proved so; on a surface f = 0 zero is what the ideal of the f holds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy
from sympy.polys.fields import FracElement
from sympy.polys.rings import PolyElement

from lagcli import doubles
from lagcli.pfaffian.exact import enclosure, guarded, normal_form, time_limit, zero_test
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms.form import PfaffianBlock

Row = list[FracElement]  # entries in the field of the normal form
Values = Mapping[sympy.Symbol, sympy.Expr]

# Terms of one entry; beyond them the flag stays undecided.
MAX_TERMS = 3000
MAX_DIVISOR = 60  # terms of a divisor that is looked at again


class NotDecidedError(Exception):
    """An answer was not found; the text says why."""


class ExceptionalError(Exception):
    """For the given values of the parameters the answer may be another than for nearly all."""


@dataclass(frozen=True, slots=True)
class SolvedForms:
    """Forms solved for their pivots: row i holds 1 in column pivots[i] and 0 in the other pivots."""

    pivots: tuple[int, ...]
    rows: tuple[tuple[FracElement, ...], ...]

    @property
    def count(self) -> int:
        return len(self.pivots)


class FunctionField:
    """The field of a block; no divisor may vanish for the `values` of the parameters.

    `exceptional`: factors of divisors that hold parameters alone; `remainders`: what the rows solved last had left in
    the column `last` where nothing else was left. Raises `normal_form.NoNormalFormError`.
    """

    def __init__(self, block: PfaffianBlock, deadline: float, values: Values) -> None:
        self._block, self._deadline, self._values = block, deadline, values
        self.gradients = [tuple(forms.partial(f, x) for x in block.variables) for f in block.surface]
        entries = [a for row in (*self.gradients, *block.rows) for a in row]
        # The derivatives may hold functions that the coefficients do not: those of asin hold a root.
        parts = sorted({p for a in entries for p in a.atoms(sympy.Function, sympy.Pow)}, key=str)
        slopes = [forms.partial(p, x) for p in parts for x in block.variables if x in p.free_symbols]
        self.basis = normal_form.NormalForm([*entries, *slopes], block.surface)
        self.zero, self.one = self.basis.field.zero, self.basis.field.one
        self.expression = self.basis.expression
        # d letter/d variable for every variable, without zeros
        meanings = [self.basis.means(g) for g in self.basis.letters]
        self._slopes: list[dict[PolyElement, FracElement]] = []
        for x in block.variables:
            pairs = zip(meanings, self.basis.ring.gens, strict=True)
            varying = ((meaning, g) for meaning, g in pairs if x in meaning.free_symbols)
            self._slopes.append({g: self.basis.element(forms.partial(meaning, x)) for meaning, g in varying})
        # The letters that hold parameters alone, by their index, with their values or nan
        self._constants: dict[int, float] = {}
        for index, meaning in enumerate(meanings):
            if meaning.free_symbols <= set(block.parameters):
                number = guarded.subs(meaning, values).evalf() if values else sympy.nan
                self._constants[index] = float(number) if number.is_real else math.nan
        self._proved: dict[FracElement, bool] = {}
        self.exceptional: dict[sympy.Expr, None] = {}
        self._divisors: dict[PolyElement, None] = {}
        self.remainders: tuple[FracElement, ...] = ()

    @property
    def divisors(self) -> tuple[sympy.Expr | None, ...]:
        """The divisors, but for numbers: where none of them vanishes all ranks are those found. None in place of
        one that is too long."""
        return tuple(
            self.basis.expression(above) if len(above) <= MAX_DIVISOR else None for above in self._divisors
        )

    @property
    def is_exact(self) -> bool:
        """True if no entry was proved not zero by its digits at points of the surface alone."""
        return not (self._block.surface and self._proved)

    def rows(self, table: Iterable[Iterable[sympy.Expr]]) -> list[Row]:
        """Rows of expressions as elements."""
        return [[self.basis.element(a) for a in row] for row in table]

    def along(self, X: Row, a: FracElement) -> FracElement:
        """X(a) = sum_k X_k da/dx_k."""
        field, above, below = self.basis.field, a.numer, a.denom
        own = {}
        for g in dict.fromkeys(g for slopes in self._slopes for g in slopes):
            rise = field(above.diff(g)) / field(below)
            fall = below.diff(g)
            own[g] = rise if not fall else rise - field(above) * field(fall) / field(below) ** 2
        terms = []
        for X_k, slopes in zip(X, self._slopes, strict=True):
            if X_k:
                terms += [(X_k * slope, own[g]) for g, slope in slopes.items() if own[g]]
        return self.sum(terms)

    def sum(self, products: Iterable[tuple[FracElement, FracElement]]) -> FracElement:
        total = self.zero
        for a, b in products:
            if a and b:
                total = total + a * b
        if not total:
            return total
        if len(total.numer) + len(total.denom) > MAX_TERMS:
            raise NotDecidedError("the expressions grow too large")
        return self.basis.reduced(total)

    def checked(self, a: FracElement) -> FracElement:
        """The element, with a proof that it is not zero unless it is. Raises `NotDecidedError`."""
        if not a or a.numer.is_ground or (self.basis.independent and not self._block.surface):
            return a
        if a not in self._proved:
            expression, surface = self.expression(a), self._block.surface
            if surface:
                values = enclosure.values_on(expression, surface)
                self._proved[a] = any(abs(v) > enclosure.ZERO for v in values)
            else:
                self._proved[a] = zero_test.is_zero(expression, self._deadline).truth is False
        if not self._proved[a]:
            raise NotDecidedError("whether a component of the flag vanishes could not be proved")
        return a

    def frame(self, solved: SolvedForms, size: int) -> list[Row]:
        """The fields X_j (size,) of the kernel of solved forms, for every free j."""
        found = []
        for j in (k for k in range(size) if k not in solved.pivots):
            X = [self.zero] * size
            X[j] = self.one
            for p, row in zip(solved.pivots, solved.rows, strict=True):
                X[p] = -row[j]
            found.append(X)
        return found

    def solved(
        self,
        rows: Sequence[Sequence[FracElement]],
        last: int = -1,
        vanishes: Callable[[sympy.Expr], bool] | None = None,
    ) -> SolvedForms:
        """Reduced echelon form; pivots are taken where they are simplest, in the column `last` only at last. vanishes:
        at a point of the surface, where no pivot may do so; the forms are as many as are independent there."""
        left = [list(row) for row in rows]

        def weight(i: int, k: int) -> tuple[bool, bool, int, int, int]:
            """The order of pivots: constants first, then short entries in thin rows and columns."""
            a = left[i][k]
            is_varying = not (a.numer.is_ground and a.denom.is_ground)
            spread = sum(1 for row in left if row[k])
            length = len(a.numer) + len(a.denom)
            return k == last, is_varying, length, spread, sum(1 for b in left[i] if b)

        done: list[Row] = []
        pivots: list[int] = []
        while left:
            time_limit.check(self._deadline)
            indices = [(i, k) for i, row in enumerate(left) for k in range(len(row)) if row[k]]
            indices.sort(key=lambda index: weight(*index))
            if vanishes is not None:
                regular = (one for one in indices if not vanishes(self.expression(left[one[0]][one[1]])))
                indices = list(itertools.islice(regular, 1))
            if not indices:
                break
            i, k = indices[0]
            if k == last:
                self.remainders = tuple(self.checked(row[k]) for row in left if row[k])
            self.require_regular(left[i][k] if vanishes is not None else self.checked(left[i][k]))
            pivot = left.pop(i)
            scale = self.one / pivot[k]
            pivot = [self.sum([(scale, a)]) for a in pivot]
            pivot[k] = self.one
            for row in (*left, *done):
                if factor := row[k]:
                    pairs = zip(row, pivot, strict=True)
                    row[:] = [self.sum([(self.one, a), (-factor, b)]) for a, b in pairs]
            done.append(pivot)
            pivots.append(k)
        order = sorted(range(len(pivots)), key=lambda i: pivots[i])
        return SolvedForms(tuple(pivots[i] for i in order), tuple(tuple(done[i]) for i in order))

    def require_regular(self, a: FracElement) -> None:
        """Note it as a divisor, and its factors of parameters alone; raise `ExceptionalError` where it vanishes for the
        values."""
        if not a.numer.is_ground:
            self._divisors[a.numer] = None
        if not self._constants or a.numer.is_ground:
            return
        coefficients: dict[tuple[int, ...], list[float]] = {}
        for powers, number in a.numer.terms():
            rest = tuple(0 if i in self._constants else n for i, n in enumerate(powers))
            size = float(number)
            for i, value in self._constants.items():
                size *= value ** powers[i] if powers[i] else 1.0
            coefficients.setdefault(rest, []).append(size)
        sums = coefficients.values()
        if self._values and all(abs(sum(c)) <= doubles.VALUE * sum(map(abs, c)) for c in sums):
            raise ExceptionalError("a divisor vanishes for the values of the parameters")
        monomials = a.numer.itermonoms()
        if len(coefficients) > 1 and any(not any(p[i] for i in self._constants) for p in monomials):
            return  # a term without parameters: they share no factor
        for part, _ in a.numer.factor_list()[1]:
            expression = self.basis.expression(part)
            if expression.free_symbols <= set(self._block.parameters) and may_vanish(expression):
                self.exceptional[expression] = None


def may_vanish(part: sympy.Expr) -> bool:
    """True if a factor may have real zeros: exponentials and sums of positive terms have none, |u| has a kink."""
    return not (part.is_positive or part.is_negative or part.has(sympy.Abs) or isinstance(part, sympy.exp))


# A frame of the kernel of forms, by elimination in the normal form: theta_a = d(x_p) - sum_j solved[a][j] d(x_j), p the
# a-th pivot and j the free variables, X_j = d/dx_j + sum_a solved[a][j] d/dx_p. For a completely integrable system phi
# is a first integral exactly where X_j(phi) = 0 for all j (Frobenius).


@dataclass(frozen=True, slots=True)
class KernelFrame:
    """C independent forms in n variables, solved for the differentials of C of them: pivots (C,), free (n - C,):
    indices of variables; solved (C, n - C). is_sure: no divisor vanishes without being known to."""

    variables: tuple[sympy.Symbol, ...]
    parameters: tuple[sympy.Symbol, ...]
    pivots: tuple[int, ...]
    free: tuple[int, ...]
    solved: tuple[tuple[sympy.Expr, ...], ...]
    is_sure: bool

    def rates(self, phi: sympy.Expr) -> list[sympy.Expr]:
        """X_j(phi) for every free variable; shape (n - C,)."""
        slopes = [forms.partial(phi, self.variables[p]) for p in self.pivots]
        found = []
        for column, j in enumerate(self.free):
            terms = (row[column] * s for row, s in zip(self.solved, slopes, strict=True))
            found.append(sum(terms, forms.partial(phi, self.variables[j])))
        return found


def kernel(
    rows: Sequence[Sequence[sympy.Expr]],
    variables: tuple[sympy.Symbol, ...],
    parameters: tuple[sympy.Symbol, ...],
    last: Sequence[sympy.Symbol] = (),
) -> KernelFrame:
    """The frame of the rows (C, n) that do not depend on the others; variables `last` become pivots only where no other
    can. Raises `NoAnswerError`."""

    def size(element: FracElement) -> int:
        return len(element.numer.terms()) + len(element.denom.terms()) + sum(map(sum, element.numer.monoms()))

    basis = normal_form.NormalForm([a for row in rows for a in row])
    table = [[basis.element(a) for a in row] for row in rows]
    waiting = list(range(len(rows)))
    pivots: list[int] = []
    done: list[int] = []
    while waiting:
        choices = [
            (variables[k] in last, size(table[i][k]), -k, i, k)
            for i in waiting
            for k in range(len(variables))
            if k not in pivots and table[i][k] != 0
        ]
        if not choices:
            break
        *_, i, k = min(choices, key=lambda c: c[:4])
        waiting.remove(i)
        table[i] = [basis.reduced(a / table[i][k]) if a else a for a in table[i]]
        for other in (*waiting, *done):
            head = table[other][k]
            if head != 0:
                pairs = zip(table[other], table[i], strict=True)
                table[other] = [basis.reduced(a - head * b) if b else a for a, b in pairs]
        pivots.append(k)
        done.append(i)
    free = tuple(k for k in range(len(variables)) if k not in pivots)
    order = sorted(range(len(pivots)), key=lambda a: pivots[a])
    solved = tuple(tuple(basis.expression(-table[done[a]][k]) for k in free) for a in order)
    return KernelFrame(
        variables, parameters, tuple(pivots[a] for a in order), free, solved, basis.independent
    )


def belongs(
    frame: KernelFrame,
    rows: Sequence[Sequence[sympy.Expr]],
    deadline: float,
    surface: tuple[sympy.Expr, ...] = (),
) -> bool:
    """True if it is proved that the frame is that of the rows: every row annihilates its fields, and the rows have its
    rank, on the surface too."""
    size = len(frame.pivots)
    if size == 0:
        return False
    for row in () if frame.is_sure else rows:
        for column, j in enumerate(frame.free):
            terms = (row[p] * s[column] for p, s in zip(frame.pivots, frame.solved, strict=True))
            if zero_test.is_zero(sum(terms, row[j]), deadline).truth is not True:
                return False
    if frame.is_sure and not surface:
        return True
    matrix = [[row[p] for p in frame.pivots] for row in rows]
    return has_rank(matrix, size, deadline, surface)


def has_rank(
    matrix: Sequence[Sequence[sympy.Expr]], size: int, deadline: float, surface: tuple[sympy.Expr, ...] = ()
) -> bool:
    """True if the matrix with `size` rows or columns is proved to have that rank at generic points of the surface."""
    chosen = sympy.Matrix([list(row) for row in matrix])
    if not chosen.rows == chosen.cols == size:
        # Its determinant is the sum of the squares of all minors (Cauchy, Binet).
        chosen = chosen * chosen.T if chosen.rows == size else chosen.T * chosen
        if chosen.rows != size:
            return False
    determinant = guarded.call(chosen.det, method="berkowitz")
    return zero_test.is_zero(determinant, deadline, surface).truth is False
