"""Linear systems over the constants: which constant combinations of given columns of functions vanish
identically.

Most columns take part in no such combination: the values of all columns at random points show which do, to
rounding error. The others go into an exact system, one equation for each monomial. Its constants are rational
functions of the parameters, whose elimination swells, so it is solved first in a finite field, with random numbers
for the parameters; then the few columns a solution needs are solved exactly, and every row is tested with it.
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
    """A basis of the constants c (rational functions of the parameters) with sum_l c_l columns[l][e] = 0 for
    all e.

    Found by comparing coefficients in the normal form. The last entry of a vector that is not zero is 1.
    Raises `normal_form.NoNormalFormError`.
    """
    involved = _involved(columns, parameters)
    size, vectors = len(columns), _null_vectors([columns[n] for n in involved], parameters)
    return [tuple(_spread(vector, involved, size)) for vector in vectors]


def _spread(vector: Sequence[sympy.Expr], indices: Sequence[int], size: int) -> list[sympy.Expr]:
    spread = [sympy.Integer(0)] * size
    for index, entry in zip(indices, vector, strict=True):
        spread[index] = entry
    return spread


def _involved(columns: Columns, parameters: frozenset[sympy.Symbol]) -> list[int]:
    """The indices of the columns that may take part in a combination that vanishes."""
    table = _samples(columns, parameters)
    if table is None:
        return list(range(len(columns)))
    pivots: list[int] = []
    involved: set[int] = set()
    # Gram and Schmidt, twice for each column: orthogonal = table[:, pivots] @ combined.
    orthogonal, combined = np.zeros((len(table), 0)), np.zeros((0, 0))
    for n, column in enumerate(table.T):
        weights = orthogonal.T @ column
        rest = column - orthogonal @ weights
        again = orthogonal.T @ rest
        weights, rest = combined @ (weights + again), rest - orthogonal @ again
        length = float(np.sqrt(rest @ rest))
        if length > doubles.ZERO:
            orthogonal = np.column_stack([orthogonal, rest / length])
            combined = np.block(
                [
                    [combined, -weights[:, None] / length],
                    [np.zeros((1, len(pivots))), np.full((1, 1), 1 / length)],
                ]
            )
            pivots.append(n)
        else:
            involved |= {
                n,
                *(p for p, weight in zip(pivots, weights, strict=True) if abs(weight) > doubles.ZERO),
            }
    return sorted(involved)


def _samples(columns: Columns, parameters: frozenset[sympy.Symbol]) -> Values | None:
    """The columns at random points, shape (equations * points, columns), each of length one or zero.

    None where too few points have real values.
    """
    symbols = sorted(set().union(*(e.free_symbols for c in columns for e in c), set()), key=lambda s: s.name)
    generator = np.random.default_rng(_SEED)
    count = 3 * len(columns) + 4 * _EXTRA_POINTS
    point = {
        s: np.full(count, generator.uniform(0.3, _WIDTH))
        if s in parameters
        else generator.uniform(-_WIDTH, _WIDTH, count)
        for s in symbols
    }
    # Half of the points lie where logarithms and roots are real.
    half = {
        s: v if s in parameters else np.where(np.arange(count) % 2, v, np.abs(v)) for s, v in point.items()
    }
    sample = sampling.Sample(half, count)
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


def _null_vectors(columns: Columns, parameters: frozenset[sympy.Symbol]) -> list[tuple[sympy.Expr, ...]]:
    if not columns:
        return []
    basis = normal_form.NormalForm([entry for column in columns for entry in column])
    table = [[basis.element(e) for e in column] for column in columns]
    fixed = tuple(g for g in basis.letters if basis.means(g).free_symbols <= parameters)
    rows: list[_PolyRow] = []
    for equation in zip(*table, strict=True):
        rows += _coefficient_rows(basis, equation, fixed)
    generator = random.Random(_SEED)
    for _ in range(_TRIALS):
        image = _ModularImage(basis, fixed, generator)
        echelon = _Echelon(image.prime, [image.row(row) for row in rows])
        vectors = [_exact(basis, rows, echelon, n) for n in range(len(columns)) if n not in echelon.pivots]
        if all(v is not None for v in vectors):
            return [_written(basis, v, len(columns)) for v in vectors if v is not None]
    raise normal_form.NoNormalFormError("no exact solution of the linear equations was found")


def _coefficient_rows(
    basis: normal_form.NormalForm, equation: Sequence[FracElement], fixed: tuple[sympy.Symbol, ...]
) -> list[_PolyRow]:
    """One row for each monomial in the letters that are not constant; entries are polynomials in `fixed`."""
    below = reduce(lambda a, b: a.lcm(b), (e.denom for e in equation), basis.ring.one)
    above = [basis.remainder(e.numer * below.exquo(e.denom)) for e in equation]
    constant = [g in fixed for g in basis.letters]
    rows: dict[tuple[int, ...], dict[int, dict[tuple[int, ...], sympy.Rational]]] = {}
    for column, polynomial in enumerate(above):
        for powers, number in polynomial.terms():
            key = tuple(0 if c else p for p, c in zip(powers, constant, strict=True))
            rest = tuple(p if c else 0 for p, c in zip(powers, constant, strict=True))
            rows.setdefault(key, {}).setdefault(column, {})[rest] = number
    return [{column: basis.ring.from_dict(entry) for column, entry in row.items()} for row in rows.values()]


class _ModularImage:
    """Random values in a finite field for the constant letters, which obey the relations of roots and
    angles.
    """

    def __init__(
        self, basis: normal_form.NormalForm, fixed: tuple[sympy.Symbol, ...], generator: random.Random
    ) -> None:
        self._indices = {g: n for n, g in enumerate(basis.letters)}
        relations = {g: _relation(basis, g) for g in reversed(fixed)}
        for trial in range(_IMAGES):
            self.prime = _PRIMES[trial % len(_PRIMES)]
            self.values: dict[int, int] = {}
            for g, relation in relations.items():
                value = self._root(relation) if relation is not None else None
                if value is None and relation is not None and trial < _IMAGES - 1:
                    break
                self.values[self._indices[g]] = generator.randrange(2, self.prime) if value is None else value
            else:
                return

    def _root(self, square: PolyElement) -> int | None:
        value = self.number(square)
        root = pow(value, (self.prime + 1) // 4, self.prime)
        return root if root * root % self.prime == value else None

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

    def row(self, row: _PolyRow) -> dict[int, int]:
        """The entries of the row that are not zero."""
        found = {column: self.number(entry) for column, entry in row.items()}
        return {column: value for column, value in found.items() if value}


def _relation(basis: normal_form.NormalForm, letter: sympy.Symbol) -> PolyElement | None:
    """The square of the letter by the relations; None where it is a free letter or a higher root."""
    square = basis.ring.from_expr(letter**2)
    found = basis.remainder(square)
    return found if found != square else None


class _Echelon:
    """The reduced row echelon form in a finite field.

    `pivots` tells for each pivot column the row of the echelon form, `chosen` the rows of the matrix that span
    all rows.
    """

    def __init__(self, prime: int, rows: Sequence[dict[int, int]]) -> None:
        self.prime = prime
        self.pivots: dict[int, dict[int, int]] = {}
        self.chosen: list[int] = []
        for n, row in enumerate(rows):
            if self._add(dict(row)):
                self.chosen.append(n)

    def _add(self, row: dict[int, int]) -> bool:
        for column in sorted(row):
            if column in self.pivots and column in row:
                self._subtract(row, self.pivots[column], row[column])
        if not row:
            return False
        lead = min(row)
        scale = pow(row[lead], -1, self.prime)
        row = {c: v * scale % self.prime for c, v in row.items()}
        for other in self.pivots.values():
            if lead in other:
                self._subtract(other, row, other[lead])
        self.pivots[lead] = row
        return True

    def _subtract(self, row: dict[int, int], other: dict[int, int], times: int) -> None:
        for column, value in other.items():
            rest = (row.get(column, 0) - times * value) % self.prime
            if rest:
                row[column] = rest
            else:
                row.pop(column, None)

    def support(self, free: int) -> list[int]:
        """The pivot columns a null vector with a one in the free column needs."""
        return sorted(lead for lead, row in self.pivots.items() if free in row)


def _exact(
    basis: normal_form.NormalForm, rows: Sequence[_PolyRow], echelon: _Echelon, free: int
) -> dict[int, FracElement] | None:
    """The null vector with a one in the column `free` as elements of the field, None if it fails a row."""
    support = echelon.support(free)
    prepared = [[rows[n].get(c, basis.ring.zero) for c in (*support, free)] for n in echelon.chosen]
    solved = _eliminated(basis, [row for row in prepared if any(row)], len(support))
    if solved is None:
        return None
    field = basis.field
    vector = {c: basis.reduced(-field(solved[n][-1]) / field(solved[n][n])) for n, c in enumerate(support)}
    vector[free] = field.one
    for row in rows:
        parts = [field(entry) * vector[c] for c, entry in row.items() if c in vector]
        if parts and basis.remainder(sum(parts[1:], parts[0]).numer):
            return None
    return vector


def _eliminated(
    basis: normal_form.NormalForm, rows: list[list[PolyElement]], count: int
) -> list[list[PolyElement]] | None:
    """`count` rows with one entry each in the first `count` columns, without a division of polynomials."""
    for n in range(count):
        found = [i for i in range(n, len(rows)) if rows[i][n]]
        if not found:
            return None
        best = min(found, key=lambda i: (len(rows[i][n]), sum(map(len, rows[i]))))
        rows[n], rows[best] = rows[best], rows[n]
        lead = rows[n]
        for i, row in enumerate(rows):
            if i != n and row[n]:
                rest = [basis.remainder(a * lead[n] - b * row[n]) for a, b in zip(row, lead, strict=True)]
                rows[i] = _stripped(basis, rest)
    return rows[:count]


def _stripped(basis: normal_form.NormalForm, row: list[PolyElement]) -> list[PolyElement]:
    """The row without the factors its entries share."""
    common = reduce(lambda a, b: a.gcd(b), row, basis.ring.zero)
    return [entry.exquo(common) for entry in row] if common else row


def _written(
    basis: normal_form.NormalForm, vector: dict[int, FracElement], size: int
) -> tuple[sympy.Expr, ...]:
    return tuple(
        guarded.radsimp(basis.expression(vector[n])) if n in vector else sympy.Integer(0) for n in range(size)
    )
