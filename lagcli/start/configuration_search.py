"""Configurations from far: from several starts, by damped Gauss-Newton steps and by IPOPT, of all rows or of some. A
search without success proves nothing; it says what was tried and the least that remained."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli import doubles, progress
from lagcli.arrays import Flags, Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.frozen import frozen_value
from lagcli.linear import decompositions, metric_rows, rank
from lagcli.linear.metric import Metric, NotDefiniteError
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.start import initial
from lagcli.start.initial import State
from lagcli.start.projection import Reached, Surface

if TYPE_CHECKING:
    from lagcli.compiled.nearest import Problem

Numbers = npt.NDArray[np.intp]


class ConfigurationSearchParameters:
    """Starts from which a configuration is searched. The tests are of `tests/unit/test_numbers_of_other_starts.py` and
    `tests/unit/test_rows_at_infinity.py`."""

    __slots__ = ()

    offsets: tuple[float, ...] = (0.01, 0.1, 0.3, 1.0, 3.0)
    """Other starts lie aside by these parts of the size of what is sought:
    `test_other_starts_lie_aside_by_a_hundredth_to_three_times_the_size`."""
    few: int = 60
    """Coordinates up to which a search takes no time (`test_of_more_coordinates_there_are_fewer_other_starts`)."""
    many: int = 400
    """Those from which on it takes seconds (`test_of_more_coordinates_there_are_fewer_other_starts`)."""
    drift: float = 1e-3
    """Where rows have come to depend on one another a step that goes on by this part of the way has not arrived
    (`test_rows_that_are_met_at_infinity_have_no_configuration`)."""
    far: float = 8.0
    """So many sizes away from the start the rounding of rows that depend on one another may hide that they do not meet
    (`test_rows_that_are_met_at_infinity_have_no_configuration`)."""


PARAMETERS = ConfigurationSearchParameters()
# Other starts are the same ones for the same question.
SEED = 20061


@frozen_value
class ConfigurationResult:
    """The best that a search for some rows has reached, and from how many starts it went out."""

    rows: tuple[int, ...]
    best: Reached
    starts: int
    by_optimization: int = 0

    @property
    def is_on(self) -> bool:
        return self.best.is_on

    @property
    def attempts_text(self) -> str:
        starts = "1 start" if self.starts == 1 else f"{self.starts} starts"
        more = f", and IPOPT from {self.by_optimization}" if self.by_optimization else ""
        return f"damped Gauss-Newton steps from {starts}{more}"


class Search:
    """Searches at the time and the parameters of a state, in the mass metric of its configuration; fixed (n,):
    coordinates that keep their values."""

    def __init__(self, system: System, numeric: NumericSystem, state: State, fixed: Flags) -> None:
        self.system, self.numeric, self.state, self.fixed = system, numeric, state, fixed
        self.M = numeric.inertia(state.t, state.q, state.v, state.p)
        try:
            self.metric, self.full_metric = Metric(self.M, fixed), Metric(self.M)
        except NotDefiniteError:
            from lagcli.compiled import nearest

            self.M = nearest.unit(fixed.size)
            self.metric, self.full_metric = Metric.unit(fixed.size, fixed), Metric.unit(fixed.size)

    def surface(self, rows: Sequence[int] | None = None) -> Surface:
        """The surface of all holonomic rows, or of some."""
        only = None if rows is None else list(rows)
        return Surface(self.numeric, self.state.t, self.state.p, self.metric, only)

    def touched(self, rows: Sequence[int]) -> Flags:
        """True for coordinates (n,) that some rows hold and may move, by structure."""
        B = LocalRows(self.numeric.holonomic(self.state.t, self.state.q, self.state.p)[1])
        flags = np.zeros(self.fixed.size, dtype=bool)
        flags[B.column[np.isin(B.row, list(rows))]] = True
        return flags & ~self.fixed

    def size(self, q: Floats, touched: Flags) -> float:
        """The size of the part of a configuration that some rows hold."""
        largest = 0.0
        if not self.system.model.coordinates:
            for axis in range(3):
                positions = q[axis::3][touched[axis::3]]
                largest = max(largest, float(np.ptp(positions)) if positions.size else 0.0)
        return largest or float(np.abs(q[touched]).max(initial=0.0)) or initial.size(q)

    def neighbours(self, q: Floats, rows: Sequence[int]) -> Iterator[Floats]:
        """Starts beside q, the near ones first; the same for the same question."""
        random = np.random.default_rng(SEED)
        touched = self.touched(rows)
        count = int(touched.sum())
        size = self.size(q, touched)
        for part in PARAMETERS.offsets if count <= PARAMETERS.many else PARAMETERS.offsets[::2]:
            for _ in range(of_size(count, (4, 2, 1))):
                yield q + np.where(touched, part * size, 0.0) * random.standard_normal(q.size)

    def reach(self, rows: Sequence[int], begins: Sequence[Floats]) -> ConfigurationResult:
        """A configuration that satisfies some rows, or the best there is: from `begins`, and from beside the first."""
        best, starts, asked = self.descend(begins[0], rows), 1, 0
        for number, begin in enumerate((*begins, *self.neighbours(begins[0], rows))):
            if number and not best.is_on:
                best, starts = _better(best, self.descend(begin, rows)), starts + 1
            # Round long bends IPOPT goes in fewer steps, each of which takes longer.
            if not best.is_on and (number < len(begins) or number % 5 == 0):
                found, asked = self.optimum(rows, begin, begins[0]), asked + 1
                if found is not None:
                    best = _better(best, self.descend(found, rows))
            if best.is_on:
                break
        return ConfigurationResult(tuple(rows), best, starts, asked)

    def descend(self, begin: Floats, rows: Sequence[int] | None = None) -> Reached:
        """The end of a descent for all holonomic rows or for some, which is on them only where it has arrived there."""
        reached = self.surface(rows).descend(begin)
        recedes = reached.is_on and self._recedes(reached.q, rows)
        return dataclasses.replace(reached, is_on=False, recedes=True) if recedes else reached

    def _recedes(self, q: Floats, only: Sequence[int] | None) -> bool:
        """True if rows come near zero at a configuration as gradients grow or fade, and not because they meet.

        x exp(y) = 1 and x = 0: far off they are one row but for what is left, and a step that undoes that is long.
        y = sqrt(1 + x^2) and y = x: further off nothing is left. tanh(x) = 1: the row is at its limit, and further on.
        """
        rows = list(range(self.system.holonomic_count) if only is None else only)
        begin, surface = self.state.q, self.surface(rows)
        size, moved = initial.size(begin), float(np.abs(q - begin).max(initial=0.0))
        if moved <= PARAMETERS.offsets[0] * size or len(rows) > metric_rows.PARAMETERS.dense:
            return False
        f, B = surface.rows(q)
        before = [surface.rows(there)[1] for there in (begin, next(self.neighbours(begin, rows)))]
        before = [one for one in before if LocalRows(one).are_finite().all()]
        if not before:
            return False
        here, norms = MetricRows(B, self.metric), np.max([LocalRows(one).norms for one in before], axis=0)
        fades = LocalRows(B).norms <= doubles.ZERO * norms
        highest = max(rank.estimate(MetricRows(one, self.metric)).low for one in before)
        is_lower = rank.estimate(here).high < highest
        if not is_lower and not fades.any():
            return False
        given = (self.state.t, q, np.zeros(q.size), self.state.p)
        terms = np.array(self.numeric.row_terms(*given)[0]).ravel()[rows]
        roundings = doubles.SUM * terms
        ahead, _ = surface.values(q + PARAMETERS.offsets[1] * (q - begin))
        if (fades & (np.abs(f) <= roundings) & (np.abs(ahead) <= roundings)).any():
            return True
        sigma, left = decompositions.column_axes(here.dense)
        sigma, limit = np.maximum(sigma, doubles.TINY), PARAMETERS.drift * self.metric.length(q - begin)
        way = np.linalg.norm((left.T @ (f / here.lengths)) / sigma)
        unknown = np.linalg.norm((np.abs(left).T @ (roundings / here.lengths)) / sigma)
        return is_lower and bool(way > limit or (moved > PARAMETERS.far * size and unknown > limit))

    def independent(self, rows: Sequence[int], q: Floats) -> tuple[list[int], Floats] | None:
        """Independent ones of some rows at a configuration, and 1 / |B_i| of each; None where they are not finite."""
        B = self.numeric.holonomic(self.state.t, q, self.state.p)[1][list(rows), :]
        if not LocalRows(B).are_finite().all():
            return None
        from lagcli.linear import independent_rows

        lines = MetricRows(B, self.metric)
        chosen = independent_rows.dependence(lines, rank.estimate(lines).low)
        return [rows[i] for i in chosen.independent], 1.0 / lines.lengths[list(chosen.independent)]

    def optimum(self, rows: Sequence[int], begin: Floats, q0: Floats) -> Floats | None:
        """By IPOPT the configuration (n,) nearest to q0 that satisfies some rows, a local minimum, or None."""
        progress.require_time()
        chosen = self.independent(rows, begin)
        if chosen is None or not chosen[0]:
            return None
        weights = np.zeros(self.system.holonomic_count)
        weights[chosen[0]] = chosen[1]
        given = (self.state.t, self.M, weights, self.state.p)
        return self._problem.solve(begin, q0, given, self.fixed)

    @cached_property
    def _problem(self) -> Problem:
        from lagcli.compiled.nearest import Problem  # here, as most starts are near

        return Problem(self.system, self.M.sparsity())

    def components(self) -> tuple[Numbers, Numbers]:
        """Numbers of the parts that share no free coordinate and no inertia: of the rows (s,), of coordinates (n,)."""
        _, B = self.numeric.holonomic(self.state.t, self.state.q, self.state.p)
        rows, among = LocalRows(B), LocalRows(self.M)
        label = np.arange(self.fixed.size)
        free = ~self.fixed[rows.column]
        first = np.full(rows.count, self.fixed.size, dtype=np.intp)
        while True:
            before = label.copy()
            first[:] = self.fixed.size
            np.minimum.at(first, rows.row[free], label[rows.column[free]])
            np.minimum.at(label, rows.column[free], first[rows.row[free]])
            np.minimum.at(label, among.row, label[among.column])
            label = label[label]
            if (label == before).all():
                return first, label


def of_size(count: int, values: tuple[int, int, int]) -> int:
    """The value of few coordinates, of more, or of many, for so many."""
    few, more, many = values
    return few if count <= PARAMETERS.few else more if count <= PARAMETERS.many else many


def _better(one: Reached, other: Reached) -> Reached:
    return other if other.is_on or other.worst < one.worst else one


def tangential(rows: Sparse, metric: Metric, step: Floats) -> float:
    """The part of a step (n,) along the kernel of rows (C, n), as a part of its length: 0 for one in M^-1 B^T."""
    length = metric.length(step)
    if length == 0.0:
        return 0.0
    lines = MetricRows(rows, metric)
    for _ in range(2):  # the second pass removes the rounding of the first
        step = step + lines.correction(LocalRows(rows).times(step))
    return metric.length(step) / length
