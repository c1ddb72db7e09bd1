"""The derived flag I > I' > I'' > ... of a Pfaffian system, exactly (E. Cartan; Bryant et al., Exterior Differential
Systems, ch. II). I' = {theta in I: d theta = 0 modulo I}; with forms solved for pivot differentials,

    theta_i = dx_i + sum_j a_ij dx_j,    X_j = d/dx_j - sum_i a_ij d/dx_i    (j free),

d theta_i(X_j, X_k) = X_j(a_ik) - X_k(a_ij), and I' are the combinations whose values all vanish. The flag ends in the
integrable part I^(oo) (Frobenius). The growth vector counts the dimensions of D, D + [D, D], ..., D = ker I. On a
surface f = 0 the forms df are rows too, and zero is what the ideal of the f holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations

import sympy
from sympy.polys.fields import FracElement
from sympy.polys.rings import PolyElement

from lagcli.pfaffian.exact import enclosure, normal_form, time_limit
from lagcli.pfaffian.exact.guarded import NoAnswerError
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.function_field import (
    FunctionField,
    NotDecidedError,
    Row,
    SolvedForms,
    Values,
    may_vanish,
)


@dataclass(frozen=True, slots=True)
class Demand:
    """g dt = 0, which a combination of `rows` says: the factors of g that may vanish for some time."""

    factors: tuple[sympy.Expr, ...]
    rows: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Flag:
    """The flag beyond the df of the surface.

    dims: dim I^(k), to the one that stays; growth: by how much each term of D, D + [D, D], ... exceeds D, from 0;
    inside: whether each row lies in I^(oo); integrable: a basis of I^(oo), solved for pivots (dims[-1], n);
    contradiction: rows of which a combination is a multiple of dt; special: expressions at whose zeros I' is larger;
    is_exact, divisors: of `function_field.FunctionField`; exceptional: expressions of the parameters at whose zeros the
    flag may be another; vanishing: rows that vanish identically; holonomic_rank: of the df; conditions: of combinations
    of rows that are g dt.
    """

    dims: tuple[int, ...]
    growth: tuple[int, ...]
    inside: tuple[bool, ...]
    integrable: tuple[tuple[sympy.Expr, ...], ...]
    contradiction: tuple[int, ...] = ()
    special: tuple[sympy.Expr, ...] = ()
    is_exact: bool = True
    exceptional: tuple[sympy.Expr, ...] = ()
    vanishing: tuple[int, ...] = ()
    holonomic_rank: int = 0
    divisors: tuple[sympy.Expr | None, ...] = ()
    conditions: tuple[Demand, ...] = ()


def flag(
    block: PfaffianBlock, deadline: float, time: sympy.Symbol | None = None, values: Values | None = None
) -> Flag:
    """The flag of the block for nearly all values of the parameters; `time`: of which no multiple may lie in I. Raises
    `ExceptionalError` where it may not hold for given `values`, `NotDecidedError` where an entry is neither proved zero
    nor proved not, at `deadline` and where expressions grow too large."""
    try:
        return time_limit.run(deadline, lambda: _FlagSearch(block, deadline, time, values or {}).flag())
    except normal_form.NoNormalFormError as error:
        raise NotDecidedError(str(error)) from error
    except time_limit.TimeUpError as error:
        raise NotDecidedError("the time was over before the derived flag was known") from error
    except NoAnswerError as error:
        raise NotDecidedError(f"the algebra failed ({type(error).__name__})") from error


class _FlagSearch:
    """The steps of the flag of one block."""

    def __init__(
        self, block: PfaffianBlock, deadline: float, time: sympy.Symbol | None, values: Values
    ) -> None:
        self._variables = block.variables
        self._time = block.variables.index(time) if time in block.variables else -1
        self._field = FunctionField(block, deadline, values)
        self._holonomic = self._field.rows(self._field.gradients)
        self._declared = self._field.rows(block.rows)

    def flag(self) -> Flag:
        field = self._field
        surface = field.solved(self._holonomic, self._time)
        start = field.solved([*self._holonomic, *self._declared], self._time)
        if self._time in start.pivots:
            # The column of time is taken last: this row is a multiple of dt.
            return self._conditions(field.remainders)
        # Where d omega = 0 modulo I is seen for each row, I' = I. The df are closed, and rows as they are declared have
        # shorter entries than those solved for pivots.
        try:
            pairs = self._pairs(start, start)
            is_closed = not any(self._raw_curl(omega, X, Y) for X, Y in pairs for omega in self._declared)
        except NotDecidedError:  # expressions that are too large
            is_closed = False
        first, special = (start, ()) if is_closed else self._derived(start, start)
        dims, terms = [start.count, first.count], [start, first]
        while dims[-1] not in (dims[-2], surface.count):
            terms.append(self._derived(terms[-1], terms[-1])[0])
            dims.append(terms[-1].count)
        last = terms[-1]
        # dim (D_k / D) with D_(k+1) = D_k + [D, D_k]. The first step is that of the flag; beyond, [D, D_k] may give
        # less than [D_k, D_k].
        counts, here = [start.count, first.count], first
        while counts[-1] != counts[-2] and here.count > last.count:
            here = self._derived(here, start)[0]
            counts.append(here.count)
        if counts[-1] == counts[-2]:
            counts.pop()
        extra = tuple(d - surface.count for d in dims)
        inside = []
        for omega in self._declared:
            lies_in = True
            for k in range(len(omega)):
                rest = [(-omega[p], theta[k]) for p, theta in zip(last.pivots, last.rows, strict=True)]
                if left := field.checked(field.sum([(field.one, omega[k]), *rest])):
                    field.require_regular(left)
                    lies_in = False
                    break
            inside.append(lies_in)
        # A basis of I^(oo) without the df: those of its forms that are independent of them
        basis_rows: list[tuple[FracElement, ...]] = list(surface.rows)
        beyond = []
        for row in last.rows:
            if field.solved([*map(list, basis_rows), list(row)]).count > len(basis_rows):
                basis_rows.append(row)
                beyond.append(tuple(field.expression(a) for a in row))
        return Flag(
            extra[:-1] if extra[-1] == extra[-2] else extra,
            tuple(counts[0] - d for d in counts),
            tuple(inside),
            tuple(beyond),
            special=special,
            is_exact=field.is_exact,
            exceptional=tuple(field.exceptional),
            vanishing=tuple(i for i, row in enumerate(self._declared) if not any(row)),
            holonomic_rank=surface.count,
            divisors=field.divisors,
        )

    def _derived(self, here: SolvedForms, first: SolvedForms) -> tuple[SolvedForms, tuple[sympy.Expr, ...]]:
        """The forms theta of `here` with d theta(X, Y) = 0 for X in ker `first`, Y in ker `here`; and where the values
        have a common zero."""
        values: list[Row] = []
        for X, Y in self._pairs(here, first):
            # d theta(X, Y), with a proof that it is not zero unless it is
            row = [self._field.checked(self._raw_curl(theta, X, Y)) for theta in here.rows]
            if any(row):
                values.append(row)
        if not values:
            return here, ()
        solved = self._field.solved(values)
        # Combinations c with c_i = 1, c_pivot = -value
        vanishing = self._field.frame(solved, here.count)
        columns = list(zip(*here.rows, strict=True))
        basis_rows = [[self._field.sum(zip(c, column, strict=True)) for column in columns] for c in vanishing]
        found, field, rank = self._field.solved(basis_rows, self._time), self._field, solved.count
        if rank > 2 or (rank > 1 and len(values) > 12):
            return found, ()
        # The factors all minors of the rank share, where they hold variables: at their zeros the rank is less.
        minors = [a for row in values for a in row]
        if rank == 2:
            pairs = list(combinations(range(len(values[0])), 2))
            minors = [
                field.sum([(r[i], s[j]), (-r[j], s[i])]) for r, s in combinations(values, 2) for i, j in pairs
            ]
        above = [m.numer for m in minors if m]
        common = reduce(lambda a, b: a.gcd(b), above) if above else field.basis.ring.one
        variables = set(self._variables)
        parts = [field.expression(part) for part, _ in common.factor_list()[1]]
        return found, tuple(part for part in parts if part.free_symbols & variables and may_vanish(part))

    def _pairs(self, here: SolvedForms, first: SolvedForms) -> list[tuple[Row, Row]]:
        """Pairs of a frame of ker `first` with one of ker `here`; each pair once where they are one."""
        n = len(self._variables)
        frame = self._field.frame(here, n)
        if here is first:
            return list(combinations(frame, 2))
        return [(X, Y) for X in self._field.frame(first, n) for Y in frame if X != Y]

    def _raw_curl(self, theta: Sequence[FracElement], X: Row, Y: Row) -> FracElement:
        """d theta(X, Y) = sum_k X(theta_k) Y_k - Y(theta_k) X_k."""
        terms = []
        for k, a in enumerate(theta):
            if Y[k]:
                terms.append((self._field.along(X, a), Y[k]))
            if X[k]:
                terms.append((-self._field.along(Y, a), X[k]))
        return self._field.sum(terms)

    def _conditions(self, remainders: tuple[FracElement, ...]) -> Flag:
        """The g of g dt = 0: their factors that may vanish for some time. The short ones come first, and the others are
        what is left of them where those vanish: of a sum of two conditions no factor is seen."""
        own = {self._field.expression(g.numer) for g in remainders}
        divisors, found = tuple(e for e in self._field.divisors if e not in own), list[Demand]()
        variables = set(self._variables) - {self._variables[self._time]}
        before: list[PolyElement] = []
        demanding: set[int] = set()
        for g in sorted(remainders, key=lambda g: len(g.numer)):
            left = g.numer.rem(before)
            if not left:
                continue
            parts = [part for part, _ in left.factor_list()[1]]
            meanings = [self._field.expression(part) for part in parts]
            varying = (k for k, e in enumerate(meanings) if e.free_symbols & variables)
            kept = [k for k in varying if not enclosure.never_vanishes(meanings[k])]
            own_rows = set(self._demanding(None if len(remainders) == 1 else g))
            demanding |= own_rows
            taking_part = own_rows if left == g.numer else demanding
            found.append(Demand(tuple(meanings[k] for k in kept), tuple(sorted(taking_part))))
            before.append(math.prod((parts[k] for k in kept), start=left.ring.one))
        rows = next((one.rows for one in found if not one.factors), self._demanding(None))
        return Flag((), (), (), (), rows, divisors=divisors, conditions=tuple(found))

    def _demanding(self, g: FracElement | None) -> tuple[int, ...]:
        """Rows, as few as dropping one after the other leaves, of which a combination is g dt; g None: any multiple."""
        needed = list(range(len(self._declared)))
        for i in list(needed):
            rest = [j for j in needed if j != i]
            rows = [*self._holonomic, *(self._declared[j] for j in rest)]
            is_demanded = self._time in self._field.solved(rows, self._time).pivots
            if is_demanded and (g is None or any(not g.numer.rem(r.numer) for r in self._field.remainders)):
                needed = rest
        return tuple(needed)
