"""Linear systems over the constants: which constant combinations of given columns of functions vanish identically.

Values at random points show which columns may take part. These go into an exact system, one equation for each monomial,
over rational functions of the parameters, whose elimination swells: it is solved first in a finite field, with random
numbers for the parameters; then the few columns a solution needs are solved exactly, and tested with every row.
"""

import random
from collections.abc import Sequence
from functools import reduce

import numpy as np
import sympy
from sympy.polys.fields import FracElement
from sympy.polys.rings import PolyElement

from lagcli import doubles
from lagcli.pfaffian.exact import guarded, normal_form, sampling
from lagcli.pfaffian.exact.sampling import Values

Columns = Sequence[Sequence[sympy.Expr]]
_PolyRow = dict[int, PolyElement]  # entries by their columns

# Rows beyond the columns, so that chance makes no null vector.
_EXTRA_POINTS = 12
# Points lie in (-2, 2).
_WIDTH = 2.0

# A fixed one: what is found must not change from run to run.
_SEED = 20240229
# A rank modulo a prime may be too small by chance, about one in 1e18; then the next trial is taken.
_TRIALS = 4
# Trials for values for which all square roots of constants exist: each root halves the chance.
_IMAGES = 60
_PRIMES = tuple(2**61 - n for n in (1, 45, 229, 465, 829, 985, 1153, 1281))
"""Primes that leave the remainder 3 when divided by 4: there a square root is a power."""


def null_vectors(columns: Columns, parameters: frozenset[sympy.Symbol]) -> list[tuple[sympy.Expr, ...]]:
    """A basis of the constants c (rational functions of the parameters) with sum_l c_l columns[l][e] = 0 for all e; the
    last entry that is not zero is 1. Raises `normal_form.NoNormalFormError`."""
    # The columns that may take part in a combination that vanishes
    involved, table = list(range(len(columns))), _samples(columns, parameters)
    if table is not None:
        independent, dependent, c = sampling.dependences(table, np.ones(len(columns)))
        taking_part = np.flatnonzero((np.abs(c) > doubles.ZERO).any(axis=1))
        involved = sorted({*dependent, *(independent[k] for k in taking_part)})
    if not involved:
        return []
    basis = normal_form.NormalForm([entry for n in involved for entry in columns[n]])
    elements = [[basis.element(e) for e in columns[n]] for n in involved]
    fixed = tuple(g for g in basis.letters if basis.means(g).free_symbols <= parameters)
    is_fixed = [g in fixed for g in basis.letters]
    rows: list[_PolyRow] = []
    for equation in zip(*elements, strict=True):
        # One row for each monomial in the letters that are not constant; entries are polynomials in those that are.
        below = reduce(lambda a, b: a.lcm(b), (e.denom for e in equation), basis.ring.one)
        found: dict[tuple[int, ...], dict[int, dict[tuple[int, ...], sympy.Rational]]] = {}
        for column, e in enumerate(equation):
            for powers, number in basis.remainder(e.numer * below.exquo(e.denom)).terms():
                key = tuple(0 if c else p for p, c in zip(powers, is_fixed, strict=True))
                rest = tuple(p if c else 0 for p, c in zip(powers, is_fixed, strict=True))
                found.setdefault(key, {}).setdefault(column, {})[rest] = number
        for entries in found.values():
            rows.append({column: basis.ring.from_dict(entry) for column, entry in entries.items()})
    generator = random.Random(_SEED)
    for _ in range(_TRIALS):
        image = _ModularImage(basis, fixed, generator)
        table_of = [{column: image.number(entry) for column, entry in row.items()} for row in rows]
        images = [{column: value for column, value in row.items() if value} for row in table_of]
        pivots, chosen = _echelon(image.prime, images)
        free = (n for n in range(len(involved)) if n not in pivots)
        vectors = [_exact(basis, rows, pivots, chosen, n) for n in free]
        if all(v is not None for v in vectors):
            written = []
            for v in (v for v in vectors if v is not None):
                entries = {involved[n]: guarded.radsimp(basis.expression(v[n])) for n in sorted(v)}
                written.append(tuple(entries.get(n, sympy.Integer(0)) for n in range(len(columns))))
            return written
    raise normal_form.NoNormalFormError("no exact solution of the linear equations was found")


def _samples(columns: Columns, parameters: frozenset[sympy.Symbol]) -> Values | None:
    """The columns at random points (equations * points, columns), each of length one or zero; None where too few points
    have real values."""
    symbols = sorted(set().union(*(e.free_symbols for c in columns for e in c), set()), key=lambda s: s.name)
    generator = np.random.default_rng(_SEED)
    count = 3 * len(columns) + 4 * _EXTRA_POINTS
    point = {}
    for s in symbols:
        if s in parameters:
            point[s] = np.full(count, generator.uniform(0.3, _WIDTH))
        else:
            # Half of the points lie where logarithms and roots are real.
            values = generator.uniform(-_WIDTH, _WIDTH, count)
            point[s] = np.where(np.arange(count) % 2, values, np.abs(values))
    sample = sampling.Sample(point, count)
    try:
        table = np.array([[sample.of(e) for e in column] for column in columns])
    except sampling.NoSampleError:
        return None
    with np.errstate(all="ignore"):
        table = table.reshape(len(columns), -1).T
        size = np.max(np.abs(table), axis=1, initial=0.0)
        good = np.isfinite(size) & (size < 1e100)
        table = table[good] / np.where(size[good] > 0, size[good], 1.0)[:, None]
        if len(table) < len(columns) + _EXTRA_POINTS:
            return None
        length = np.linalg.norm(table, axis=0)
        return np.asarray(table / np.where(length > 0, length, 1.0))


class _ModularImage:
    """Random values in a finite field for the constant letters, which obey the relations of roots and angles."""

    def __init__(
        self, basis: normal_form.NormalForm, fixed: tuple[sympy.Symbol, ...], generator: random.Random
    ) -> None:
        indices = {g: n for n, g in enumerate(basis.letters)}
        # The squares of letters by the relations; none of a free letter or a higher root
        squares = {g: basis.ring.from_expr(g**2) for g in reversed(fixed)}
        relations = {g: basis.remainder(square) for g, square in squares.items()}
        for trial in range(_IMAGES):
            self.prime = _PRIMES[trial % len(_PRIMES)]
            self.values: dict[int, int] = {}
            for g, relation in relations.items():
                value = None
                if relation != squares[g]:
                    square = self.number(relation)
                    root = pow(square, (self.prime + 1) // 4, self.prime)
                    value = root if root * root % self.prime == square else None
                    if value is None and trial < _IMAGES - 1:
                        break
                self.values[indices[g]] = generator.randrange(2, self.prime) if value is None else value
            else:
                return

    def number(self, polynomial: PolyElement) -> int:
        """The value of a polynomial in the constant letters."""
        total, prime = 0, self.prime
        for powers, number in polynomial.terms():
            term = int(number.numerator) * pow(int(number.denominator), -1, prime)
            for n, p in enumerate(powers):
                if p:
                    term = term * pow(self.values[n], p, prime) % prime
            total += term
        return total % prime


def _echelon(prime: int, rows: Sequence[dict[int, int]]) -> tuple[dict[int, dict[int, int]], list[int]]:
    """The reduced row echelon form in a finite field: its row for each pivot column, and the rows of the matrix that
    span all."""
    pivots: dict[int, dict[int, int]] = {}
    chosen: list[int] = []

    def subtract(row: dict[int, int], other: dict[int, int], times: int) -> None:
        for column, value in other.items():
            rest = (row.get(column, 0) - times * value) % prime
            if rest:
                row[column] = rest
            else:
                row.pop(column, None)

    for n, given in enumerate(rows):
        row = dict(given)
        for column in sorted(row):
            if column in pivots and column in row:
                subtract(row, pivots[column], row[column])
        if not row:
            continue
        lead = min(row)
        scale = pow(row[lead], -1, prime)
        row = {c: v * scale % prime for c, v in row.items()}
        for other in pivots.values():
            if lead in other:
                subtract(other, row, other[lead])
        pivots[lead] = row
        chosen.append(n)
    return pivots, chosen


def _exact(
    basis: normal_form.NormalForm,
    rows: Sequence[_PolyRow],
    pivots: dict[int, dict[int, int]],
    chosen: list[int],
    free: int,
) -> dict[int, FracElement] | None:
    """The null vector with a one in the column `free` as elements of the field, None if it fails a row."""
    support = sorted(lead for lead, row in pivots.items() if free in row)
    prepared = [[rows[n].get(c, basis.ring.zero) for c in (*support, free)] for n in chosen]
    solved = [row for row in prepared if any(row)]
    # Rows with one entry each in the columns of the support, without a division of polynomials
    for n in range(len(support)):
        found = [i for i in range(n, len(solved)) if solved[i][n]]
        if not found:
            return None
        best = min(found, key=lambda i: (len(solved[i][n]), sum(map(len, solved[i]))))
        solved[n], solved[best] = solved[best], solved[n]
        lead = solved[n]
        for i, row in enumerate(solved):
            if i != n and row[n]:
                rest = [basis.remainder(a * lead[n] - b * row[n]) for a, b in zip(row, lead, strict=True)]
                # without the factors its entries share
                common = reduce(lambda a, b: a.gcd(b), rest, basis.ring.zero)
                solved[i] = [entry.exquo(common) for entry in rest] if common else rest
    field = basis.field
    vector = {c: basis.reduced(-field(solved[n][-1]) / field(solved[n][n])) for n, c in enumerate(support)}
    vector[free] = field.one
    for equation in rows:
        parts = [field(entry) * vector[c] for c, entry in equation.items() if c in vector]
        if parts and basis.remainder(sum(parts[1:], parts[0]).numer):
            return None
    return vector
