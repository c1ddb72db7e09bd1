"""The equations of a point of rest with a choice of closed contacts, as one residual of one vector of unknowns.

x is q followed by the multipliers at each time; the residual holds the forces, then the conditions, then the contacts.
Forces are measured in units of the largest there is, conditions by their gradients, so that one norm serves for all.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.equations.power_series import PowerSeries, UnderflowError, constant
from lagcli.errors import diagnostics
from lagcli.linear import decompositions
from lagcli.statics.static_problem import StaticProblem

# Of a unit: terms that are smaller vanish by accident, curvatures may be none, and zeros of a flat function are one.
SMALL = math.sqrt(doubles.ROOT)
# Of the size of things: the last step to a point, 1e-8 where a zero is double.
SETTLED = 10 * doubles.ROOT
# Curvatures of this part of the largest are zero: a chain of n links has some of 1/n^2.
FLAT = 100 * doubles.ZERO
# Sizes of things: what goes down farther goes down for ever.
FAR = 1 / SMALL


class LengthParameters:
    """Parts of the size of things. The tests are of `tests/unit/test_numbers_of_rest_searches.py`,
    `tests/unit/test_numbers_of_statics.py` and `tests/unit/test_precise_zeros.py`."""

    __slots__ = ()

    near: float = 1e-2
    """How far a point may be moved that is known to a part of its digits, and a step that tells a continuum: far above
    the digits of a point that is alone and degenerate. `test_a_point_is_not_moved_by_more_than_a_hundredth` and
    `test_a_continuum_is_told_by_a_step_of_a_hundredth` fail at 0.001 and 0.1."""
    stride: float = 0.3
    """The longest step downhill and along a path, and how far off the zero may be that a point stands for: farther off
    the linear equations say nothing. `test_a_zero_far_away_is_another_one` fails at 0.03 and 3."""
    walk: float = 0.2
    """The longest step of a walk along a continuum. `test_circles_that_meet_are_one_continuum` of
    `tests/physics/test_statics_proofs.py` fails at 0.02 and 2."""


LENGTHS = LengthParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """Units: of force, of length, and the gradients of conditions (k,) and of contacts (K,); forces (n,): of all
    coordinates that act on each other, so that light bodies are no rounding of heavy ones; own (n,): of each alone."""

    force: float
    length: float
    conditions: Floats
    contacts: Floats
    forces: Floats
    own: Floats

    @property
    def touch(self) -> Floats:
        """The gaps (K,) of contacts up to which they are closed."""
        return np.asarray(doubles.ZERO * self.contacts * self.length)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class EquilibriumPoint:
    """q (n,), lambda (C + K,) at the start time, closed contacts, largest |F + B^T lambda|, |c|, |g| of these; where
    a search found nothing the place with the least residual, and `rests` is False."""

    q: Floats
    lam: Floats
    closed: tuple[int, ...]
    residual: float
    rests: bool = True


class RestEquations:
    """The equations with some contacts closed, or, where `closed` is None, with 0 <= lambda complementary to g >= 0.

    The latter by Fischer and Burmeister: lambda + g - sqrt(lambda^2 + g^2) = 0, in units of force and length.
    """

    def __init__(self, problem: StaticProblem, closed: tuple[int, ...] | None, scales: Scales) -> None:
        self.problem, self.closed, self.scales = problem, closed, scales
        self.contacts = list(range(problem.K)) if closed is None else list(closed)
        self.rows = problem.C + len(self.contacts)
        self.size = problem.n + self.rows * len(problem.times)

    def closing(self, closed: tuple[int, ...] | None) -> RestEquations:
        """The same with other contacts closed."""
        return RestEquations(self.problem, closed, self.scales)

    def all_multipliers(self, multipliers: Floats) -> Floats:
        """lambda of all rows (C + K,) from those of the rows that act."""
        return self.problem.whole(self.contacts, multipliers)

    def split(self, x: Floats) -> tuple[Floats, list[Floats]]:
        """q, and lambda of the rows that act at each time."""
        n, m = self.problem.n, self.rows
        return x[:n], [x[n + k * m : n + (k + 1) * m] for k in range(len(self.problem.times))]

    def of_point(self, point: EquilibriumPoint) -> Floats:
        """q and lambda of the rows that act at a point, at the start time."""
        return np.concatenate([point.q, point.lam[self.problem.acting(self.contacts)]])

    def placed(self, point: EquilibriumPoint, x: Floats) -> EquilibriumPoint:
        """The point with these q and lambda."""
        n = self.problem.n
        return dataclasses.replace(point, q=x[:n], lam=self.all_multipliers(x[n : n + self.rows]))

    def __call__(self, x: Floats) -> tuple[Floats, Floats] | None:
        """The residual and its gradient; None where a value is not finite."""
        q, each = self.split(x)
        residuals, gradients = [], []
        for number, (t, lam) in enumerate(zip(self.problem.times, each, strict=True)):
            values = self.problem.at(t, q, self.all_multipliers(lam))
            G, g = values.G[self.contacts], values.g[self.contacts]
            if not values.finite or not np.isfinite(G).all() or not np.isfinite(g).all():
                return None
            s, C, units = self.scales, self.problem.C, self.scales.contacts[self.contacts]
            contact, by_q = g / units, G / units[:, None]
            by_lam = np.zeros((g.size, self.rows))
            if self.closed is None:
                push = lam[C:] * units / s.force * s.length
                # a + b - sqrt(a^2 + b^2) with its derivatives; at the corner those of a = b
                root = np.hypot(contact, push)
                along_g, along_lam = (
                    np.where(root > doubles.TINY, 1 - part / np.maximum(root, doubles.TINY), 1 - np.sqrt(0.5))
                    for part in (contact, push)
                )
                contact = contact + push - root
                by_q = along_g[:, None] * by_q
                by_lam[:, C:] = np.diag(along_lam * units / s.force * s.length)
            rows = values.rows(self.contacts)
            residuals += [(values.F + rows.T @ lam) / s.forces, values.c / s.conditions, contact]
            zeros = np.zeros((values.c.size, self.rows))
            first, count = self.problem.n + number * self.rows, values.F.size + values.c.size + g.size
            gradient = np.zeros((count, self.size))
            slopes = [values.K / s.forces[:, None], values.dc / s.conditions[:, None], by_q]
            gradient[:, : self.problem.n] = np.vstack(slopes)
            gradient[:, first : first + self.rows] = np.vstack([rows.T / s.forces[:, None], zeros, by_lam])
            gradients.append(gradient)
        return np.concatenate(residuals), np.vstack(gradients)

    def multipliers(self, q: Floats) -> list[Floats] | None:
        """The least-norm multipliers that come closest to balance at q, at each time."""
        found = []
        for t in self.problem.times:
            values = self.problem.at(t, q, self.problem.nothing)
            rows = values.rows(self.contacts)
            if not np.isfinite(rows).all() or not np.isfinite(values.F).all():
                return None
            lengths = np.linalg.norm(rows, axis=1) + doubles.TINY
            unit = rows / lengths[:, None]
            found.append(decompositions.least_squares(unit.T, -values.F) / lengths)
        return found

    def begun(self, q: Floats) -> Floats | None:
        """The unknowns at a configuration with the multipliers that come closest to balance; None without a value."""
        each = self.multipliers(q)
        return None if each is None else np.concatenate([q, *each])

    def unknowns(self, q: Floats) -> Floats:
        """The same at a point that was found."""
        x = self.begun(q)
        assert x is not None
        return x

    def settled(self, x: Floats, step: float = 0.0) -> EquilibriumPoint:
        """The point where a search ended with a step, if it is one; without a step the point as it is given."""
        problem, contacts = self.problem, self.contacts
        q, each = self.split(x)
        lam = self.all_multipliers(each[0])
        values = problem.at(problem.t, q, lam)
        parts = [values.F + values.rows(contacts).T @ each[0], values.c, values.g[contacts]]
        residual = float(max(np.abs(part).max(initial=0.0) for part in parts))
        is_point = step <= SETTLED and self.unbalanced(x) <= doubles.ZERO
        # A point of rest is one at further times too.
        for t in problem.later if is_point else ():
            values = problem.at(t, q, problem.nothing)
            left = decompositions.residual(values.rows(contacts).T, values.F) / self.scales.force
            apart = values.c / (self.scales.conditions * self.scales.length)
            is_point &= bool(np.abs(np.concatenate([left, apart])).max(initial=0.0) <= 10 * doubles.ZERO)
        residual = residual if np.isfinite(residual) else np.inf
        return EquilibriumPoint(q.copy(), lam, tuple(contacts), residual, is_point)

    def touching(self, point: EquilibriumPoint) -> tuple[int, ...]:
        """The contacts that touch at a point, those that carry nothing included."""
        near = np.flatnonzero(self.problem.at(self.problem.t, point.q, point.lam).g <= self.scales.touch)
        return tuple(sorted({*point.closed, *near.tolist()}))

    def wrong_side(self, point: EquilibriumPoint) -> tuple[set[int], set[int]]:
        """The contacts that pull at a point, and the open ones behind whose surface it lies."""
        g, scales = self.problem.at(self.problem.t, point.q, point.lam).g, self.scales
        lam, least = point.lam[self.problem.C :], -doubles.ZERO * scales.force
        pulling = {k for k in point.closed if lam[k] * scales.contacts[k] < least}
        return pulling, set(np.flatnonzero(~(g >= -scales.touch)).tolist()) - set(point.closed)

    def unbalanced(self, x: Floats) -> float:
        """The largest residual as a part of the terms that make it up: forces and conditions."""
        (q, each), scales = self.split(x), self.scales
        worst = 0.0
        for t, lam in zip(self.problem.times, each, strict=True):
            values = self.problem.at(t, q, self.all_multipliers(lam))
            rows = values.rows(self.contacts)
            # Each component by its own terms: where a multiplier grows without bound, others hide what is left.
            widths = np.where(rows != 0, np.linalg.norm(rows, axis=1, keepdims=True) * SMALL, 0.0)
            terms = np.abs(values.F) + (np.maximum(np.abs(rows), widths) * np.abs(lam)[:, None]).sum(axis=0)
            parts = np.maximum(terms, np.maximum(scales.own * SMALL, scales.forces * SMALL**2) + doubles.TINY)
            # What the last digit of the coordinates moves is balanced: in a flat cloth nothing else acts sideways.
            # Beside a pole that is no rounding.
            blur = np.minimum(doubles.EPS * (np.abs(values.K) @ np.abs(q)), scales.forces * SMALL**3)
            left = np.maximum(np.abs(values.F + rows.T @ lam) - blur, 0.0)
            worst = max(worst, (left / parts).max(initial=0.0))
            # And where it grows so far that its rounding is a force, nothing is balanced.
            largest = max(scales.force, float(np.abs(values.F).max(initial=0.0)))
            worst = max(worst, doubles.EPS * float(terms.max(initial=0.0)) / largest)
            size = max(scales.length, float(np.abs(q).max(initial=0.0)))
            lengths = np.linalg.norm(values.dc, axis=1) + scales.conditions * SMALL
            worst = max(worst, (np.abs(values.c) / (lengths * size)).max(initial=0.0))
            if self.closed is not None:
                closed = values.g[self.contacts] / scales.contacts[self.contacts]
                worst = max(worst, np.abs(closed).max(initial=0.0) / size)
        return float(worst)

    def sizes(self, x: Floats) -> Floats:
        """The sizes of unknowns at one time: of coordinates no less than that of things."""
        n = self.problem.n
        return np.concatenate([np.maximum(np.abs(x[:n]), self.scales.length), np.abs(x[n:])])

    def series(self, x: Floats, sizes: Floats, rounding: float) -> list[PowerSeries]:
        """The equations at the start time where x and the sizes of their terms are series (unknowns, orders). Raises
        `UnderflowError`."""
        problem, count = self.problem, x.shape[1]
        unknowns = [PowerSeries(*pair) for pair in zip(x, sizes, strict=True)]
        fixed = [constant(value, count) for value in (problem.t, *problem.p.tolist())]
        return problem.balance_series(tuple(self.contacts)).at([unknowns, fixed], count, rounding)[0]

    def rounding(self, x: Floats) -> float:
        """What rounding leaves of the forces by the sizes of their terms, a part of the largest; 0 where not known."""
        if self.closed is None or len(self.problem.times) > 1:
            return 0.0
        n, problem = self.problem.n, self.problem
        try:
            forces = self.series(x[:, None], self.sizes(x)[:, None], doubles.EPS)[:n]
        except UnderflowError:
            return 0.0
        if any(not each.known for each in forces):
            return 0.0
        F = problem.at(problem.t, x[:n], problem.nothing).F
        largest = max(self.scales.force, float(np.abs(F).max(initial=0.0)))
        return doubles.EPS * max(float(each.size[-1]) for each in forces) / largest


def scales(problem: StaticProblem, q: Floats) -> Scales:
    """Units from a point and from some beside it: none of them may vanish by accident.

    Raises `diagnostics.ModelError` where their squares are no doubles: all norms here are made of them.
    """
    random = np.random.default_rng(1)
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    forces, stiffnesses, linked = np.zeros(q.size), np.zeros(q.size), np.eye(q.size, dtype=bool)
    conditions, contacts = np.zeros(problem.laws.c.numel()), np.zeros(problem.K)
    for part in (0.0, 0.03, 0.1):
        point = q + part * size * random.standard_normal(q.size)
        values = problem.at(problem.t, point, problem.nothing)
        forces = np.fmax(forces, np.where(np.isfinite(values.F), np.abs(values.F), 0.0))
        K = np.where(np.isfinite(values.K), np.abs(values.K), 0.0)
        stiffnesses = np.fmax(stiffnesses, K.max(axis=1, initial=0.0))
        linked |= values.K != 0
        for row in (*values.B, *values.dc, *values.G):
            linked[np.ix_(row != 0, row != 0)] = True
        with np.errstate(over="ignore", invalid="ignore"):
            conditions = np.fmax(conditions, np.hypot.reduce(values.dc, axis=1))
            contacts = np.fmax(contacts, np.hypot.reduce(values.G, axis=1))
    conditions[~(conditions > 0)], contacts[~(contacts > 0)] = 1.0, 1.0
    force = float(forces.max(initial=0.0)) or float(stiffnesses.max(initial=0.0)) * size or 1.0
    own = np.maximum(forces, stiffnesses * size)
    count, order, ends = ca.sparsify(ca.DM(linked.astype(float))).sparsity().scc()
    groups, together = [order[a:b] for a, b in itertools.pairwise(ends)], np.full(q.size, force)
    for group in groups if count > 1 else ():
        together[group] = float(forces[group].max()) or float(own[group].max()) or force
    least, most = np.sqrt([np.finfo(float).tiny, np.finfo(float).max])
    for what, units in (
        ("forces", np.array([force])),
        ("coordinates", np.array([size])),
        ("gradients of constraints", conditions),
        ("gradients of contacts", contacts),
    ):
        beyond = units[(units < least) | (units > most)]
        if beyond.size:
            message = f"the search cannot work with {what} of the size {beyond[0]:.3g}: their squares are no numbers"
            hint = "choose units in which the numbers of the model are nearer to 1"
            place = diagnostics.Location(problem.laws.path, 1, 1)
            raise diagnostics.error("not-finite-at-start", message, place, hint)
    return Scales(force, size, conditions, contacts, together, own)
