"""The ground of all checks: the record, what the model says at its rows, and how well each of it is known.

A run is made to a tolerance, so its states are off by delta = rtol |y| + atol. What a quantity gains by that is
measured: everything is evaluated once more at states moved by delta with random signs. A limit is `SAFETY` times
that, and where the motion is differentiated or integrated the bounds of `differences` come on top.
"""

from __future__ import annotations

import dataclasses
import functools
import typing
from collections.abc import Callable, Mapping

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence import differences, table_input
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import WIDE, DifferenceGrid, Estimate, widest
from lagcli.auditing.evidence.laws import LawValues, ModelLaws
from lagcli.auditing.evidence.table_input import AuditedTable, Incidents, Record, TableNames, WrittenDigits
from lagcli.auditing.evidence.virtual_space import VirtualSpace

Made = typing.TypeVar("Made")
SAFETY = 30.0  # a limit is so many times the noise that evaluations at states moved by delta show
RESOLVED = 1e-3  # of a quantity: where the spacing of rows leaves more than that open, nothing is judged
WORSE = 1e6  # a limit grows by no more than that towards a singular configuration
COST = 3e8  # of the singular values of B, in multiplications
# Rows at which positions are moved by their rounding, and how much further: random moves show a part of the largest
# change.
SAMPLES, FURTHER = 9, 4


@dataclasses.dataclass(frozen=True, slots=True)
class Tolerance:
    """The distance a table may have from the laws: the tolerance of the run; the constants by which rows jump where an
    angle passes its cut, by number of the row; the digits of its numbers."""

    rtol: float
    atol: float
    jumps: Mapping[int, tuple[float, ...]] = dataclasses.field(default_factory=dict)
    written: WrittenDigits = table_input.ALL

    def by(self, written: WrittenDigits) -> Tolerance:
        """The tolerance for a table whose numbers have these digits: `SAFETY` times it contains the rounding."""
        share = WIDE / SAFETY  # halves of a unit in the last place: several numbers are rounded in a sum
        rtol, atol = self.rtol + share * written.part, self.atol + share * written.unit
        return Tolerance(rtol, atol, self.jumps, written)


class WholeRun(typing.NamedTuple):
    """All of a run: its table, and its incidents where they are known, with the tolerance of their own table."""

    table: AuditedTable
    incidents: Incidents | None
    of_incidents: Tolerance


class Evidence:
    """The record of a run beside what the model says at its rows. All numbers of the record are finite but lambda.

    whole: the record of which this is a part, which has the sizes to which a run was made; run: None of a part.
    """

    def __init__(
        self,
        laws: ModelLaws,
        record: Record,
        tolerance: Tolerance,
        whole: Record | None = None,
        run: WholeRun | None = None,
    ) -> None:
        self._whole, self.run = whole or record, run
        self.laws, self.record, self.tolerance = laws, record, tolerance
        self.names: TableNames = table_input.names(laws)
        rounding = differences.CLOCK * np.abs(self._whole.t).max(initial=0.0)
        self.clock = rounding + WIDE * tolerance.written.time
        self.grid = DifferenceGrid(record.t, self.clock)
        # A row before an instant is on that side of what jumps there.
        self._t = record.t + 2 * rounding * record.side
        self.values: LawValues = laws.values(self._t, record.q, record.v, record.lam)
        self.masses: Array = laws.index.masses_along
        # How many columns are coordinates, and how many of them are of Cartesian particles
        self.n, self.own = laws.index.n, laws.index.first_generalized
        self.hidden = np.zeros(max(0, len(record.t) - 1), dtype=bool)  # steps with a push that no row shows
        self._random = np.random.default_rng(6)
        self._made: dict[object, object] = {}

    def once(self, make: Callable[[Evidence], Made]) -> Made:
        """The result of a function of this evidence that several checks use: made for the first of them."""
        if make not in self._made:
            self._made[make] = make(self)
        return typing.cast(Made, self._made[make])

    @property
    def is_part(self) -> bool:
        """True of some rows of a run."""
        return self._whole is not self.record

    @property
    def is_seen(self) -> Array:
        """Rows (T, 1) up to which sums over the rows hold all that pushes."""
        return np.concatenate([[True], ~np.logical_or.accumulate(self.hidden)])[:, None]

    @functools.cached_property
    def off_q(self) -> Array:
        """By how much the positions may be off, (n + 3 Nd,)."""
        return self._off(self._whole.q, 2)

    @functools.cached_property
    def off_v(self) -> Array:
        """By how much their rates may be off, (n + 3 Nd,)."""
        return self._off(self._whole.v, 1)

    def _off(self, y: Array, times: int) -> Array:
        """rtol |y| + atol, and what rounded accelerations make in a step, integrated so many times. The components of
        particles have one size in common, each other coordinate its own."""
        apart = np.abs(np.diff(self._whole.t)).max(initial=0.0)  # whose square may be no double
        size = np.abs(y).max(axis=0)
        size[self.n :] = size[self.n :].max(initial=0.0)
        size[: self.own] = max(size[: self.own].max(initial=0.0), size[self.n :].max(initial=0.0))
        off = self.tolerance.rtol * size + self.tolerance.atol
        off[: self.n] += self.force_rounding[1] * apart**times
        return np.asarray(off)

    @functools.cached_property
    def force_rounding(self) -> tuple[Array, Array]:
        """The rounding of forces that balance each other, (n + 3 Nd,), and of the accelerations (n,) that follow: of a
        body at rest it is all there is of its motion. A tolerance follows the size of the motion, and of one that is
        none it is nothing, but forces that cancel push by a part of themselves."""
        laws, record, values, n = self.laws, self.record, self.values, self.n
        if not len(record.t):
            return np.zeros(record.q.shape[1]), np.zeros(n)
        rows = np.unique(np.linspace(0, len(record.t) - 1, min(SAMPLES, len(record.t))).astype(np.int64))
        random = np.random.default_rng(6)
        part = record.part(rows)
        q = part.q[:, :n]
        moved = q * (1 + FURTHER * doubles.SUM * random.choice((-1.0, 1.0), size=q.shape))
        there = laws.values(part.t, moved, part.v, part.lam)

        def largest(y: Array) -> Array:
            return np.asarray(np.abs(np.nan_to_num(y)).max(axis=0, initial=0.0))

        F = doubles.SUM * largest(record.R)
        for name, width in (("V_q", None), ("L_q", n), ("pull", n), ("F", None)):
            whole, shifted = (getattr(at, name)[:, :width] for at in (values, there))
            F[:width] += doubles.SUM * largest(whole) + largest(shifted - whole[rows])
        # The diagonal of the mass matrix at the first row
        M = self.masses.copy()
        t, still, lam = (np.repeat(y[:1], n + 1, axis=0) for y in (part.t, part.q, part.lam))
        unit = np.vstack([np.eye(n), np.zeros((1, n))])
        if laws.model.lagrangian is not None:
            L_v = laws.values(t, still, unit, lam).L_v
            M[:n] += np.abs(np.diagonal(L_v[:n, :n] - L_v[n, :n]))
        if laws.index.dependent.size:
            M[:n] += (self.masses[n:] * laws.displaced(t, still, 0 * unit, unit)[:n] ** 2).sum(axis=1)

        def ratio(y: Array, by: Array) -> Array:
            """y/by, and 0 where `by` is."""
            return np.asarray(np.divide(y, by, out=np.zeros_like(y), where=by > 0))

        # Multipliers are solved for together: what pushes one coordinate is rounded in all, as far as it moves them.
        F = np.maximum(F, ratio(F, np.sqrt(M)).max(initial=0.0) * np.sqrt(M))
        return F, ratio(F, M)[:n]

    @functools.cached_property
    def moved(self) -> tuple[Array, Array]:
        """The states (T, n) each moved by its tolerance."""
        q, v = self.record.q[:, : self.n], self.record.v[:, : self.n]
        # Of unlike sizes, so that they do not cancel in a difference.
        signs = self._random.choice((-1.0, 1.0), size=(2, *q.shape))
        parts = signs * self._random.uniform(0.5, 1.0, (2, *q.shape))
        return q + parts[0] * self.off_q[: self.n], v + parts[1] * self.off_v[: self.n]

    @property
    def moved_rates(self) -> Array:
        """The rates there, with those of dependent particles by the model, (T, n + 3 Nd)."""
        return np.concatenate([self.moved[1], self.moved_values.u], axis=1)

    @functools.cached_property
    def moved_values(self) -> LawValues:
        """The values of the model at those states, at times moved by their rounding: a force may jump at a row."""
        lam, written = self.record.lam, self.tolerance.written
        if written.is_short:
            lam = lam + self._random.choice((-1.0, 1.0), lam.shape) * self.recorded(lam) / SAFETY
        clock = self.clock if not written.time else WIDE / SAFETY * written.time
        ahead = np.where(self.record.side < 0, -clock, clock)
        return self.laws.values(self._t + ahead, *self.moved, lam)

    def recorded(self, y: Array) -> Array:
        """By how much recorded reactions, multipliers or results may be off."""
        written = SAFETY * (self.tolerance.atol if self.tolerance.written.unit else 0.0)
        return np.asarray(SAFETY * self.tolerance.rtol * np.abs(y) + written)

    def noise(self, name: str) -> Array:
        """The noise of one of the `Values`, of its own shape, time first."""
        noise = self.spread(getattr(self.values, name), getattr(self.moved_values, name))
        if self.tolerance.written.is_short and name in ("x", "u"):  # recorded, beside what the model says
            noise = noise + self.recorded((self.record.q if name == "x" else self.record.v)[:, self.n :])
        return noise

    def spread(self, one: Array, moved: Array) -> Array:
        """The noise of any quantity from its values at the states and at the moved ones."""
        flat = np.abs(one - moved).reshape(len(one), int(np.prod(one.shape[1:])))
        usual = np.zeros(flat.shape[1])
        if flat.size:  # nine in ten entries of each column are below: a pole at some rows is not the usual
            known, index = np.where(np.isfinite(flat), flat, 0.0), min(len(flat) - 1, int(0.9 * len(flat)))
            usual = np.partition(known, index, axis=0)[index]
        found = np.maximum(widest(np.nan_to_num(flat)), usual)
        size = np.nan_to_num(np.abs(one).reshape(flat.shape))
        return np.asarray((SAFETY * found + doubles.SUM * size).reshape(one.shape))

    @functools.cached_property
    def momentum_rate(self) -> Estimate:
        """d/dt of dL/dv of the `lagrangian`."""
        return self.grid.derivative(self.values.L_v, self.noise("L_v"))

    @property
    def total_force(self) -> Array:
        """F + R, of coordinates without what dependent particles carry, (T, n + 3 Nd)."""
        return self.values.force(self.record.R)

    @functools.cached_property
    def force_noise(self) -> Array:
        """The noise of forces and potentials, (T, n + 3 Nd)."""
        return np.asarray(self.noise("F") + self.noise("V_q"))

    @property
    def total_noise(self) -> Array:
        """The noise of F, of coordinates with that of the `lagrangian`, (T, n + 3 Nd)."""
        noise = self.force_noise.copy()
        noise[:, : self.n] += self.noise("L_q")[:, : self.n]
        noise[:, : self.own] += self.noise("V_q")[:, : self.own]
        return noise

    @functools.cached_property
    def looked_at(self) -> Array:
        """Rows whose B is taken apart: all, or as many as the size of B allows, evenly, and the first doubtful ones."""
        T, C, n = len(self.record.t), self.laws.C, self.laws.index.n
        most = max(24, int(COST / max(1.0, 4.0 * C * C * n)))
        if most >= T:
            return np.arange(T)
        rows = np.unique(np.linspace(0, T - 1, most).astype(np.int64))
        open_ = np.flatnonzero(np.isnan(self.record.lam).any(axis=1))[:most]
        apart = np.abs(self.record.R[:, : self.n] - self.values.pull) / self._reaction_noise
        doubtful = np.argsort(-np.nan_to_num(apart.max(axis=1)))[: max(4, most // 8)]
        return np.unique(np.concatenate([rows, open_, doubtful]))

    @functools.cached_property
    def _reaction_noise(self) -> Array:
        """The noise of B^T lambda against R in a regular configuration, (T, n)."""
        R = np.abs(self.record.R[:, : self.n])
        noise = self.noise("pull") + doubles.SUM * (R + R.max(initial=0.0)) + self.tolerance.atol
        return np.asarray(noise + (self.recorded(R) if self.tolerance.written.is_short else 0.0))

    @functools.cached_property
    def reaction_limit(self) -> Array:
        """The limit of B^T lambda against R, (T, n): where rows may almost depend on each other R has fewer digits."""
        factor = np.ones(len(self.record.t))
        condition = self.displacements.condition
        usual = float(np.median(condition)) if condition.size else 1.0
        worse = np.nan_to_num(condition / usual, nan=WORSE, posinf=WORSE)
        factor[self.looked_at] = np.clip(worse, 1.0, WORSE)
        noise = self._reaction_noise
        near = (factor > 2)[:, None]
        shared = noise.copy()
        shared[:, : self.own] = noise[:, : self.own].max(axis=1, initial=0.0)[:, None]
        return np.asarray(np.where(near, shared * factor[:, None], noise))

    @functools.cached_property
    def displacements(self) -> VirtualSpace:
        """B and the virtual displacements at the rows looked at."""
        r = self.record.part(self.looked_at)
        return VirtualSpace(self.laws.matrix(r.t, r.q, r.v))

    @property
    def virtual_work(self) -> float:
        """The largest part of R along virtual displacements, at the regular rows that are looked at."""
        d = self.displacements
        along = np.abs(d.virtual(self.record.R[self.looked_at, : self.n]))[~d.is_singular]
        return float(along.max(initial=0.0))

    def pushed(self, F: Array) -> Array:
        """sum_k F_k . dr_k/dq_j of forces on the dependent particles, (T, 3 Nd) to (T, n)."""
        return self.laws.pushed(self.record.t, self.record.q, self.record.v, F)

    def pushed_limit(self, limit: Array) -> Array:
        """Limits pushed alike: with random signs, of which the largest counts."""
        if not limit.size:
            return np.zeros((len(limit), self.n))
        finite = np.where(np.isfinite(limit), limit, 0.0)
        signs = (self._random.choice((-1.0, 1.0), size=limit.shape) for _ in range(3))
        draws = [np.abs(self.pushed(finite * each)) for each in signs]
        return np.asarray(2 * widest(np.maximum.reduce(draws)))
