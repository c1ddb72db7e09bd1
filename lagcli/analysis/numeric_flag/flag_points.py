"""The points that the flag of a block is looked for at: the start, and others that motions from it reach.

What the rows say of a start is what they say along the motions from it, which stay on one sheet of the holonomic rows,
and where the rows keep to (y = 0 under d(y) = y d(x)). By the theorem of Nagano and Sussmann such an orbit is a
manifold, whose tangent space the brackets of all orders span, at nearly all of its points alike; a start is often
special. Points of it are met by going along the rows: a step off them and back could end on another sheet.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from lagcli import doubles, progress
from lagcli.analysis.numeric_flag import spans
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.arrays import Floats
from lagcli.compiled import row_block
from lagcli.compiled.row_block import RowBlock
from lagcli.equations.system import System
from lagcli.linear import decompositions, surface
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows, Sparse
from lagcli.linear.surface import Linearized
from lagcli.start import initial
from lagcli.start.initial import State

Field = Callable[[Floats], Floats | None]


# The reach of one flow, as a part of the sizes of the coordinates, and the difference of its first three extrapolations
# from which on the others would not come down to rounding.
REACH, HOPELESS = 0.1, 1e-3
# Of random directions: a fixed one, so that a verdict does not change.
SEED = 20062


class Points:
    """The start and other points of its orbit, as points of one block; `visited` that were met, the start first. The
    duration of the run bounds how far time goes on. Raises `spans.Undecided` where the rows are not finite at the
    start."""

    def __init__(self, block: RowBlock, system: System, begin: State, deadline: float) -> None:
        size = initial.size(begin.q)
        x = np.append(begin.q[block.columns], [begin.t] if block.has_time else [])
        self.has_switches, block = block.has_kinks, block.on_branch(x, begin.p, doubles.ZERO * size)
        self._block, self._begin, self._deadline = block, begin, deadline
        self._duration = system.model.simulation.duration or 1.0
        self._random = np.random.default_rng(SEED)
        self.start = EvaluationPoint(block, x, begin.p)
        if not self.start.is_finite:
            raise spans.Undecided("the rows are not finite at the start")
        self.visited = [self.start]

    def generic(self) -> EvaluationPoint:
        """The point with the highest ranks; among equals the last, which is no special choice of anyone."""
        count = len(self._block.holonomic) + len(self._block.differential)
        if self.start.all.low < count or self.start.first < len(self.start.differential):
            for _ in range(1 if self.start.rows.is_large else 2):  # one takes long
                there = self.from_point(self.visited[-1])
                if there is None:
                    break
                self.visited.append(there)
        return max(enumerate(self.visited), key=lambda one: (*one[1].ranks, one[1].first, one[0]))[1]

    def both_sides_turn(self) -> bool:
        """True if the brackets of two fields are as many as rows on the sides of the switches that the start lies on:
        of one switch on both, of several on those to which some straight lines through the start lead."""
        if not self._block.has_kinks:
            return True
        x, p = self.start.x, self.start.p
        way = doubles.STEP * initial.size(x)
        lines = [way * decompositions.generic_direction(x.size, seed) for seed in range(4)]
        for away in (side * line for line in lines for side in (1.0, -1.0)):
            block = self._block.on_branch(x + away, p, 0.0)
            here, beyond = EvaluationPoint(block, x, p), EvaluationPoint(block, x + away, p)
            # A row that vanishes on the switch may do so beyond it, or not: the start has no rank of either.
            if not here.is_finite or here.first != len(here.independent) or beyond.all.high > here.all.low:
                return False
        return True

    def state(self, point: EvaluationPoint) -> State:
        """The state of a point; coordinates that are none of the block stay where they are."""
        n = len(self._block.columns)
        q = self._begin.q.copy()
        q[self._block.columns] = point.x[:n]
        t = float(point.x[n]) if self._block.has_time else self._begin.t
        return dataclasses.replace(self._begin, t=t, q=q)

    def from_point(self, point: EvaluationPoint) -> EvaluationPoint | None:
        """The point at the end of a flow along a random field of the kernel of the rows, or None, as where their rank
        is not known. Where the rank is lower at the point than beside it the field is one of the rows that are
        independent there."""
        if point.all.value is None or point.surface.value is None:
            return None  # without a row that counts the flow would leave the orbit
        independent = point.independent
        # The range of each variable: as far as its kind is large, and angles less than one
        n, kinds = len(self._block.columns), self._block.kinds
        values = np.abs(point.x[:n])
        of_kind = np.full(int(kinds.max(initial=0)) + 1, min(float(values.max(initial=0.0)) or 1.0, 1.0))
        np.maximum.at(of_kind, kinds[:n], values)
        ranges = np.full(self._block.size, initial.PARAMETERS.later * self._duration)
        ranges[:n] = REACH * of_kind[kinds[:n]]
        u = self._random.standard_normal(self._block.size)
        size = initial.size(point.x[:n])

        def along(x: Floats) -> Floats | None:
            A, _ = self._block.rows(x, point.p)
            progress.reckon(progress.PARAMETERS.evaluation + progress.PARAMETERS.entry * A.nnz())
            if not np.isfinite(A.nonzeros()).all():
                return None
            return _projected(row_block.scaled(A[independent, :], ranges), u)

        first = along(point.x)
        largest = 0.0 if first is None else float(np.abs(first).max(initial=0.0))
        if first is None or largest < doubles.EPS:
            return None
        # Time goes on.
        sign = -1.0 if self._block.has_time and first[-1] < 0 else 1.0
        best = EvaluationPoint(self._block, point.x, point.p, math.inf)
        rounding = max(doubles.VALUE, doubles.SUM / point.least)
        for k in range(8):  # each a quarter of the one before
            spans.require_time(self._deadline)
            scale = sign * ranges / largest / 4**k
            if self._block.pieces.count:  # on each of which the rows are analytic
                path = _path(along, point.x, scale, 32)
                if path is None or self._block.pieces.end_between(np.array(path), point.p):
                    continue
            x, error = _flow(along, point.x, scale)
            if error > doubles.STEP or error >= best.error:
                continue
            # What rounding alone has moved stands still: else a place that the rows keep to is left.
            x = np.where(np.abs(x - point.x) <= rounding * ranges, point.x, x)
            there = met(self._block, x, point.p, size)
            if there is not None and there.is_finite:
                best = EvaluationPoint(self._block, there.x, point.p, error)
            if best.error <= doubles.VALUE:
                break
        if best.error > doubles.STEP:
            return None
        # The rounding of large terms may allow no more.
        return EvaluationPoint(self._block, best.x, point.p, max(best.error, point.error))


def _projected(A: Sparse, u: Floats) -> Floats:
    """The part of u (N,) in the kernel of rows A."""
    rows = MetricRows(A, Metric.unit(u.size))
    if not rows.count:
        return u
    if rows.is_large:
        return u + rows.correction(np.array(A @ u).ravel())
    Q, _ = decompositions.orthonormal(rows.dense.T)
    v = u - Q @ (Q.T @ u)
    return np.asarray(v - Q @ (Q.T @ v))


def _flow(along: Field, x: Floats, scale: Floats) -> tuple[Floats, float]:
    """x after one unit of dx/ds = scale * along(x), by the extrapolated midpoint rule (Gragg), and its error in parts
    of the scale, infinite where there is no value on the way."""
    table: list[Floats] = []
    error = math.inf
    substeps = range(2, 18, 2)
    for k, count in enumerate(substeps):
        path = _path(along, x, scale, count)
        slope = None if path is None else along(path[-1])
        if path is None or slope is None:
            return x, math.inf
        row = [0.5 * (path[-1] + path[-2] + scale * slope / count)]
        for j in range(1, k + 1):
            factor = (count / substeps[k - j]) ** 2
            row.append(row[-1] + (row[-1] - table[j - 1]) / (factor - 1.0))
        if k:
            error = float(np.abs((row[-1] - row[-2]) / scale).max(initial=0.0))
        table = row
        if error <= doubles.VALUE or (k == 2 and error > HOPELESS):
            break
    return table[-1], error


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
    """The point on f = 0 that Newton's steps in the coordinates reach from x, or None; size: that of x."""
    n, s = len(block.columns), len(block.holonomic)

    def at(q: Floats) -> Linearized | None:
        A, f = block.rows(np.append(q, x[n:]), p)
        here = Linearized(np.array(f).ravel(), A[:s, :n], Metric.unit(n), size)
        return here if here.is_finite else None

    q = surface.nearby(at, x[:n])
    return None if q is None else EvaluationPoint(block, np.append(q, x[n:]), p)
