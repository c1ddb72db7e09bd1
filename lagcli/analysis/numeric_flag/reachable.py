"""Places that motions reach from the start: the orbit of the allowed displacements through it.

What the rows say of a start is what they say along the motions from it. These stay on one sheet of the holonomic
rows, and on a place that the rows keep to (y = 0 under d(y) = y d(x)). By the theorem of Nagano and Sussmann such an
orbit is a manifold, whose tangent space is spanned by the brackets of all orders; at nearly all of its points those
of the order at which they stop to be new suffice. So points of it are met by going along the rows, and by nothing
else: a step off them and back to f = 0 could end on another sheet.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lagcli.analysis.numeric_flag import undecided
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.compiled import variable_sizes
from lagcli.compiled.row_block import RowBlock
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows, Sparse

Floats = npt.NDArray[np.float64]


class FlowParameters:
    """Flows along the fields of the rows; parts are of the sizes of the coordinates.

    None was moved to see which test fails: that is not known.
    """

    __slots__ = ()

    step: float = 0.1
    """How far one flow leads."""
    later: float = 0.01
    """How long one lasts, as a part of the duration."""
    shorter: int = 8
    """How often it is shortened."""
    factor: int = 4
    """By which factor."""
    few: int = 3
    """Where the first so many extrapolations differ by more than `hopeless`, the others would not come down to it."""
    hopeless: float = 1e-3
    """That difference, as a part of the step."""
    substeps: tuple[int, ...] = (2, 4, 6, 8, 10, 12, 14, 16)
    """Substeps of the midpoint rule that are extrapolated."""
    converged: float = 1e-12
    """What the last two columns may differ by, as a part of the step."""
    roughly: float = 1e-5
    """A flow that has come no closer than this is none."""
    steps: int = 10
    """Newton's steps back to f = 0."""
    contracts: float = 0.9
    """They must become shorter by this."""
    met: float = 1e-13
    """And end at rounding, as a part of the size."""
    stalled: float = 1e-9
    """Or, where they stall, at this."""
    seed: int = 20062
    """Of random directions: a fixed one, so that a verdict does not change."""
    looks: int = 32
    """Points of a flow at which it is looked at whether it stays on its piece."""


PARAMETERS = FlowParameters()

Field = Callable[[Floats], Floats | None]


class ReachablePlaces:
    """Places on the way from a start, of one block; duration: of the run, which bounds how far time goes on."""

    def __init__(self, block: RowBlock, duration: float, deadline: float) -> None:
        self._block, self._deadline, self._duration = block, deadline, duration
        self._random = np.random.default_rng(PARAMETERS.seed)

    def from_place(self, place: EvaluationPoint) -> EvaluationPoint | None:
        """The place at the end of a flow along a random field of the kernel of the rows, or None.

        Where the rank is lower at the place than beside it the field is one of the rows that are independent there.
        """
        kept = place.independent
        ranges = self._ranges(place)
        u = self._random.standard_normal(self._block.size)
        size = float(np.abs(place.x[: len(self._block.columns)]).max(initial=0.0)) or 1.0

        def along(x: Floats) -> Floats | None:
            A, _ = self._block.rows(x, place.p)
            if not np.isfinite(A.nonzeros()).all():
                return None
            return _projected(variable_sizes.applied(A[kept, :], ranges), u)

        first = along(place.x)
        largest = 0.0 if first is None else float(np.abs(first).max(initial=0.0))
        if first is None or largest < np.finfo(float).eps:
            return None
        # Time goes on.
        sign = -1.0 if self._block.has_time and first[-1] < 0 else 1.0
        best = EvaluationPoint(self._block, place.x, place.p, math.inf)
        for k in range(PARAMETERS.shorter):
            undecided.require_time(self._deadline)
            scale = sign * ranges / largest / PARAMETERS.factor**k
            if self._leaves(along, place, scale):
                continue
            x, error = _flow(along, place.x, scale)
            there = (
                met(self._block, x, place.p, size)
                if error <= PARAMETERS.roughly and error < best.error
                else None
            )
            if there is not None and there.is_finite:
                best = EvaluationPoint(self._block, there.x, place.p, error)
            if best.error <= PARAMETERS.converged:
                break
        # The rounding of large terms may allow no more.
        return (
            EvaluationPoint(self._block, best.x, place.p, max(best.error, place.error))
            if best.error <= PARAMETERS.roughly
            else None
        )

    def _leaves(self, along: Field, place: EvaluationPoint, scale: Floats) -> bool:
        """True if a flow may leave the piece of the place on which the rows are analytic."""
        pieces = self._block.pieces
        if not pieces.count:
            return False
        path = _path(along, place.x, scale, PARAMETERS.looks)
        return path is None or pieces.end_between(np.array(path), place.p)

    def _ranges(self, place: EvaluationPoint) -> Floats:
        """The range of each variable (N,): as far as its kind is large, and angles less than one."""
        n = len(self._block.columns)
        found = np.full(self._block.size, PARAMETERS.later * self._duration)
        values = np.abs(place.x[:n])
        least = min(float(values.max(initial=0.0)) or 1.0, 1.0)
        of_kind = np.full(int(self._block.kinds.max(initial=0)) + 1, least)
        np.maximum.at(of_kind, self._block.kinds[:n], values)
        found[:n] = PARAMETERS.step * of_kind[self._block.kinds[:n]]
        return found


def _projected(A: Sparse, u: Floats) -> Floats:
    """The part of u (N,) in the kernel of rows A."""
    rows = MetricRows(A, Metric.unit(u.size))
    if not rows.count:
        return u
    if rows.is_large:
        return u + rows.correction(np.array(A @ u).ravel())
    Q, _ = np.linalg.qr(rows.dense.T)
    v = u - Q @ (Q.T @ u)
    return np.asarray(v - Q @ (Q.T @ v))


def _flow(along: Field, x: Floats, scale: Floats) -> tuple[Floats, float]:
    """x after one unit of dx/ds = scale * along(x), by the extrapolated midpoint rule (Gragg), and its error in parts
    of the scale, infinite where there is no value on the way."""
    table: list[Floats] = []
    error = math.inf
    for k, count in enumerate(PARAMETERS.substeps):
        end = _midpoint(along, x, scale, count)
        if end is None:
            return x, math.inf
        row = [end]
        for j in range(1, k + 1):
            factor = (count / PARAMETERS.substeps[k - j]) ** 2
            row.append(row[-1] + (row[-1] - table[j - 1]) / (factor - 1.0))
        if k:
            error = float(np.abs((row[-1] - row[-2]) / scale).max(initial=0.0))
        table = row
        if error <= PARAMETERS.converged or (k + 1 == PARAMETERS.few and error > PARAMETERS.hopeless):
            break
    return table[-1], error


def _midpoint(along: Field, x: Floats, scale: Floats, count: int) -> Floats | None:
    path = _path(along, x, scale, count)
    slope = None if path is None else along(path[-1])
    return None if path is None or slope is None else 0.5 * (path[-1] + path[-2] + scale * slope / count)


def _path(along: Field, x: Floats, scale: Floats, count: int) -> list[Floats] | None:
    """The points of the midpoint rule, None where there is no value on the way."""
    h, path = 1.0 / count, [x]
    for k in range(count):
        slope = along(path[-1])
        if slope is None:
            return None
        path.append(path[-1 if k == 0 else -2] + (h if k == 0 else 2 * h) * scale * slope)
    return path


def met(block: RowBlock, x: Floats, p: Floats, size: float) -> EvaluationPoint | None:
    """The place on f = 0 that a few Newton steps in the coordinates reach from x, or None; size: that of x."""
    n, s = len(block.columns), len(block.holonomic)
    before = math.inf
    for _ in range(PARAMETERS.steps):
        A, f = block.rows(x, p)
        if not (np.isfinite(A.nonzeros()).all() and np.isfinite(f.nonzeros()).all()):
            return None
        step = MetricRows(A[:s, :n], Metric.unit(n)).correction(np.array(f).ravel())
        length = float(np.abs(step).max(initial=0.0))
        # Of many rows the last steps end at a rounding of their own.
        if length <= PARAMETERS.met * size or before <= length <= PARAMETERS.stalled * size:
            return EvaluationPoint(block, x, p)
        if not length < before * PARAMETERS.contracts:
            return None
        x, before = np.append(x[:n] + step, x[n:]), length
    return None
