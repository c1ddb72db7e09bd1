"""Values of expressions at many points at once, in double precision: hints for the exact search, no proof."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import sympy

from lagcli import doubles
from lagcli.linear import surface
from lagcli.pfaffian.exact.guarded import NoAnswerError
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms import notation

Values = npt.NDArray[np.float64]
"""Of shape (points,)."""

# A fixed one: what is found must not change from run to run.
_SEED = 20240317
# Tried in turn: of both signs; positive, for roots and logarithms; above one; below one, for asin and acos.
_RANGES = ((-1.6, 1.6), (0.2, 1.8), (1.1, 3.0), (0.05, 0.9))
# So many points are drawn for each that is needed, where some have no value.
_CROWD = 4


class NoSampleError(NoAnswerError):
    """No points were found at which the expressions have values."""


class Sample:
    """Points, and the values of expressions there; shared subexpressions are computed once."""

    def __init__(self, values: Mapping[sympy.Symbol, Values], count: int) -> None:
        self.count = count
        self._known: dict[sympy.Basic, Values] = dict(values)

    def of(self, expression: sympy.Expr) -> Values:
        """The values (points,); nan where there is no real value. Raises `NoSampleError` for unknown functions."""
        with np.errstate(all="ignore"):
            return self._visit(expression)

    def _visit(self, e: sympy.Basic) -> Values:
        if e in self._known:
            return self._known[e]
        row = notation.ROWS.get(type(e))
        if e.is_number:
            number = e.evalf()
            if not number.is_Number:
                raise NoSampleError(f"{e} is not real")
            found = np.full(self.count, float(number))
        else:
            u = [self._visit(a) for a in e.args]
            if isinstance(e, sympy.Add):
                found = sum(u[1:], u[0])
            elif isinstance(e, sympy.Mul):
                found = np.asarray(np.prod(u, axis=0))
            elif isinstance(e, sympy.Pow):
                found = u[0] ** (int(e.exp) if e.exp.is_Integer else u[1])
            elif row is not None and row.is_elementary:
                found = row.array(*u)
            else:
                raise NoSampleError(f"{type(e).__name__} has no value")
        self._known[e] = found
        return found


def draw(
    expressions: Sequence[sympy.Expr],
    variables: Sequence[sympy.Symbol],
    parameters: Sequence[sympy.Symbol],
    count: int,
    equations: Sequence[sympy.Expr] = (),
) -> Sample:
    """`count` points of the surface of some equations where all expressions are finite. The parameters have the same
    values at all of them, other ones at each point of a surface."""
    ordered = sorted({*variables, *parameters}, key=lambda s: s.name)
    for span in _RANGES:
        for crowd in (1, _CROWD):
            size = (count + 2) * crowd
            generator = np.random.default_rng(_SEED)
            values = {s: generator.uniform(*span, size) for s in ordered}
            if equations:
                values = _projected(values, size, equations, variables)
            else:
                values |= {s: np.full(size, values[s][0]) for s in parameters}
            sample = Sample(values, size)
            good = np.all([np.isfinite(sample.of(e)) for e in expressions], axis=0)
            which = np.flatnonzero(good)[:count]
            if len(which) == count:
                return Sample({s: v[which] for s, v in values.items()}, count)
    raise NoSampleError("no points with values")


def _projected(
    values: dict[sympy.Symbol, Values],
    count: int,
    equations: Sequence[sympy.Expr],
    variables: Sequence[sympy.Symbol],
) -> dict[sympy.Symbol, Values]:
    """The points moved onto the surface by Newton's method; those that do not arrive become nan."""
    gradients = [[forms.partial(f, x) for x in variables] for f in equations]

    def at(points: Values) -> tuple[Values, Values]:
        sample = Sample(values | dict(zip(variables, points.T, strict=True)), count)
        f = np.array([sample.of(e) for e in equations]).T
        return f, np.moveaxis(np.array([[sample.of(e) for e in row] for row in gradients]), 2, 0)

    with np.errstate(all="ignore"):
        moved = surface.nearby_all(at, np.array([values[x] for x in variables]).T, 1.0)[0]
    return values | dict(zip(variables, moved.T, strict=True))


def dependences(rows: Values, lengths: Values) -> tuple[list[int], list[int], Values]:
    """The columns (rows, N) that depend on no earlier ones, those that do but for rounding of their lengths (N,), and c
    with rows[:, dependent] = rows[:, independent] @ c. By Gram and Schmidt, twice for each column."""
    count = rows.shape[1]
    Q = np.zeros((len(rows), min(rows.shape)))
    R = np.zeros((Q.shape[1], count))
    independent: list[int] = []
    dependent: list[int] = []
    for k in range(count):
        rest, n = rows[:, k].copy(), len(independent)
        for _ in range(2):
            part = Q[:, :n].T @ rest
            R[:n, k] += part
            rest = rest - Q[:, :n] @ part
        size = float(np.linalg.norm(rest))
        if size <= doubles.ZERO * lengths[k]:
            dependent.append(k)
        elif n < Q.shape[1]:
            Q[:, n], R[n, k] = rest / size, size
            independent.append(k)
    own = R[: len(independent)]
    return independent, dependent, np.linalg.solve(own[:, independent], own[:, dependent])
