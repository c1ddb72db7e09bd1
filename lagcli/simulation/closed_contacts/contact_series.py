"""Contacts of which neither the force nor d2g/dt2 is above zero: the first of their derivatives that is decides.

Along the motion 0 <= lambda(t) ⊥ d2g/dt2(t) >= 0. Where both are power series of the time, the coefficients of the
contacts that are undecided so far obey the same problem at every order, with the same matrix: that of (D.24) with the
contacts that press as equations. The leading coefficients decide, lexicographically.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.contact import impact_law
from lagcli.equations import power_series
from lagcli.equations.power_series import PowerSeries, SeriesFunction
from lagcli.linear import rank
from lagcli.linear.metric_rows import MetricRows, Sparse, sparse, stacked
from lagcli.simulation.closed_contacts.contact_change import ContactForces
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, Flags, Floats, Numbers


class ContactSeriesParameters:
    """Power series of a motion at an instant.

    The tests are of `tests/unit/test_contact_series.py`.
    """

    __slots__ = ()

    orders: int = 12
    """Coefficients of forces that are looked at: a load of t^11 decides still. `test_loads_of_a_high_power_decide`."""
    roundings: float = 32.0
    """A coefficient is zero where it is so many roundings of its terms.
    `test_a_coefficient_of_a_few_roundings_is_none`."""


PARAMETERS = ContactSeriesParameters()


class MotionSeries:
    """The forces, rows and inertia of one system as power series along a motion."""

    def __init__(self, numeric: NumericSystem) -> None:
        # With all contacts open.
        self._numeric = numeric

    @cached_property
    def _function(self) -> SeriesFunction:
        return SeriesFunction(self._numeric.contact_motion)

    @cached_property
    def patterns(self) -> list[tuple[Numbers, Numbers, tuple[int, int]]]:
        """Rows, columns and shape of M, B and G."""
        numeric = self._numeric
        found = []
        for sparsity in (
            numeric.inertia.sparsity_out(0),
            numeric.rows.sparsity_out(0),
            numeric.contacts.sparsity_out(1),
        ):
            rows, columns = sparsity.get_triplet()
            found.append((np.asarray(rows, np.intp), np.asarray(columns, np.intp), sparsity.shape))
        return found

    def at(self, here: ContactInstant, a: list[Floats], rounding: float) -> tuple[list[_Terms], int]:
        """The results of `NumericSystem.contact_motion` where a_0, a_1, ... are the accelerations, and none beyond, and
        how many coefficients were asked for.

        All coefficients are made while nothing moves, for they stay the same, and where a switch asks for the first
        that is not zero; else those up to the order after the accelerations.
        """
        s = here.state
        n, moves = s.q.size, s.v.any() or any(each.any() for each in a)
        count = len(a) + 1 if moves and not self._function.has_switches else PARAMETERS.orders
        time = power_series.constant(s.t, count)
        time.c[1:2] = time.size[1:2] = 1.0
        v, q = np.zeros((n, count)), np.zeros((n, count))
        v[:, 0], q[:, 0] = s.v, s.q
        for k, each in enumerate(a[: count - 1]):
            v[:, k + 1] = each / (k + 1)
        q[:, 1:] = v[:, :-1] / np.arange(1, count)
        arguments = [
            [time],
            *([PowerSeries(row, np.abs(row)) for row in part] for part in (q, v)),
            [power_series.constant(value, count) for value in s.p.tolist()],
        ]
        found = []
        for series in self._function.at(arguments, count, rounding):
            known = min((each.known for each in series), default=count)
            c, size = (
                np.array([getattr(each, part)[:known] for each in series]).reshape(len(series), known)
                for part in ("c", "size")
            )
            found.append(_Terms(c, size, known))
        return found, count


@dataclasses.dataclass(slots=True, eq=False)
class _Terms:
    """Coefficients (k, order) with the sizes of their terms, of the results of one kind; `known` of all."""

    c: Floats
    size: Floats
    known: int


class _Products:
    """The coefficients of a matrix along the motion."""

    def __init__(self, pattern: tuple[Numbers, Numbers, tuple[int, int]], terms: _Terms) -> None:
        (self._rows, self._columns, self._shape), self._terms = pattern, terms

    @property
    def first(self) -> Sparse:
        """The matrix at the instant."""
        return sparse(self._rows, self._columns, self._terms.c[:, 0], self._shape)

    def later(self, x: list[Floats], k: int, is_turned: bool = False) -> tuple[Floats, Floats]:
        """The sum of A_j x_(k - j) for j > 0, of A^T where it is turned, and the sizes of its terms."""
        rows, columns = (self._columns, self._rows) if is_turned else (self._rows, self._columns)
        total, size = np.zeros((2, self._shape[1] if is_turned else self._shape[0]))
        for j in range(1, k + 1):
            given = x[k - j][columns]
            total += np.bincount(rows, self._terms.c[:, j] * given, minlength=total.size)
            size += np.bincount(rows, self._terms.size[:, j] * np.abs(given), minlength=total.size)
        return total, size


class ContactOrders:
    """The orders of contacts at an instant, one after the other.

    known: the part of its terms to which the state is known. forces: what order zero says.
    """

    def __init__(self, series: MotionSeries, here: ContactInstant, known: float) -> None:
        self._series, self._here = series, here
        self._rounding = max(PARAMETERS.roundings * doubles.EPS, known)

    def decided(self, forces: ContactForces, level: Numbers, crossing: Flags) -> ContactForces:
        """The contacts that press among those that are closed and neither approach nor part, `level`; crossing (K,):
        those whose forces are zero there, as far as the instant is known."""
        here = self._here
        closed, squares = [j for j in forces.closed if not crossing[j]], here.squares(level)
        none = here.least_forces(level, forces.x) * squares
        is_open = (forces.accelerations[level] > none) & ~crossing[level]
        left = [j for j, parts in zip(level.tolist(), is_open, strict=True) if not parts and j not in closed]
        if not left:
            return forces
        a: list[Floats] = []
        equal: list[Floats] = []
        pushes: list[Floats] = []
        series, count = list[_Terms](), 0
        for k in range(PARAMETERS.orders):
            if k >= count or a[-1].any():
                series, count = self._series.at(here, a, self._rounding)
            if min(each.known for each in series) <= k:
                break
            found = self._order(series, (a, equal, pushes), (closed, left))
            if found is None:
                break
            pressing, leaving = found if k else ([j for j in each if not crossing[j]] for each in found)
            closed = sorted({*closed, *pressing})
            left = [j for j in left if j not in {*pressing, *leaving}]
            if not left:
                break
        return dataclasses.replace(forces, closed=tuple(closed))

    def _order(
        self,
        series: list[_Terms],
        before: tuple[list[Floats], list[Floats], list[Floats]],
        contacts: tuple[list[int], list[int]],
    ) -> tuple[list[int], list[int]] | None:
        """Solve one order, with the accelerations, multipliers and pushes of those before it, which go on with it;
        contacts that press by it, and that part, or lie on those that press."""
        here, (a, equal, pushes), (closed, left) = self._here, before, contacts
        k = len(a)
        force, gamma, gamma_contacts = series[:3]
        inertia, B, G = map(_Products, self._series.patterns, series[3:])
        h, h_size = force.c[:, k].copy(), force.size[:, k].copy()
        for sign, (value, size) in (
            (1.0, B.later(equal, k, True)),
            (1.0, G.later(pushes, k, True)),
            (-1.0, inertia.later(a, k)),
        ):
            h, h_size = h + sign * value, h_size + size
        (of_rows, rows_size), (moved, moved_size) = B.later(a, k), G.later(a, k)
        wanted = gamma.c[:, k] - of_rows, gamma_contacts.c[:, k] - moved
        sizes = gamma.size[:, k] + rows_size, gamma_contacts.size[:, k] + moved_size
        fixed, asked = np.array(closed, dtype=np.intp), np.array(left, dtype=np.intp)
        # All that is nothing but rounding moves nothing.
        h = np.where(np.abs(h) > self._rounding * h_size, h, 0.0)
        of_equalities, of_contacts = (
            np.where(np.abs(w) > self._rounding * s, w, 0.0) for w, s in zip(wanted, sizes, strict=True)
        )
        if not (h.any() or of_equalities.any() or of_contacts.any()):
            a.append(h)
            equal.append(of_equalities)
            pushes.append(of_contacts)
            return [], []
        first = G.first
        rows = stacked(B.first, first[fixed.tolist(), :])
        equations = rows, np.concatenate([of_equalities, of_contacts[fixed]])
        try:
            found = impact_law.forces(
                here.metric, h, equations, (first[asked.tolist(), :], of_contacts[asked])
            )
        except impact_law.LawError:
            return None
        count = of_equalities.size
        push = np.zeros(G.first.shape[0])
        push[fixed], push[asked] = found.of_equalities[count:], found.of_contacts
        a.append(found.x)
        equal.append(found.of_equalities[:count])
        pushes.append(push)
        carried, entries = np.zeros(asked.size, dtype=bool), np.abs(np.array(first[asked.tolist(), :]))
        h_size = h_size + np.abs(np.array(rows)).T @ np.abs(found.of_equalities)
        room = self._rounding * (
            entries @ (np.abs(here.metric.solved(h_size)) + np.abs(found.x)) + sizes[1][asked]
        )
        presses = found.of_contacts * here.squares(asked) > room
        shared = presses & ~found.unique[-asked.size :]
        if closed and shared.any():
            carried[shared] = self._are_linked((rows, len(closed)), first[asked[shared].tolist(), :])
        parts = carried | ~presses & (found.slack > room)
        return asked[presses & ~carried].tolist(), asked[parts].tolist()

    def _are_linked(self, before: tuple[Sparse, int], contacts: Sparse) -> Flags:
        """True for rows of contacts (k,) that share a load with some that press already, the last so many of the rows
        before them: who takes how much of it, the run finds as their loads grow."""
        rows, count = before
        null = rank.estimate(MetricRows(stacked(rows, contacts), self._here.metric)).dependences
        are_together = np.abs(null.T @ null) > doubles.ROOT
        first = rows.shape[0]
        linked = np.arange(len(are_together)) >= first - count
        linked[first:] = False
        for _ in are_together:
            linked = linked | are_together[linked].any(axis=0)
        return np.asarray(linked[first:])
