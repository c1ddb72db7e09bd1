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

# How far one flow leads, in parts of the size of the coordinates and of the duration, how often it is shortened, and
# by which factor.
STEP, LATER, SHORTER, FACTOR = 0.1, 0.01, 8, 4
# Substeps of the midpoint rule that are extrapolated; what the last two columns may differ by, in parts of the step.
# Where the first FEW differ by more than HOPELESS, the others would not come down to it.
FEW, HOPELESS = 3, 1e-3
SUBSTEPS, CONVERGED, ROUGHLY = (2, 4, 6, 8, 10, 12, 14, 16), 1e-12, 1e-5
# Newton's steps back to f = 0 must become shorter by this, and end at rounding, in parts of the size.
STEPS, CONTRACTS, MET, STALLED = 10, 0.9, 1e-13, 1e-9
SEED = 20062
# Points of a flow at which it is looked at whether it stays on its piece.
LOOKS = 32

Field = Callable[[Floats], Floats | None]


class ReachablePlaces:
    """Places on the way from a start, of one block; duration: of the run, which bounds how far time goes on."""

    def __init__(self, block: RowBlock, duration: float, deadline: float) -> None:
        self._block, self._deadline, self._duration = block, deadline, duration
        self._random = np.random.default_rng(SEED)

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
        for k in range(SHORTER):
            undecided.require_time(self._deadline)
            scale = sign * ranges / largest / FACTOR**k
            if self._leaves(along, place, scale):
                continue
            x, error = _flow(along, place.x, scale)
            there = met(self._block, x, place.p, size) if error <= ROUGHLY and error < best.error else None
            if there is not None and there.is_finite:
                best = EvaluationPoint(self._block, there.x, place.p, error)
            if best.error <= CONVERGED:
                break
        # The rounding of large terms may allow no more.
        return (
            EvaluationPoint(self._block, best.x, place.p, max(best.error, place.error))
            if best.error <= ROUGHLY
            else None
        )

    def _leaves(self, along: Field, place: EvaluationPoint, scale: Floats) -> bool:
        """True if a flow may leave the piece of the place on which the rows are analytic."""
        pieces = self._block.pieces
        if not pieces.count:
            return False
        path = _path(along, place.x, scale, LOOKS)
        return path is None or pieces.end_between(np.array(path), place.p)

    def _ranges(self, place: EvaluationPoint) -> Floats:
        """The range of each variable (N,): as far as its kind is large, and angles less than one."""
        n = len(self._block.columns)
        found = np.full(self._block.size, LATER * self._duration)
        values = np.abs(place.x[:n])
        least = min(float(values.max(initial=0.0)) or 1.0, 1.0)
        of_kind = np.full(int(self._block.kinds.max(initial=0)) + 1, least)
        np.maximum.at(of_kind, self._block.kinds[:n], values)
        found[:n] = STEP * of_kind[self._block.kinds[:n]]
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
    for k, count in enumerate(SUBSTEPS):
        end = _midpoint(along, x, scale, count)
        if end is None:
            return x, math.inf
        row = [end]
        for j in range(1, k + 1):
            factor = (count / SUBSTEPS[k - j]) ** 2
            row.append(row[-1] + (row[-1] - table[j - 1]) / (factor - 1.0))
        if k:
            error = float(np.abs((row[-1] - row[-2]) / scale).max(initial=0.0))
        table = row
        if error <= CONVERGED or (k + 1 == FEW and error > HOPELESS):
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
    for _ in range(STEPS):
        A, f = block.rows(x, p)
        if not (np.isfinite(A.nonzeros()).all() and np.isfinite(f.nonzeros()).all()):
            return None
        step = MetricRows(A[:s, :n], Metric.unit(n)).correction(np.array(f).ravel())
        length = float(np.abs(step).max(initial=0.0))
        # Of many rows the last steps end at a rounding of their own.
        if length <= MET * size or before <= length <= STALLED * size:
            return EvaluationPoint(block, x, p)
        if not length < before * CONTRACTS:
            return None
        x, before = np.append(x[:n] + step, x[n:]), length
    return None
